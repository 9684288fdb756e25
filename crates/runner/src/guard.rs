//! What ends a step or a run before harm is done: each guard is an object beside the runner, not an `if` inside it.

use mapper_core::{GuardName, OperatingPoint, Reaction, SampleBatch};

/// What a guard has to say.
#[derive(Debug, Clone, PartialEq)]
pub struct Trip {
    /// Run time, s.
    pub t_s: f64,
    /// Which guard.
    pub guard: GuardName,
    /// What is to be done.
    pub reaction: Reaction,
    /// One sentence with values and units.
    pub reason: String,
}

/// What the rig has been told, as far as guards need it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Told {
    /// Whether gas flows.
    pub running: bool,
    /// Since when the setpoints have been those of the current step, s; `None` outside steps.
    pub step_since_s: Option<f64>,
    /// Where the current step aims.
    pub aim: Option<OperatingPoint>,
    /// When P3 or the valve last jumped, s.
    pub jumped_s: Option<f64>,
}

/// Looks at every sample and may trip.
pub trait Guard: Send {
    /// Looks at the samples of a poll up to `now_s`, of which there may be none, and trips once for each violation.
    fn look(&mut self, batch: &SampleBatch, now_s: f64, told: &Told) -> Option<Trip>;

    /// Whether it is still violated: what is held goes on when it is not.
    fn is_violated(&self) -> bool {
        false
    }

    /// Whether it may trip within the next second: the rig is then asked sample by sample.
    fn is_alert(&self) -> bool {
        false
    }
}

/// All guards of a run, looked at together.
pub(crate) struct Bench<'a> {
    guards: &'a mut [Box<dyn Guard>],
}

impl<'a> Bench<'a> {
    pub(crate) fn new(guards: &'a mut [Box<dyn Guard>]) -> Self {
        Bench { guards }
    }

    /// Every trip of these samples, the gravest first; of equal ones the earliest.
    pub(crate) fn look(&mut self, batch: &SampleBatch, now_s: f64, told: &Told) -> Vec<Trip> {
        let mut trips: Vec<Trip> =
            self.guards.iter_mut().filter_map(|guard| guard.look(batch, now_s, told)).collect();
        trips.sort_by(|a, b| b.reaction.cmp(&a.reaction).then(a.t_s.total_cmp(&b.t_s)));
        trips
    }

    pub(crate) fn is_alert(&self) -> bool {
        self.guards.iter().any(|guard| guard.is_alert())
    }

    pub(crate) fn is_violated(&self) -> bool {
        self.guards.iter().any(|guard| guard.is_violated())
    }
}
