//! One thing that speaks against readings.

/// Something that speaks against readings, and the steps that rest on them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Objection {
    /// Stable code of the warning.
    pub(crate) code: &'static str,
    /// Channel, values with units, what to do.
    pub(crate) message: String,
    /// Positions of the steps.
    pub(crate) steps: Vec<usize>,
    /// Whether identification leaves out the samples that it is about, so that the rest of a step may speak.
    pub(crate) samples_left_out: bool,
}

impl Objection {
    pub(crate) fn new(code: &'static str, message: String, steps: Vec<usize>) -> Self {
        Objection { code, message, steps, samples_left_out: false }
    }
}
