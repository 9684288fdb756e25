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
pub trait StepSource {
    /// How the machine rests before the warm-up; not at all by default.
    fn soak(&self) -> Option<Soak> {
        None
    }

    /// Time at the first point before its step, s.
    fn warm_up_s(&self) -> f64;

    /// Time without flow after the last step, s.
    fn cool_down_s(&self) -> f64;

    /// The next step; `None` ends the run. Its index counts up from 0.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError>;

    /// The step that was handed out last begins with its jump; again where a guard has it made again. Nothing by default.
    fn begins(&mut self, _marker: &StepMarker) {}

    /// Looks at new samples, warm-up included; true ends the current step before its time. Never does by default.
    fn on_batch(&mut self, _batch: &SampleBatch) -> bool {
        false
    }

    /// A step has ended; the marker holds its real end. Not called for a step that a guard or a fault has cut short.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn after_step(&mut self, _marker: &StepMarker) -> Result<(), StepSourceError> {
        Ok(())
    }

    /// A guard has left the step out; the marker holds where it was cut short.
    ///
    /// # Errors
    /// [`StepSourceError`] ends the run in its safe state.
    fn skipped(&mut self, _marker: &StepMarker) -> Result<(), StepSourceError> {
        Ok(())
    }

    /// Notes for the recording since the last call. None by default.
    fn take_notes(&mut self) -> Vec<String> {
        Vec::new()
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
