//! A failed check of the readings.

/// A failed check of the readings, and the steps that depend on them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Objection {
    /// Stable code of the warning.
    pub(crate) code: &'static str,
    /// Channel, values with units, what to do.
    pub(crate) message: String,
    /// Positions of the steps.
    pub(crate) steps: Vec<usize>,
    /// Whether identification omits the samples concerned, so that the rest of the step can be used.
    pub(crate) samples_left_out: bool,
}

impl Objection {
    pub(crate) fn new(code: &'static str, message: impl Into<String>, steps: Vec<usize>) -> Self {
        Objection { code, message: message.into(), steps, samples_left_out: false }
    }
}
