//! What happened during a run, apart from samples.

use serde::{Deserialize, Serialize};

/// Kind of an [`Event`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The compressor went past its surge line.
    SurgeEntered,
    /// The compressor came back from the surge side.
    SurgeLeft,
    /// The shaft went above the overspeed limit.
    OverspeedEntered,
    /// The shaft came back below the overspeed limit.
    OverspeedLeft,
    /// The machine was put to rest for a zero of its sensors.
    SoakStarted,
    /// That rest is over.
    SoakEnded,
    /// A step has ended off the speed that it was asked for.
    SpeedNotReached,
    /// A guard of the runner tripped.
    GuardTripped,
    /// A guard tripped that does not end the run: what was done stands in the message.
    GuardActed,
    /// The rig has tripped by itself: it no longer follows its setpoints.
    RigTripped,
    /// The rig was put into its safe state.
    SafeState,
    /// The safe state was not reached, or the rig is in doubt: no other run begins before that is acknowledged.
    Latched,
    /// The run goes on after it was broken off.
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
    /// What kind of thing happened.
    pub kind: EventKind,
    /// One sentence with values and units.
    pub message: String,
}
