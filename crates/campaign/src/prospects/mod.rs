//! What can be known before a run to go wrong with a campaign that has no mistake of form: what no machine does is a
//! mistake, what few machines do a warning.

mod dwell;
mod sizes;
mod speeds;

use crate::campaign::Campaign;
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

/// Everything that the campaign and its nominal machine tell. `places`: where each of its points stands in the file.
pub(crate) fn concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = dwell::concerns(campaign);
    concerns.extend(sizes::concerns(campaign));
    concerns.extend(speeds::concerns(campaign, places));
    concerns
}

/// Millimetres without digits that nobody wrote.
fn mm(length_m: f64) -> f64 {
    (1e7 * length_m).round() / 1e4
}
