//! Guards end a step or a run before damage occurs: each is an object outside the runner. Also the check of the speed at the end of a step.

use mapper_core::{
    Channel, GuardName, OperatingPoint, PlanStep, Reaction, SampleBatch, SpeedBand, StepKind, Trip,
};
use std::collections::VecDeque;

/// The commanded state of the rig, as far as guards need it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommandedState {
    /// Whether gas flows.
    pub running: bool,
    /// Start of the current step, s; `None` outside steps.
    pub step_since_s: Option<f64>,
    /// Target of the current step.
    pub aim: Option<OperatingPoint>,
    /// Commanded opening of the valve, and the time of its last change, s.
    pub valve: Option<(f64, f64)>,
    /// Time of the last jump of P3 or the valve, s.
    pub jumped_s: Option<f64>,
}

/// What a run does after a guard has tripped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TripResponse {
    /// It goes on.
    Continue,
    /// It holds its setpoints.
    Hold,
    /// It ends the step.
    EndStep,
    /// It ends in the safe state.
    End,
}

impl TripResponse {
    /// Outside a step nothing can be cut short, and a hold that has lasted too long is none: the run ends.
    pub fn of(reaction: Reaction, in_step: bool, may_hold: bool) -> Self {
        match reaction {
            Reaction::Note => TripResponse::Continue,
            Reaction::Hold if may_hold => TripResponse::Hold,
            Reaction::SmallerSteps | Reaction::SkipStep if in_step => TripResponse::EndStep,
            _ => TripResponse::End,
        }
    }
}

/// Whether a requested stop ends the run now: one that waits for the end of the step does so outside steps.
pub fn stop_is_due(now: bool, after_step: bool, in_step: bool) -> bool {
    now || (after_step && !in_step)
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

/// Duration over which the speed is averaged, s. Steps shorter than three times this are not checked.
const AVERAGING_S: f64 = 10.0;

/// Times and speeds of the last seconds.
#[derive(Debug, Default)]
pub(crate) struct SpeedHistory {
    recent: VecDeque<(f64, f64)>,
}

impl SpeedHistory {
    pub(crate) fn clear(&mut self) {
        self.recent.clear();
    }

    pub(crate) fn add(&mut self, batch: &SampleBatch, now_s: f64) {
        let Some(speeds) = batch.column(Channel::ShaftSpeed) else { return };
        let rows = batch.t_s.iter().copied().zip(speeds.iter().copied());
        self.recent.extend(rows.filter(|(_, speed)| speed.is_finite()));
        while self.recent.front().is_some_and(|(t_s, _)| *t_s < now_s - AVERAGING_S) {
            self.recent.pop_front();
        }
    }

    /// Trips if the speed of the step that ends at `now_s` is outside the band.
    pub(crate) fn check(&self, band: SpeedBand, step: &PlanStep, now_s: f64) -> Option<Trip> {
        if step.dwell_s < 3.0 * AVERAGING_S || step.kind == StepKind::Approach || self.recent.is_empty() {
            return None;
        }
        let mean_rpm = self.recent.iter().map(|(_, rpm)| rpm).sum::<f64>() / self.recent.len() as f64;
        let off_ratio = mean_rpm / step.to.speed_rpm - 1.0;
        (off_ratio.abs() > band.band_ratio).then(|| Trip {
            t_s: now_s,
            guard: GuardName::Speed,
            reaction: band.reaction,
            reason: format!(
                "the speed was not reached: {:.2} krpm requested, {:.2} krpm in the last {AVERAGING_S:.0} s ({:+.1} %, at most \
                 {:.1} % allowed)",
                step.to.speed_rpm / 1e3,
                mean_rpm / 1e3,
                100.0 * off_ratio,
                100.0 * band.band_ratio
            ),
        })
    }
}
