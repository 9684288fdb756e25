//! Sources of steps: a plan, and the soak before one, which lasts until the sensors that matter rest.

use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, Plan, PlanStep, SampleBatch, Soak, StepMarker, is_reading};
use std::collections::VecDeque;

/// Why a source failed to provide its next step; the run ends in its safe state.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct StepSourceError {
    /// The source's own error: the failure and its remedy.
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl StepSourceError {
    /// Wraps the source's own error.
    pub fn new(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        StepSourceError { source: Box::new(error) }
    }
}

/// Provides steps one by one, and receives their results; an error ends the run in its safe state. Guards and observers are independent of it.
///
/// A source that wraps another one implements both [`StepSource::inner`] and [`StepSource::inner_mut`]. Methods that it does not
/// implement are then forwarded to the wrapped source.
pub trait StepSource {
    /// The wrapped source; none by default.
    fn inner(&self) -> Option<&dyn StepSource> {
        None
    }

    /// The wrapped source, mutable.
    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        None
    }

    /// The soak before the warm-up; none by default.
    fn soak(&self) -> Option<Soak> {
        self.inner()?.soak()
    }

    /// Whether the sensors rest whose rest ends a soak; false by default.
    fn is_at_rest(&self) -> bool {
        self.inner().is_some_and(StepSource::is_at_rest)
    }

    /// Warm-up time at the first point before its step, s; none by default.
    fn warm_up_s(&self) -> f64 {
        self.inner().map_or(0.0, StepSource::warm_up_s)
    }

    /// Cool-down time without flow after the last step, s; none by default.
    fn cool_down_s(&self) -> f64 {
        self.inner().map_or(0.0, StepSource::cool_down_s)
    }

    /// Whether the next step is available. The call waits only a few milliseconds for it, because the rig and the operator need
    /// attention meanwhile. Always true by default.
    fn is_ready(&mut self) -> bool {
        self.inner_mut().is_none_or(StepSource::is_ready)
    }

    /// The next step; `None` ends the run. Its index counts up from 0. Blocks unless [`is_ready`](Self::is_ready) returned true.
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError>;

    /// The standstill before the latest step; none by default.
    fn rest(&self) -> Option<Soak> {
        self.inner()?.rest()
    }

    /// Called when the latest step starts with its jump, and again if a guard requests that the step is repeated. Does nothing by default.
    fn before_step(&mut self, marker: &StepMarker) {
        if let Some(inner) = self.inner_mut() {
            inner.before_step(marker);
        }
    }

    /// Receives new samples, warm-up included; true ends the current step early. False by default.
    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        self.inner_mut().is_some_and(|inner| inner.on_batch(batch))
    }

    /// A step has ended; the marker holds its real end. Not called for a step that a guard or a fault has cut short.
    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner_mut().map_or(Ok(()), |inner| inner.after_step(marker))
    }

    /// A guard has skipped the step; the marker holds the time at which it was cut short.
    fn after_skipped_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner_mut().map_or(Ok(()), |inner| inner.after_skipped_step(marker))
    }

    /// Notes for the recording since the last call. None by default.
    fn take_notes(&mut self) -> Vec<String> {
        self.inner_mut().map(StepSource::take_notes).unwrap_or_default()
    }
}

/// The steps of a plan, in order.
#[derive(Debug, Clone)]
pub struct PlanSteps<'a> {
    plan: &'a Plan,
    next: usize,
}

impl<'a> PlanSteps<'a> {
    /// All steps of `plan`.
    pub fn new(plan: &'a Plan) -> Self {
        PlanSteps { plan, next: 0 }
    }
}

impl StepSource for PlanSteps<'_> {
    fn warm_up_s(&self) -> f64 {
        self.plan.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        self.plan.cool_down_s
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let step = self.plan.steps.get(self.next).cloned();
        self.next += 1;
        Ok(step)
    }
}

/// The steps of another source, delayed by a soak.
pub struct SoakSource<'a> {
    inner: &'a mut dyn StepSource,
    soak: Soak,
    /// `None` after the soak.
    watch: Option<RestWatch>,
}

impl<'a> SoakSource<'a> {
    /// `inner` after `soak`.
    pub fn new(inner: &'a mut dyn StepSource, soak: Soak) -> Self {
        SoakSource { inner, soak, watch: soak.until_settled.then(RestWatch::default) }
    }
}

impl StepSource for SoakSource<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn soak(&self) -> Option<Soak> {
        Some(self.soak)
    }

    fn is_at_rest(&self) -> bool {
        self.watch.as_ref().is_some_and(RestWatch::is_at_rest)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        if let Some(watch) = &mut self.watch {
            watch.on_batch(batch);
        }
        self.inner.on_batch(batch)
    }

    fn before_step(&mut self, marker: &StepMarker) {
        self.watch = None;
        self.inner.before_step(marker);
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.inner.next_step()?;
        Ok(next.map(|step| PlanStep { start_s: step.start_s + self.soak.duration_s, ..step }))
    }
}

/// Length of a mean, s. Bound: noise of 0.1 K averages to 0.02 K.
const BLOCK_S: f64 = 30.0;
/// Number of compared means. Bound: two and a half minutes, which the zero uses after the shortest soak.
const BLOCKS: usize = 5;
/// Sensors whose rest ends a soak: a housing takes an hour, and its offset is declared.
const WATCHED: [Channel; 2] = [Channel::T1, Channel::T2];

/// Means of the watched sensors during a soak.
#[derive(Debug, Default)]
pub(crate) struct RestWatch {
    /// End of the current block, s; `None` before the first sample.
    block_end_s: Option<f64>,
    /// Sums and counts of the current block.
    sums: [(f64, usize); WATCHED.len()],
    means: VecDeque<[f64; WATCHED.len()]>,
}

impl RestWatch {
    pub(crate) fn on_batch(&mut self, batch: &SampleBatch) {
        let columns = WATCHED.map(|channel| batch.columns.iter().find(|column| column.channel == channel));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let end_s = *self.block_end_s.get_or_insert(t_s + BLOCK_S);
            if *t_s >= end_s {
                self.end_block();
                self.block_end_s = Some(t_s + BLOCK_S);
            }
            for ((sum, count), (column, channel)) in self.sums.iter_mut().zip(columns.iter().zip(WATCHED)) {
                let value = column.and_then(|column| column.values.get(index)).copied();
                if let Some(value) = value.filter(|value| is_reading(channel, *value)) {
                    *sum += value;
                    *count += 1;
                }
            }
        }
    }

    fn end_block(&mut self) {
        self.means.push_back(self.sums.map(|(sum, count)| sum / count as f64));
        self.sums = Default::default();
        if self.means.len() > BLOCKS {
            self.means.pop_front();
        }
    }

    /// Whether each watched sensor drifts by less than what the zero accepts. A sensor without readings never rests.
    pub(crate) fn is_at_rest(&self) -> bool {
        let means: Vec<_> = self.means.iter().copied().collect();
        let [first, second, .., before_last, last] = means.as_slice() else { return false };
        let apart_min = (BLOCKS - 2) as f64 * BLOCK_S / S_PER_MIN;
        means.len() == BLOCKS
            && (0..WATCHED.len()).all(|i| {
                let drift_k = 0.5 * (last[i] + before_last[i] - first[i] - second[i]);
                (drift_k / apart_min).abs() <= Soak::MAX_DRIFT_K_MIN
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    /// T2 that approaches 298 K with a time constant of two minutes from 5 K above drifts by 0.1 K/min after two minutes times ln(25), 6.4 min; the
    /// middle of the compared means is reached later.
    #[test]
    fn a_probe_that_cools_rests_when_its_drift_is_small() {
        let mut watch = RestWatch::default();
        let mut rested_s = None;
        for second in 0..1200 {
            let t_s: Vec<f64> = (0..10).map(|i| f64::from(second) + 0.1 * f64::from(i)).collect();
            let column = |channel, values| ChannelColumn { channel, values };
            let t2 = t_s.iter().map(|t| 298.0 + 5.0 * (-t / 120.0).exp()).collect();
            watch.on_batch(&SampleBatch {
                columns: vec![column(Channel::T1, vec![298.0; 10]), column(Channel::T2, t2)],
                t_s,
                ..SampleBatch::default()
            });
            if watch.is_at_rest() && rested_s.is_none() {
                rested_s = Some(second);
            }
        }
        assert!((400..560).contains(&rested_s.unwrap()), "{rested_s:?}");
        // Without readings of T2 nothing is known.
        let mut blind = RestWatch::default();
        for second in 0..600 {
            let column = ChannelColumn { channel: Channel::T1, values: vec![298.0] };
            blind.on_batch(&SampleBatch {
                t_s: vec![f64::from(second)],
                columns: vec![column],
                ..SampleBatch::default()
            });
        }
        assert!(!blind.is_at_rest());
    }
}
