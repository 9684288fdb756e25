//! The soak before a run: the machine at rest, so that sensors which must read the same can be held against each other.

use crate::source::{StepSource, StepSourceError};
use mapper_core::{PlanStep, Soak};

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
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn soak(&self) -> Option<Soak> {
        Some(self.soak)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.inner.next_step()?;
        Ok(next.map(|step| PlanStep { start_s: step.start_s + self.soak.duration_s, ..step }))
    }
}
