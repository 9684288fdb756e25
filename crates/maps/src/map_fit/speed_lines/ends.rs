//! The two ends of the measured speeds, with the widening of a fit's errors beyond each.

/// Factors on the variance beyond one end; 1 if the roughness explains the deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Widening {
    /// Of the shape of lines.
    pub shape: f64,
    /// Of work, and so of efficiency.
    pub work: f64,
}

/// No widening. Source: definition.
pub(crate) const NO_WIDENING: Widening = Widening { shape: 1.0, work: 1.0 };

/// An end of the measured speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    Slow,
    Fast,
}

/// Widenings of both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EndWidenings {
    pub slow: Widening,
    pub fast: Widening,
}

impl EndWidenings {
    pub(crate) const NONE: EndWidenings = EndWidenings { slow: NO_WIDENING, fast: NO_WIDENING };

    pub(crate) fn both(factors: Widening) -> EndWidenings {
        EndWidenings { slow: factors, fast: factors }
    }
}
