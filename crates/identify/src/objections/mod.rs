//! What speaks against the readings themselves, whoever recorded them: channels that are frozen, dead, scaled, creeping, late
//! or exchanged, and steps that cannot be what they say.
//!
//! One file for each check, with its reason. A check looks at the recording as a whole, names the channel as far as physics
//! tells, and says it once: every point that rests on the channel carries the same sentence and is not good.

mod bounds;
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

/// All objections, and the ends of the steps to which there is none.
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
    // A channel that is named is not named again by what it contradicts.
    leave_out(&mut ends, &found);
    found.extend(specific_speed::objections(&ends));
    found.extend(bounds::objections(&ends));
    found.extend(shaft_power::objections(&ends));
    leave_out(&mut ends, &found);
    (found, ends)
}

/// Takes away the ends of steps to which there are objections.
fn leave_out(ends: &mut [Option<Ends>], found: &[Objection]) {
    for position in found.iter().flat_map(|objection| &objection.steps) {
        if let Some(end) = ends.get_mut(*position) {
            *end = None;
        }
    }
}
