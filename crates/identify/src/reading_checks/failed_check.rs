//! A failed check of the readings.

use mapper_core::{Recording, Warning};

/// A failed check of the readings, and the steps that depend on them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FailedCheck {
    /// Channel and values.
    pub(crate) warning: Warning,
    /// Positions of the steps.
    pub(crate) steps: Vec<usize>,
    /// Whether identification omits the samples concerned, so that the rest of the step can be used.
    pub(crate) samples_left_out: bool,
}

impl FailedCheck {
    pub(crate) fn new(warning: Warning, steps: Vec<usize>) -> Self {
        FailedCheck { warning, steps, samples_left_out: false }
    }

    /// A failed check that concerns all steps of a recording.
    pub(crate) fn of_all_steps(warning: Warning, recording: &Recording) -> Self {
        FailedCheck::new(warning, (0..recording.steps.len()).collect())
    }
}
