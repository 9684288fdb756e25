//! What can be known before a run to go wrong with a campaign that has no mistake of form: what no machine does is a
//! mistake, what few machines do a warning.

mod dwell;
mod sizes;
mod speeds;

use crate::campaign::Campaign;
use crate::concern::Concern;
use mapper_yaml::Step;

/// Everything that the campaign and its nominal machine tell. `places`: where each of its points stands in the file.
pub(crate) fn concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = dwell::concerns(campaign);
    concerns.extend(sizes::concerns(campaign));
    concerns.extend(speeds::concerns(campaign, places));
    concerns
}
