//! Finds impossible settings (errors) and unusual ones (warnings) of a campaign that is formally correct.

mod dwell;
pub(crate) mod sizes;
mod speeds;

use crate::campaign::Campaign;
use crate::checks::concern::Concern;
use mapper_yaml::Step;

/// A path of keys.
fn steps_of(keys: &[&str]) -> Vec<Step> {
    keys.iter().map(|key| Step::from(*key)).collect()
}

/// All concerns that follow from the campaign and its nominal machine. `places`: the place of each of its points in the file.
pub(crate) fn find_concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = dwell::find_concerns(campaign);
    concerns.extend(sizes::find_concerns(campaign));
    concerns.extend(speeds::find_concerns(campaign, places));
    // A wrong wheel explains a map that does not fit it.
    let is_wrong = |concern: &Concern, at: &[&str]| concern.is_error && concern.at.iter().eq(&steps_of(at));
    if concerns.iter().any(|concern| is_wrong(concern, &sizes::WHEEL)) {
        concerns.retain(|concern| !is_wrong(concern, &sizes::MAP_FILE));
    }
    concerns
}
