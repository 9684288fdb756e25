//! Checks of the readings themselves, for any data source: channels that are frozen, dead, wrongly scaled, drifting, late or swapped, and
//! impossible steps.
//!
//! One file for each check, with its reason. A check examines the whole recording and names the channel as far as physics allows. All points
//! that depend on the channel get the same sentence and are not good.

pub(crate) mod bounds;
mod clock;
pub(crate) mod ends;
mod frozen;
mod noise;
pub(crate) mod objection;
mod plausible;
mod shaft_power;
mod specific_speed;
mod steps;

use crate::IdentifyConfig;
use crate::objections::ends::{Ends, ends};
use crate::objections::objection::Objection;
use mapper_core::Recording;

/// All failed checks, and the ends of the unaffected steps.
pub(crate) fn objections(
    recording: &Recording,
    config: &IdentifyConfig,
) -> (Vec<Objection>, Vec<Option<Ends>>) {
    let mut ends = ends(recording, config);
    let mut found = steps::objections(recording);
    found.extend(plausible::objections(recording, config));
    found.extend(frozen::objections(recording, &ends, config));
    found.extend(noise::objections(recording, config));
    found.extend(clock::objections(recording));
    // A channel already named is not reported again because of a contradiction that it causes.
    leave_out(&mut ends, &found);
    found.extend(specific_speed::objections(&ends));
    found.extend(bounds::objections(&ends));
    found.extend(shaft_power::objections(&ends));
    leave_out(&mut ends, &found);
    (found, ends)
}

/// Removes the ends of steps that failed a check.
fn leave_out(ends: &mut [Option<Ends>], found: &[Objection]) {
    for position in found.iter().flat_map(|objection| &objection.steps) {
        if let Some(end) = ends.get_mut(*position) {
            *end = None;
        }
    }
}
