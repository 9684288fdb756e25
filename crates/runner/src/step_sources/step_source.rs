//! Sources of steps: a plan, and the soak before one.

use crate::step_sources::rest_watch::RestWatch;
use mapper_core::{Plan, PlanStep, SampleBatch, Soak, StepMarker};

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

/// Provides steps one by one, and receives their results. Guards and observers are independent of it.
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
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError>;

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
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner_mut().map_or(Ok(()), |inner| inner.after_step(marker))
    }

    /// A guard has skipped the step; the marker holds the time at which it was cut short.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
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
