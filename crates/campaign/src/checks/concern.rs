//! Concerns about a campaign, with their places.

use mapper_yaml::Step;

/// An unusual setting in a campaign that prevents the run or calls for a warning.
#[derive(Debug, Clone, PartialEq)]
pub struct Concern {
    /// Whether the campaign cannot be run; otherwise this is a warning.
    pub grave: bool,
    /// The key it refers to.
    pub at: Vec<Step>,
    /// What is wrong, with values and units.
    pub message: String,
    /// The remedy.
    pub remedy: String,
}

impl Concern {
    /// A warning at a key, by its path from the top.
    pub fn warning(path: &[&str], message: String, remedy: String) -> Self {
        let at = path.iter().map(|key| Step::from(*key)).collect();
        Concern { grave: false, at, message, remedy }
    }
}

/// Millimetres without insignificant digits.
pub(crate) fn mm(length_m: f64) -> f64 {
    (1e7 * length_m).round() / 1e4
}
