//! Why a map could not be fitted.

/// Why a map could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapFitError {
    /// Speeds are indistinguishable or there is only one.
    #[error("the map has {lines} speed line(s) with points; a fit over speed needs at least 2")]
    TooFewLines {
        /// Lines with usable points.
        lines: usize,
    },
    /// Too little to determine a line.
    #[error(
        "the map has {points} points and {with_eta} efficiencies; a fit needs at least 8 and 6, preferably 5 or more on each line"
    )]
    TooFewPoints {
        /// Points with flow and pressure ratio.
        points: usize,
        /// Points with an efficiency too.
        with_eta: usize,
    },
    /// More than any measured map has.
    #[error(
        "the map has {points} points on {lines} lines; a fit takes at most {most_points} on {most_lines}"
    )]
    TooMany {
        /// Points.
        points: usize,
        /// Lines.
        lines: usize,
        /// Limit of points.
        most_points: usize,
        /// Limit of lines.
        most_lines: usize,
    },
    /// No point lies above pressure ratio 1.
    #[error(
        "on the line at {speed_corrected_rpm} rpm no pressure ratio is above 1; a fit needs lines on which the machine compresses"
    )]
    NoCompression {
        /// Corrected speed of the line, rpm.
        speed_corrected_rpm: f64,
    },
    /// A speed for the table without meaning.
    #[error(
        "a line at {speed_corrected_rpm} rpm cannot be given; write a speed between {lowest_rpm} and {highest_rpm} rpm"
    )]
    Speed {
        /// What was asked for, rpm.
        speed_corrected_rpm: f64,
        /// Lowest that is answered, rpm.
        lowest_rpm: f64,
        /// Highest that is answered, rpm.
        highest_rpm: f64,
    },
    /// The equations of the fit became singular.
    #[error(
        "the fit did not settle: its equations became singular; look for points that lie far off their line, and for lines with equal speeds"
    )]
    Singular,
}
