//! The soak before a run: the machine at rest, so that sensors that should read the same can be compared.

use crate::step_sources::step_source::{StepSource, StepSourceError};
use mapper_core::{PlanStep, Soak};

/// The steps of another source, delayed by a soak.
pub struct SoakSource<'a> {
    inner: &'a mut dyn StepSource,
    soak: Soak,
}

impl<'a> SoakSource<'a> {
    /// `inner` after `soak`.
    pub fn new(inner: &'a mut dyn StepSource, soak: Soak) -> Self {
        SoakSource { inner, soak }
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

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.inner.next_step()?;
        Ok(next.map(|step| PlanStep { start_s: step.start_s + self.soak.duration_s, ..step }))
    }
}
