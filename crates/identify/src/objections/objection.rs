//! A failed check of the readings.

use mapper_core::{Recording, Warning};

/// A failed check of the readings, and the steps that depend on them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Objection {
    /// Channel and values.
    pub(crate) warning: Warning,
    /// Positions of the steps.
    pub(crate) steps: Vec<usize>,
    /// Whether identification omits the samples concerned, so that the rest of the step can be used.
    pub(crate) samples_left_out: bool,
}

impl Objection {
    pub(crate) fn new(warning: Warning, steps: Vec<usize>) -> Self {
        Objection { warning, steps, samples_left_out: false }
    }

    /// An objection to all steps of a recording.
    pub(crate) fn to_all(warning: Warning, recording: &Recording) -> Self {
        Objection::new(warning, (0..recording.steps.len()).collect())
    }
}
