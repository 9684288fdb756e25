//! Events of a session, as data for observers.

use mapper_core::{Channel, Event, IdentifiedPoint, RigDescription, StepMarker};
use serde::Serialize;

/// One event.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum SessionEvent {
    /// A run begins on this rig.
    RunStarted {
        /// The rig.
        rig: RigDescription,
        /// Planned steps; a script may make more or fewer.
        steps: usize,
        /// Planned rig time including soak, warm-up and cool-down, s.
        duration_s: f64,
    },
    /// Current time of the rig.
    RigTime {
        /// Run time, s.
        t_s: f64,
    },
    /// A step begins; `end_s` of the marker is the planned end.
    StepStarted {
        /// The step.
        #[serde(flatten)]
        marker: StepMarker,
        /// Planned rig time from its start to the end of the run, s.
        left_s: f64,
    },
    /// A step has ended; `end_s` of the marker is the actual end.
    StepEnded(StepMarker),
    /// Message from the rig or the runner: tripped guard, surge, stop, safe state or note.
    Reported(Event),
    /// The rig is safe and released. All further work uses the recording.
    RigReleased,
    /// Latest valid reading of each channel.
    Readings {
        /// Run time, s.
        t_s: f64,
        /// Values in SI units.
        values: Vec<(Channel, f64)>,
    },
    /// Preliminary result of a step that has just ended, before zero subtraction and joint identification.
    PointEstimated(Box<IdentifiedPoint>),
    /// A point was identified.
    PointIdentified(Box<IdentifiedPoint>),
    /// Progress of long work that has no steps.
    Progress {
        /// Completed share, 0 to 1.
        done_ratio: f64,
        /// Description of the work.
        what: String,
    },
    /// Progress of work in separate pieces.
    PiecesDone {
        /// Completed pieces.
        done: usize,
        /// Total pieces.
        of: usize,
    },
}

/// Called with every event, from any thread that works for the session.
pub type OnEvent<'a> = &'a (dyn Fn(&SessionEvent) + Sync);
