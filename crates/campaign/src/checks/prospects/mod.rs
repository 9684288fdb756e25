//! Concerns about a campaign that is formally correct: impossible values are mistakes, unusual values produce a
//! warning.

mod dwell;
mod sizes;
mod speeds;

use crate::campaign::Campaign;
use crate::checks::concern::Concern;
use mapper_yaml::Step;

/// All concerns that follow from the campaign and its nominal machine. `places`: the place of each of its points in the file.
pub(crate) fn concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = dwell::concerns(campaign);
    concerns.extend(sizes::concerns(campaign));
    concerns.extend(speeds::concerns(campaign, places));
    concerns
}
