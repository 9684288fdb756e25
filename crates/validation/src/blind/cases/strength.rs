//! Strength of a cause, chosen so that its signature in the recording has a given length.

use crate::blind::cases::cause::Cause;
use mapper_physics::rig::effect::{Effect, EffectParameter};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::sync::Arc;

/// Measures the signatures of causes in a recording.
pub trait SignatureMeter {
    /// Length of each cause's signature in the presence of the others, in sigmas; 0 if the rig cannot run with them.
    fn lengths(&self, causes: &[Cause]) -> Vec<f64>;
}

/// Relative tolerance of the length.
const LENGTH_TOLERANCE_RATIO: f64 = 0.1;
/// Maximum number of iterations for a strength.
const MAX_ITERATIONS: usize = 6;
/// Share of the housing that an inner wall takes.
const INNER_SHARE: std::ops::Range<f64> = 0.15..0.6;

/// Limits of a strength in the effect's typical steps, independent of its signature: from the weakest effect of interest to a user, to
/// one that makes a test impossible.
const STEPS: std::ops::RangeInclusive<f64> = 0.02..=4.0;

/// Parameter values of an effect whose signature alone has the length `sigma`, or the maximum within its range. `sign` is the direction
/// relative to the typical step.
pub(crate) fn strength(
    effect: &Arc<dyn Effect>,
    sign: f64,
    sigma: f64,
    meter: &dyn SignatureMeter,
    random: &mut Pcg64,
) -> Vec<f64> {
    let length = |values: Vec<f64>| {
        let cause = Cause { effect: effect.clone(), values };
        meter.lengths(std::slice::from_ref(&cause)).first().copied().unwrap_or(0.0)
    };
    let parameters = &effect.info().parameters;
    if let [phi, conductance] = parameters.as_slice() {
        let phi = random.random_range(INNER_SHARE).clamp(phi.low, phi.high);
        // The resistance 1/G of the wall determines the signature; it is searched like any strength and never 0.
        let values = |resistance_k_w: f64| {
            vec![phi, (1.0 / resistance_k_w).clamp(conductance.low, 0.9 * conductance.high)]
        };
        let solution = search(0.05, sigma, |resistance_k_w| length(values(resistance_k_w)));
        return values(solution);
    }
    let [parameter] = parameters.as_slice() else {
        return parameters.iter().map(|p| value_at(p, sign * 0.5)).collect();
    };
    let steps = search(0.5, sigma, |steps| length(vec![value_at(parameter, sign * steps)]));
    let steps = steps.clamp(*STEPS.start(), *STEPS.end());
    vec![value_at(parameter, sign * steps)]
}

/// Whether an effect has any influence on the measured machine.
pub(crate) fn has_influence(effect: &Arc<dyn Effect>, meter: &dyn SignatureMeter) -> bool {
    // A rig that cannot run with half a typical step may run with a tenth of one.
    [0.5, 0.1].into_iter().any(|steps| {
        let values = effect.info().parameters.iter().map(|parameter| value_at(parameter, steps)).collect();
        let cause = Cause { effect: effect.clone(), values };
        meter.lengths(std::slice::from_ref(&cause)).iter().any(|length| *length > 0.0)
    })
}

/// The value at this number of typical steps from neutral, within the range.
fn value_at(parameter: &EffectParameter, steps: f64) -> f64 {
    (parameter.neutral + steps * parameter.typical_step).clamp(parameter.low, parameter.high)
}

/// Finds the size at which `length` is `wanted`; the length increases nearly in proportion to the size.
fn search(start: f64, wanted: f64, length: impl Fn(f64) -> f64) -> f64 {
    let mut size = start;
    for _ in 0..MAX_ITERATIONS {
        let reached = length(size);
        if (reached / wanted - 1.0).abs() < LENGTH_TOLERANCE_RATIO {
            break;
        }
        // A rig that cannot run so strongly has length 0.
        size *= if reached > 0.0 { (wanted / reached).clamp(0.05, 5.0) } else { 0.4 };
    }
    size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_reaches_the_length_although_it_is_not_in_proportion() {
        // A square root and a square: neither in proportion.
        for (power, wanted) in [(0.5, 30.0), (1.5, 200.0)] {
            let solution = search(0.5, wanted, |size| 40.0 * f64::powf(size, power));
            let reached = 40.0 * f64::powf(solution, power);
            // At most six iterations; within a third for powers this far from 1.
            assert!((reached / wanted).ln().abs() < 0.3, "{power}: {reached} for {wanted}");
        }
    }
}
