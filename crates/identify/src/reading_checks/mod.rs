//! Checks of the readings themselves, for any data source: channels that are frozen, dead, wrongly scaled, drifting, late or swapped, and
//! impossible steps.
//!
//! One file for each check, with its reason. A check examines the whole recording and names the channel as far as physics allows. All points
//! that depend on the channel get the same sentence and are not good.

pub(crate) mod bounds;
mod clock;
pub(crate) mod ends;
pub(crate) mod failed_check;
mod frozen;
mod noise;
mod plausible;
mod shaft_power;
mod specific_speed;
mod steps;

use crate::IdentifyConfig;
use crate::reading_checks::ends::{Ends, ends};
use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::Recording;

/// All failed checks, and the ends of the unaffected steps.
pub(crate) fn failed_checks(
    recording: &Recording,
    config: &IdentifyConfig,
) -> (Vec<FailedCheck>, Vec<Option<Ends>>) {
    let mut ends = ends(recording, config);
    let mut found = steps::failed_checks(recording);
    found.extend(plausible::failed_checks(recording, config));
    found.extend(frozen::failed_checks(recording, &ends, config));
    found.extend(noise::failed_checks(recording, config));
    found.extend(clock::failed_checks(recording));
    // A channel already named is not reported again because of a contradiction that it causes.
    leave_out(&mut ends, &found);
    found.extend(specific_speed::failed_checks(&ends));
    found.extend(bounds::failed_checks(&ends));
    found.extend(shaft_power::failed_checks(&ends));
    leave_out(&mut ends, &found);
    (found, ends)
}

/// Removes the ends of steps that failed a check.
fn leave_out(ends: &mut [Option<Ends>], found: &[FailedCheck]) {
    for position in found.iter().flat_map(|failed_check| &failed_check.steps) {
        if let Some(end) = ends.get_mut(*position) {
            *end = None;
        }
    }
}
