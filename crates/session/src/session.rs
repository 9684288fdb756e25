//! Common data of all session operations, and their events, as data for observers.

use crate::Registry;
use mapper_core::{Channel, Event, IdentifiedPoint, RigDescription, StepMarker};
use mapper_runner::Operator;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// Plug-ins, an observer and stop flags.
#[derive(Clone, Copy)]
pub struct Session<'a> {
    /// The plug-ins.
    pub registry: &'a Registry,
    /// Called with every event.
    pub on_event: OnEvent<'a>,
    /// Set by the caller to stop at the next sample; the rig then goes to its safe state.
    pub stop: &'a AtomicBool,
    /// Set by the caller to stop a run at the end of its step.
    pub stop_after_step: &'a AtomicBool,
    /// Other operator requests during a run; `None` without an operator.
    pub operator: Option<&'a Operator>,
    /// Whether each step is identified separately as soon as it ends, for observers.
    pub estimates: bool,
}

/// Stop flag of a session that is never stopped.
static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Session<'a> {
    /// A session without observer and stop flag.
    pub fn new(registry: &'a Registry) -> Self {
        Session {
            registry,
            on_event: &|_| {},
            stop: &NEVER,
            stop_after_step: &NEVER,
            operator: None,
            estimates: false,
        }
    }

    /// Sends an event to the observer.
    pub(crate) fn send(&self, event: SessionEvent) {
        (self.on_event)(&event);
    }
}

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
