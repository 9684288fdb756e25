//! What is to be feared of a campaign, at its place.

use mapper_yaml::Step;

/// Something in a campaign that dooms it, or makes one wonder.
#[derive(Debug, Clone, PartialEq)]
pub struct Concern {
    /// Whether the campaign cannot be run; otherwise it is a warning.
    pub grave: bool,
    /// The key it stands at.
    pub at: Vec<Step>,
    /// What is wrong, with values and units.
    pub message: String,
    /// What to do.
    pub remedy: String,
}

impl Concern {
    /// A warning at a key, by its path from the top.
    pub fn warning(path: &[&str], message: String, remedy: String) -> Self {
        let at = path.iter().map(|key| Step::from(*key)).collect();
        Concern { grave: false, at, message, remedy }
    }
}

/// Millimetres without digits that nobody wrote.
pub(crate) fn mm(length_m: f64) -> f64 {
    (1e7 * length_m).round() / 1e4
}
