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
    let speeds = speeds::find_concerns(campaign, places);
    let has_error = |concerns: &[Concern], at: &[&str]| {
        concerns.iter().any(|concern| concern.is_error && concern.at == steps_of(at))
    };
    // A wrong wheel explains a map that does not fit it, and such a map explains speeds that it does not have.
    if has_error(&concerns, &sizes::WHEEL) || has_error(&speeds, &sizes::WHEEL) {
        concerns.retain(|concern| concern.at != steps_of(&sizes::MAP_FILE));
        concerns.extend(speeds);
    } else if !has_error(&concerns, &sizes::MAP_FILE) {
        concerns.extend(speeds);
    }
    concerns
}
