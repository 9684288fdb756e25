//! Compares the mean speed at the end of a step with its target.

use mapper_core::{Channel, GuardName, PlanStep, SampleBatch, SpeedBand, StepKind, Trip};
use std::collections::VecDeque;

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

    /// Stores the readings up to `now_s`.
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
