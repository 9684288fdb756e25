//! Errors of the map fit.

/// Why a map could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapFitError {
    /// Fewer than two distinguishable speeds.
    #[error("the map has {0} speed line(s) with points; a fit over speed needs at least 2")]
    TooFewLines(usize),
    /// Too few points to determine the lines.
    #[error(
        "the map has {points} points and {with_eta} efficiencies; a fit needs at least 8 and 6, preferably 5 or more on each line"
    )]
    TooFewPoints {
        /// Points with flow and pressure ratio.
        points: usize,
        /// Points with an efficiency too.
        with_eta: usize,
    },
    /// Too many points or lines.
    #[error("the map has {points} points on {lines} lines; a fit takes at most {max_points} on {max_lines}")]
    TooMany {
        /// Points.
        points: usize,
        /// Lines.
        lines: usize,
        /// Limit of points.
        max_points: usize,
        /// Limit of lines.
        max_lines: usize,
    },
    /// No point lies above pressure ratio 1.
    #[error(
        "on the line at {speed_corrected_rpm} rpm no pressure ratio is above 1; a fit needs lines on which the machine compresses"
    )]
    NoCompression {
        /// Corrected speed of the line, rpm.
        speed_corrected_rpm: f64,
    },
    /// A speed of the table outside the valid range.
    #[error(
        "a line at {speed_corrected_rpm} rpm is outside the range of the fit; give a speed between {lowest_rpm} and {highest_rpm} rpm"
    )]
    Speed {
        /// Requested speed, rpm.
        speed_corrected_rpm: f64,
        /// Minimum speed, rpm.
        lowest_rpm: f64,
        /// Maximum speed, rpm.
        highest_rpm: f64,
    },
    /// The equations of the fit became singular.
    #[error(
        "the fit did not converge: its equations became singular; look for points far from their line, and for lines with equal speeds"
    )]
    Singular,
}
