//! Finds impossible settings (errors) and unusual ones (warnings) of a campaign that is formally correct.

mod dwell;
mod sizes;
mod speeds;

use crate::campaign::Campaign;
use crate::checks::concern::Concern;
use mapper_yaml::Step;

/// All concerns that follow from the campaign and its nominal machine. `places`: the place of each of its points in the file.
pub(crate) fn find_concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = dwell::find_concerns(campaign);
    concerns.extend(sizes::find_concerns(campaign));
    concerns.extend(speeds::find_concerns(campaign, places));
    concerns
}
