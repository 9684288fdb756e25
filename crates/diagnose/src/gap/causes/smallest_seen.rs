//! Smallest detectable size of an effect, from its signature length with nuisances projected out and the evidence required to name a cause.

use crate::gap::best_fit::coordinate::{Coordinate, typical};
use crate::gap::best_fit::normal::{PRIOR_STEPS, Projector, Selection};
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::probabilities::prior_of_number;
use crate::gap::findings::report::SmallestSeen;
use crate::gap::findings::report::size_in_words;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use mapper_numerics::least_squares::descent::Until;
use mapper_numerics::statistics::NORMAL_95;
use mapper_numerics::{ROUNDING, parallel};
use mapper_physics::rig::effect::{EffectInfo, EffectParameter};

/// Tolerance in the logarithm of the signature's length. Bound: a tenth of a size does not change a plan.
const LN_LENGTH_TOLERANCE: f64 = 0.1;
/// Steps from neutral to which the search may go. Bound: beyond any range, whose end then limits it.
const FURTHEST_STEPS: f64 = 1e9;
/// Minimum change of a coordinate. Bound: avoids a division by zero.
const MIN_CHANGE: f64 = 1e-9;
/// Share of the wanted length that is enough. Bound: the tolerance above.
const ENOUGH_SHARE: f64 = 0.9;
/// Range of the power of a size by which the length of a signature grows. Bound: roots to cubes; outside, rounding dominates.
const POWERS: (f64, f64) = (0.6, 3.0);

/// Smallest size at which a recording shows an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SmallestSize {
    /// The size as a value of the parameter; `None` if it lies outside the parameter's range.
    pub value: Option<f64>,
    /// The value in the range that is furthest from neutral.
    pub furthest: f64,
    /// Whether the effect changes any reading.
    pub acts: bool,
}

/// Log evidence that one of `count` causes needs to be named, without the width of its parameter.
pub(crate) fn evidence_needed(calibration: &Calibration, count: usize) -> f64 {
    calibration.threshold + prior_of_number(calibration, count, 0) - prior_of_number(calibration, count, 1)
}

/// Smallest size, on the side of the typical step, that is named in 95 of 100 recordings. `length`: length of the signature of a value, in sigmas;
/// `against`: [`evidence_needed`]. `None` if `length` returns `None`.
pub(crate) fn smallest_size(
    parameter: &EffectParameter,
    against: f64,
    mut length: impl FnMut(f64) -> Option<f64>,
) -> Option<SmallestSize> {
    let coordinate = Coordinate::new(parameter);
    // Distance from neutral; its inverse for a parameter that spans decades, because the effect is strong at small values.
    let away = |value: f64| if coordinate.is_logarithmic() { 1.0 / value } else { value - parameter.neutral };
    let value_at = |away: f64| {
        let value = if coordinate.is_logarithmic() { 1.0 / away } else { parameter.neutral + away };
        value.clamp(parameter.low, parameter.high)
    };
    let mut here = away(typical(parameter));
    let furthest = away(value_at(here * FURTHEST_STEPS));
    let (mut smallest, mut acts) = (None::<f64>, false);
    let mut before: Option<(f64, f64)> = None;
    for _ in 0..Until::default().iterations {
        let sigma = length(value_at(here))?;
        if sigma <= ROUNDING || here == 0.0 {
            break;
        }
        acts = true;
        // Laplace evidence of one parameter with this curvature, compared with the threshold of a cause.
        let unit = coordinate.of(value_at(here)) - coordinate.of(parameter.neutral);
        let curvature = (sigma / unit.abs().max(MIN_CHANGE)).powi(2);
        let needed =
            against + 0.5 * curvature.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() + PRIOR_STEPS.ln();
        let wanted = (2.0 * needed.max(0.0)).sqrt() + NORMAL_95;
        if sigma > ENOUGH_SHARE * wanted && smallest.is_none_or(|other| here.abs() < other.abs()) {
            smallest = Some(here);
        }
        if (sigma / wanted).ln().abs() < LN_LENGTH_TOLERANCE {
            break;
        }
        // Effects are nonlinear: interpolate with the power law of two runs.
        let power = before.map_or(1.0, |(there, length): (f64, f64)| {
            ((sigma / length).ln() / (here / there).ln()).clamp(POWERS.0, POWERS.1)
        });
        before = Some((here, sigma));
        let moved = here * (wanted / sigma).powf(1.0 / if power.is_finite() { power } else { 1.0 });
        here = if moved.abs() > furthest.abs() { furthest } else { moved };
    }
    Some(SmallestSize { value: smallest.map(value_at), furthest: value_at(furthest), acts })
}

impl SmallestSeen {
    /// The row of an effect.
    pub fn of(info: &EffectInfo, parameter: &EffectParameter, value: Option<f64>) -> SmallestSeen {
        SmallestSeen {
            effect: info.id.to_string(),
            name: info.name.to_string(),
            parameter: parameter.name.to_string(),
            value,
            unit: parameter.unit.to_string(),
            size: value.map(|value| size_in_words(parameter, value)),
        }
    }
}

/// The smallest size of each effect in recordings like this one. Effects that stay undetectable within their range have no size.
pub(crate) fn smallest_seen(
    study: &Study,
    linearised: &Linearised,
    calibration: &Calibration,
) -> Vec<SmallestSeen> {
    let everywhere = Selection::all(study);
    let Some(projector) = Projector::new(study, linearised, &everywhere, &[]) else { return Vec::new() };
    let against = evidence_needed(calibration, study.catalogue);
    let indices: Vec<usize> = (0..study.catalogue).collect();
    let found = parallel::map(&indices, |index| {
        let info = study.effects[*index].info();
        let (parameter, others) = info.parameters.split_last()?;
        let smallest = smallest_size(parameter, against, |value| {
            // With several parameters, the others are a typical step from neutral.
            let values = others.iter().map(typical).chain([value]).collect();
            let change = linearised.change(study, *index, values)?;
            let right = projector.right(&change);
            Some(projector.product(&change, &right, &change, &right).max(0.0).sqrt())
        })?;
        smallest.acts.then(|| SmallestSeen::of(info, parameter, smallest.value))
    });
    found.into_iter().flatten().collect()
}
