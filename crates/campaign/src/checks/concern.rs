//! Concerns about the settings of a campaign, with their places in the file.

use mapper_yaml::Step;

/// An unusual or impossible setting of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Concern {
    /// Whether it is an error, so that the campaign cannot run; otherwise a warning.
    pub is_error: bool,
    /// The key, as a path.
    pub at: Vec<Step>,
    /// Description, with values and units.
    pub message: String,
    /// The remedy.
    pub remedy: String,
}

impl Concern {
    /// A warning at the key with this path.
    pub fn warning(path: &[&str], message: String, remedy: String) -> Self {
        let at = path.iter().map(|key| Step::from(*key)).collect();
        Concern { is_error: false, at, message, remedy }
    }
}

/// A length in mm, rounded to 0.1 um.
pub(crate) fn to_mm(length_m: f64) -> f64 {
    (1e7 * length_m).round() / 1e4
}
