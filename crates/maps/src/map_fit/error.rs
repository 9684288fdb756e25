//! Errors of the map fit.

/// Why a map could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapFitError {
    #[error("the map has {0} speed line(s) with points; a fit over speed needs at least 2")]
    TooFewLines(usize),
    /// `points` have flow and pressure ratio, `with_eta` an efficiency too.
    #[error(
        "the map has {points} points and {with_eta} efficiencies; a fit needs at least 8 and 6, preferably 5 or more on each line"
    )]
    TooFewPoints { points: usize, with_eta: usize },
    #[error("the map has {points} points on {lines} lines; a fit takes at most {max_points} on {max_lines}")]
    TooMany { points: usize, lines: usize, max_points: usize, max_lines: usize },
    #[error(
        "on the line at {speed_corrected_rpm} rpm no pressure ratio is above 1; a fit needs lines on which the machine compresses"
    )]
    NoCompression { speed_corrected_rpm: f64 },
    #[error(
        "a line at {speed_corrected_rpm} rpm is outside the range of the fit; give a speed between {lowest_rpm} and {highest_rpm} rpm"
    )]
    Speed { speed_corrected_rpm: f64, lowest_rpm: f64, highest_rpm: f64 },
    #[error(
        "the fit did not converge: its equations became singular; look for points far from their line, and for lines with equal speeds"
    )]
    Singular,
}
