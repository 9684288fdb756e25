//! Events of a run, apart from samples.

use serde::{Deserialize, Serialize};

/// Kind of an [`Event`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The compressor crossed its surge line.
    SurgeEntered,
    /// The compressor returned from the surge side.
    SurgeLeft,
    /// The shaft exceeded the overspeed limit.
    OverspeedEntered,
    /// The shaft fell below the overspeed limit again.
    OverspeedLeft,
    /// A soak for a zero of the sensors began.
    SoakStarted,
    /// The soak ended.
    SoakEnded,
    /// A step ended away from its target speed.
    SpeedNotReached,
    /// A guard of the runner tripped.
    GuardTripped,
    /// A guard tripped that does not end the run; the message contains the reaction.
    GuardActed,
    /// The rig tripped by itself: it no longer follows its setpoints.
    RigTripped,
    /// The rig was put into its safe state.
    SafeState,
    /// The safe state was not reached, or the state of the rig is uncertain: an operator must acknowledge this before another run.
    Latched,
    /// The run continues after an interruption.
    Resumed,
    /// The run was stopped by its operator.
    Interrupted,
    /// A remark for people.
    Note,
}

/// Something that happened at an instant of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Run time, s.
    pub t_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// One sentence with values and units.
    pub message: String,
}
