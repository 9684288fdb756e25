//! Data of a figure, the statements of the paper about it, and the errors of the reproduction. In their numbers zero never carries a sign, so that
//! equal results give equal bytes.

use mapper_core::named_enum;
use mapper_identify::{IdentifyError, StepError};
use mapper_physics::simulation::simulate::SimulationError;
use mapper_physics::simulation::steady::SteadyError;

/// One reproduced figure of the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureResult {
    /// Its number in the paper, e.g. `7`.
    pub number: String,
    /// Its subject.
    pub title: String,
    /// The method of the reproduction, in a few sentences.
    pub method: String,
    /// The paper's statements, with the results here.
    pub statements: Vec<Statement>,
    /// The numbers behind the picture.
    pub table: Table,
    /// The picture, an SVG document.
    pub svg: String,
}

impl Statement {
    pub(crate) fn new(paper: &str, here: String, verdict: Verdict) -> Self {
        Statement { paper: paper.to_owned(), here, verdict }
    }
}

named_enum! {
    /// Verdict on a statement of the paper.
    pub enum Verdict {
        /// It holds.
        Holds = "holds",
        /// It holds with an exception, named in `here`.
        Partly = "partly",
        /// It does not hold.
        Differs = "differs",
    }
}

impl Verdict {
    pub(crate) fn holds_if(condition: bool) -> Self {
        if condition { Verdict::Holds } else { Verdict::Differs }
    }
}

/// A statement of the paper, and the result here.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// The statement.
    pub paper: String,
    /// The result, with units.
    pub here: String,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// A table with formatted cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Column heads, units included.
    pub head: Vec<String>,
    /// Rows, each as long as `head`.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Table { head: head.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    pub(crate) fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }
}

/// Path of this figure's picture, relative to the page of the figures.
pub fn picture_path(result: &FigureResult) -> String {
    format!("reproduction/figure_{}.svg", result.number)
}

/// Why a figure could not be reproduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ReproduceError {
    #[error(transparent)]
    Steady(#[from] SteadyError),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A step has no point.
    #[error(transparent)]
    Step(#[from] StepError),
    #[error("a simulated run has no step or no sample in the window")]
    NoStep,
}

/// `value` with `decimals` digits after the point; `-0.0` is `0.0`, NaN is `-`.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    }
}

/// As [`fixed`], with a plus sign for positive values.
pub(crate) fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let zero = text.chars().all(|c| c == '0' || c == '.' || c == '-');
    if zero || text.starts_with('-') { text } else { format!("+{text}") }
}

/// As [`signed`]; `-` for a missing value.
pub(crate) fn signed_or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| signed(value, decimals))
}

/// `low to high` with signs.
pub(crate) fn range(range: Option<(f64, f64)>, decimals: usize) -> String {
    match range {
        Some((low, high)) => format!("{} to {}", signed(low, decimals), signed(high, decimals)),
        None => "none".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign() {
        assert_eq!([fixed(-0.001, 2), signed(0.001, 2), signed(1.5, 1)], ["0.00", "0.00", "+1.5"]);
        assert_eq!([signed(-1.25, 2), fixed(f64::NAN, 2), signed_or_dash(None, 1)], ["-1.25", "-", "-"]);
    }
}
