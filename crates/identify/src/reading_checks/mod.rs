//! Checks of the readings themselves, for any data source: channels that are frozen, dead, wrongly scaled, drifting, late or swapped, and
//! impossible steps.
//!
//! One file for each check, with its reason. A check examines the whole recording and names the channel as far as physics allows. All points
//! that depend on the channel get the same sentence and are not good.

pub(crate) mod bounds;
mod clock;
pub(crate) mod ends;
mod frozen;

use crate::IdentifyConfig;
use crate::reading_checks::ends::{Ends, FailedCheck, ends};
use mapper_core::Recording;

/// All failed checks, and the ends of the unaffected steps.
pub(crate) fn failed_checks(
    recording: &Recording,
    config: &IdentifyConfig,
) -> (Vec<FailedCheck>, Vec<Option<Ends>>) {
    let mut ends = ends(recording, config);
    let mut found = clock::step_checks(recording);
    found.extend(frozen::plausibility_checks(recording, config));
    found.extend(frozen::frozen_checks(recording, &ends, config));
    found.extend(frozen::noise_checks(recording, config));
    found.extend(clock::lag_checks(recording));
    // A channel already named is not reported again because of a contradiction that it causes.
    leave_out(&mut ends, &found);
    found.extend(bounds::specific_speed_check(&ends));
    found.extend(bounds::efficiency_checks(&ends));
    found.extend(bounds::power_check(&ends));
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
