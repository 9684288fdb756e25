//! What speaks against the readings themselves, whoever recorded them: channels that are frozen, dead, scaled, creeping, late
//! or exchanged, and steps that cannot be what they say.
//!
//! One file for each check, with its reason. A check looks at the recording as a whole, names the channel as far as physics
//! tells, and says it once: every point that rests on the channel carries the same sentence and is not good.

mod bounds;
mod clock;
pub(crate) mod ends;
mod frozen;
mod head;
pub(crate) mod housing;
mod linear;
mod noise;
mod nominal_rig;
pub(crate) mod objection;
mod plausible;
mod shaft_power;
mod specific_speed;
mod steps;
mod valve;
mod work;

use crate::IdentifyConfig;
use crate::dynamic::Estimate;
use crate::nominal_map::NominalRig;
use crate::objections::ends::{Ends, ends};
use crate::objections::housing::Balance;
use crate::objections::objection::Objection;
use mapper_core::{Method, Recording};

/// All objections. `alone`: what the two-parameter method makes of each step; empty where there is no housing temperature.
pub(crate) fn objections(
    recording: &Recording,
    alone: &[Estimate],
    config: &IdentifyConfig,
    nominal: Option<&NominalRig<'_>>,
    balance: Balance,
) -> Vec<Objection> {
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
    found.extend(valve::objections(recording, &ends, config));
    found.extend(shaft_power::objections(&ends));
    // What is said already would only be said again by those that fit all steps.
    if found.iter().all(|objection| 2 * objection.steps.len() <= ends.len()) {
        leave_out(&mut ends, &found);
        let heads = head::objections(&ends);
        // The work is reckoned with the head.
        let works = if heads.is_empty() { work::objections(&ends, alone, config) } else { Vec::new() };
        found.extend(heads);
        found.extend(works);
        if found.is_empty() && config.method != Method::Steady && balance == Balance::Asked {
            found.extend(housing::objections(recording, config));
        }
        if let Some(nominal) = nominal.filter(|_| found.is_empty()) {
            found.extend(nominal_rig::objections(&ends, nominal, config));
        }
    }
    found
}

/// Takes away the ends of steps to which there are objections.
fn leave_out(ends: &mut [Option<Ends>], found: &[Objection]) {
    for position in found.iter().flat_map(|objection| &objection.steps) {
        if let Some(end) = ends.get_mut(*position) {
            *end = None;
        }
    }
}
