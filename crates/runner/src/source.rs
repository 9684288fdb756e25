//! Where the steps of a run come from: a plan, or something that decides as it goes.

use mapper_core::{Plan, PlanStep, SampleBatch, Soak, StepMarker};

/// Why a source has no next step though it should; the run ends in its safe state.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct StepSourceError {
    /// The source's own error: what went wrong, and what to do.
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl StepSourceError {
    /// Wraps the source's own error.
    pub fn of(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        StepSourceError { source: Box::new(error) }
    }
}

/// Yields steps one by one, and sees what becomes of them. Guards and observers look on all the same.
///
/// A source that changes the steps of another names it ([`StepSource::inner`] and [`StepSource::inner_mut`], both); whatever it
/// does not say itself is then as there, and what it is told is passed on.
pub trait StepSource {
    /// The source whose steps these are; none by default.
    fn inner(&self) -> Option<&dyn StepSource> {
        None
    }

    /// The same, to be told and asked.
    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        None
    }

    /// How the machine rests before the warm-up; not at all by default.
    fn soak(&self) -> Option<Soak> {
        self.inner()?.soak()
    }

    /// Time at the first point before its step, s; none by default.
    fn warm_up_s(&self) -> f64 {
        self.inner().map_or(0.0, StepSource::warm_up_s)
    }

    /// Time without flow after the last step, s; none by default.
    fn cool_down_s(&self) -> f64 {
        self.inner().map_or(0.0, StepSource::cool_down_s)
    }

    /// Whether the next step is there. One that is still being made is waited for only for some milliseconds, so that rig and operator
    /// are not forgotten meanwhile. Always by default.
    fn is_ready(&mut self) -> bool {
        self.inner_mut().is_none_or(StepSource::is_ready)
    }

    /// The next step; `None` ends the run. Its index counts up from 0. Waits where [`is_ready`](Self::is_ready) does not say that it is there.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError>;

    /// The step that was handed out last begins with its jump; again where a guard has it made again. Nothing by default.
    fn begins(&mut self, marker: &StepMarker) {
        if let Some(inner) = self.inner_mut() {
            inner.begins(marker);
        }
    }

    /// Looks at new samples, warm-up included; true ends the current step before its time. Never does by default.
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

    /// A guard has left the step out; the marker holds where it was cut short.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner_mut().map_or(Ok(()), |inner| inner.skipped(marker))
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
