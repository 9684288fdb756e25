//! The soak before a run: the machine at rest, so that sensors which must read the same can be held against each other.

use crate::source::{StepSource, StepSourceError};
use mapper_core::{PlanStep, SampleBatch, Soak, StepMarker};

/// The steps of another source, after a soak. All of them come later by it.
pub struct Soaked<'a> {
    inner: &'a mut dyn StepSource,
    soak: Soak,
}

impl<'a> Soaked<'a> {
    /// `inner` after `soak`.
    pub fn new(inner: &'a mut dyn StepSource, soak: Soak) -> Self {
        Soaked { inner, soak }
    }
}

impl StepSource for Soaked<'_> {
    fn soak(&self) -> Option<Soak> {
        Some(self.soak)
    }

    fn warm_up_s(&self) -> f64 {
        self.inner.warm_up_s()
    }

    fn cool_down_s(&self) -> f64 {
        self.inner.cool_down_s()
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.inner.next_step()?;
        Ok(next.map(|step| PlanStep { start_s: step.start_s + self.soak.duration_s, ..step }))
    }

    fn begins(&mut self, marker: &StepMarker) {
        self.inner.begins(marker);
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        self.inner.on_batch(batch)
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner.after_step(marker)
    }

    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner.skipped(marker)
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.inner.take_notes()
    }
}
