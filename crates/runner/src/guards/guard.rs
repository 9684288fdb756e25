//! Guards end a step or a run before damage occurs. Each guard is an object outside the runner, not an `if` inside it.

use mapper_core::{OperatingPoint, SampleBatch, Trip};

/// The commanded state of the rig, as far as guards need it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandedState {
    /// Whether gas flows.
    pub running: bool,
    /// Start of the current step, s; `None` outside steps.
    pub step_since_s: Option<f64>,
    /// Target of the current step.
    pub aim: Option<OperatingPoint>,
    /// Time of the last jump of P3 or the valve, s.
    pub jumped_s: Option<f64>,
}

/// Checks every sample and may trip.
pub trait Guard: Send {
    /// Checks the samples of a poll up to `now_s` (possibly none). Each violation trips once.
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip>;

    /// Whether the violation continues: a hold ends when it does not.
    fn is_violated(&self) -> bool {
        false
    }

    /// Whether it may trip within the next second: the rig is then polled sample by sample.
    fn is_alert(&self) -> bool {
        false
    }
}

/// All guards of a run, checked together.
pub(crate) struct ActiveGuards<'a> {
    guards: &'a mut [Box<dyn Guard>],
}

impl<'a> ActiveGuards<'a> {
    pub(crate) fn new(guards: &'a mut [Box<dyn Guard>]) -> Self {
        ActiveGuards { guards }
    }

    /// All trips of these samples, the most severe first, then the earliest.
    pub(crate) fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Vec<Trip> {
        let mut trips: Vec<Trip> =
            self.guards.iter_mut().filter_map(|guard| guard.check(batch, now_s, state)).collect();
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
