//! What happens while a session works, as data for whoever looks on.

use mapper_core::{Channel, Event, IdentifiedPoint, RigDescription, StepMarker};
use serde::Serialize;

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum SessionEvent {
    /// A run begins on this rig.
    RunStarted {
        /// The rig.
        rig: RigDescription,
        /// Steps planned; a script may make more or fewer.
        steps: usize,
        /// Rig time planned, soak, warm-up and cool-down included, s.
        duration_s: f64,
    },
    /// The rig has come so far.
    RigTime {
        /// Run time, s.
        t_s: f64,
    },
    /// A step begins; the marker's `end_s` is the planned one.
    StepStarted(StepMarker),
    /// A step has ended; the marker's `end_s` is the real one.
    StepEnded(StepMarker),
    /// The rig or the runner has something to tell: a guard that tripped, surge, a stop, the safe state, a note.
    Told(Event),
    /// The rig is safe and let go; what follows is made from the recording.
    RigReleased,
    /// The last good reading of each channel.
    Readings {
        /// Run time, s.
        t_s: f64,
        /// SI.
        values: Vec<(Channel, f64)>,
    },
    /// A step that has just ended, identified by itself: before the zero is subtracted and before all steps are identified
    /// together.
    PointEstimated(Box<IdentifiedPoint>),
    /// A point was identified.
    PointIdentified(Box<IdentifiedPoint>),
    /// Long work that has no steps has come so far.
    Progress {
        /// Share done, 0 to 1.
        done_ratio: f64,
        /// What is being done, for people.
        what: String,
    },
    /// Some of many pieces of work are done.
    PiecesDone {
        /// Pieces done.
        done: usize,
        /// Pieces in total.
        of: usize,
    },
}

/// Called with every event, from any thread that works for the session.
pub type OnEvent<'a> = &'a (dyn Fn(&SessionEvent) + Sync);
