//! The two ends of the measured speeds, and how much wider than its roughness says a fit's errors are beyond each.

/// Factors on the variance of what is drawn on beyond one end; 1 if the roughness says enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beyond {
    /// Of the shape of lines.
    pub shape: f64,
    /// Of work, and so of efficiency.
    pub work: f64,
}

/// As the roughness says.
pub(crate) const PLAIN: Beyond = Beyond { shape: 1.0, work: 1.0 };

/// An end of the measured speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    Slow,
    Fast,
}

/// Factors of both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BothEnds {
    pub slow: Beyond,
    pub fast: Beyond,
}

impl BothEnds {
    pub(crate) const PLAIN: BothEnds = BothEnds { slow: PLAIN, fast: PLAIN };

    pub(crate) fn both(factors: Beyond) -> BothEnds {
        BothEnds { slow: factors, fast: factors }
    }
}
