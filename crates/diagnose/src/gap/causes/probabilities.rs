//! Probabilities of the causes, and the smallest size of each that the recording shows.

use crate::gap::best_fit::coordinate::{Coordinate, infos, typical};
use crate::gap::best_fit::fit::{Adequacy, Fit};
use crate::gap::best_fit::normal::{PRIOR_STEPS, Projector, Selection};
use crate::gap::causes::additions::Calibration;
use crate::gap::next_experiment::{Rivals, SETTLED};
use crate::gap::report::{Candidate, Estimate, MAX_EQUIVALENT, Onset, SmallestSeen, size_in_words};
use crate::gap::residuals::nuisance::onset_step;
use crate::gap::residuals::study::{EffectValues, Hypothesis, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::half_width_95;
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_inference::posterior::{CauseProbabilities, CauseSet, RankedCause};
use mapper_numerics::least_squares::Until;
use mapper_numerics::statistics::NORMAL_95;
use mapper_numerics::{ROUNDING, parallel};
use mapper_physics::rig::effect::{Effect, EffectInfo, EffectParameter};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::Arc;

pub(crate) struct Posterior {
    pub probabilities: CauseProbabilities,
    /// Causes for the report, best first, without supersets of a better one.
    pub candidates: Vec<Candidate>,
    /// The fits of the named cause and of those that the data do not distinguish from it, by index; empty if no cause is named.
    pub alike: Vec<usize>,
}

/// Prior share of causes that begin during the recording. Judgement: one in two hundred, because they are rare and can imitate other
/// causes.
const LATE_RATIO: f64 = 0.005;
/// Minimum ratio of the numbers of sets of one effect more. Bound: avoids the logarithm of zero if a set has all effects.
const MIN_SETS_RATIO: f64 = 0.1;

/// Prior of all closure terms together. Judgement: one gap in seven is none of the library's effects and has a physical term.
const PRIOR_CLOSURE: f64 = 0.15;

/// Logarithm of a cause's prior: pairs are rarer and more numerous; causes that begin during the recording are rarer, with any step. A closure
/// term counts as one more cause, chosen from its own library.
pub(crate) fn prior(calibration: &Calibration, study: &Study, hypothesis: &Hypothesis) -> f64 {
    let of_number = |effects: usize| prior_of_number(calibration, study.catalogue, effects);
    let mut ln_prior = of_number(hypothesis.effects.len());
    for (index, _) in &hypothesis.effects {
        if study.histories[*index] != TimeHistory::THROUGHOUT {
            ln_prior += (LATE_RATIO / (2.0 * study.steps.len().max(1) as f64)).ln();
        }
        if let Some(rarity) = study.rarities.get(index) {
            ln_prior += PRIOR_CLOSURE.ln() - rarity - of_number(1);
        }
    }
    ln_prior
}

/// Logarithm of the prior of one set of so many effects, of a library of `count`.
pub(crate) fn prior_of_number(calibration: &Calibration, count: usize, effects: usize) -> f64 {
    let count = count.max(2) as f64;
    match effects {
        0 => calibration.prior_none.ln(),
        1 => (calibration.prior_single / count).ln(),
        2 => (calibration.prior_pair / (0.5 * count * (count - 1.0))).ln(),
        _ => {
            let sets: f64 =
                (0..effects).map(|i| ((count - i as f64) / (i as f64 + 1.0)).max(MIN_SETS_RATIO).ln()).sum();
            (effects - 2) as f64 * calibration.prior_triple.ln() - sets
        }
    }
}

/// Evidence of a fit, including its prior.
pub(crate) fn weight(calibration: &Calibration, study: &Study, fit: &Fit) -> f64 {
    fit.score + prior(calibration, study, &fit.hypothesis)
}

/// The set of a fit: its causes, without their onsets.
pub(crate) fn cause_set(calibration: &Calibration, study: &Study, fit: &Fit) -> CauseSet {
    CauseSet {
        members: members(&fit.hypothesis).iter().map(|member| study.family(*member)).collect(),
        ln_weight: weight(calibration, study, fit),
    }
}

/// Probabilities of the causes of these fits, best first. An inadequate best fit supports a cause that is not in the library.
pub(crate) fn posterior(
    study: &Study,
    calibration: &Calibration,
    null: &Fit,
    fits: &[Fit],
    adequacy: &Adequacy,
) -> Posterior {
    let sets: Vec<CauseSet> = fits.iter().map(|fit| cause_set(calibration, study, fit)).collect();
    let unmodelled = calibration.outside(adequacy.features());
    let none = weight(calibration, study, null);
    let probabilities = calibration.rules().cause_probabilities(none, &sets, unmodelled);
    let causes = &probabilities.causes;
    let alike: Vec<usize> =
        causes[..probabilities.alike].iter().map(|cause| cause.set).take(1 + MAX_EQUIVALENT).collect();
    let ids = |fit: &usize| ids(&study.effects, &fits[*fit].hypothesis);
    let candidates = causes
        .iter()
        .enumerate()
        .map(|(place, cause)| {
            let others = if place == 0 { alike.get(1..).unwrap_or_default() } else { &[] };
            let fitted = candidate_of(calibration, study, &fits[cause.set], (&probabilities, &sets, cause));
            Candidate { equivalent: others.iter().map(ids).collect(), ..fitted }
        })
        .collect();
    Posterior { probabilities, candidates, alike }
}

/// A fit of library effects as a cause of a posterior of `sets`.
pub(crate) fn candidate_of(
    calibration: &Calibration,
    study: &Study,
    fit: &Fit,
    (probabilities, sets, cause): (&CauseProbabilities, &[CauseSet], &RankedCause),
) -> Candidate {
    let of_effect = |(index, _): &(usize, _)| probabilities.of_member(sets, study.family(*index));
    Candidate {
        onsets: onsets(study, fit),
        each: fit.hypothesis.effects.iter().map(of_effect).collect(),
        ..candidate(calibration, &study.effects, &fit.hypothesis, Some(&fit.covariance), cause.probability)
    }
}

pub(crate) fn candidate(
    calibration: &Calibration,
    effects: &[Arc<dyn Effect>],
    hypothesis: &Hypothesis,
    covariance: Option<&DMatrix<f64>>,
    probability: f64,
) -> Candidate {
    Candidate {
        effects: ids(effects, hypothesis),
        names: infos(effects, hypothesis).map(|info| info.name.to_string()).collect(),
        probability,
        each: Vec::new(),
        parameters: estimates(calibration, effects, &hypothesis.effects, covariance),
        onsets: BTreeMap::new(),
        equivalent: Vec::new(),
    }
}

pub(crate) fn ids(effects: &[Arc<dyn Effect>], hypothesis: &Hypothesis) -> Vec<String> {
    infos(effects, hypothesis).map(|info| info.id.to_string()).collect()
}

fn onsets(study: &Study, fit: &Fit) -> BTreeMap<String, Onset> {
    let begun = fit.hypothesis.effects.iter().filter_map(|(index, _)| {
        let history = study.histories[*index];
        let step = onset_step(history)?;
        let onset = Onset {
            step,
            t_s: study.steps.get(step)?.marker.start_s,
            grows: matches!(history.shape, Shape::Ramp(_)),
        };
        Some((study.effects[*index].info().id.to_string(), onset))
    });
    begun.collect()
}

/// Parameters of effects with 95 % intervals, computed in search coordinates so that they stay in range; `covariance` is that of these.
pub(crate) fn estimates(
    calibration: &Calibration,
    effects: &[Arc<dyn Effect>],
    values: &EffectValues,
    covariance: Option<&DMatrix<f64>>,
) -> BTreeMap<String, Estimate> {
    let parameters = values.iter().flat_map(|(index, values)| {
        let info = effects[*index].info();
        info.parameters.iter().zip(values).map(move |(parameter, value)| (info, parameter, *value))
    });
    let estimate = |(place, (info, parameter, value)): (usize, (&EffectInfo, &EffectParameter, f64))| {
        let coordinate = Coordinate::new(parameter);
        let at = coordinate.of(value);
        let variance = covariance.and_then(|c| c.get((place, place))).copied().unwrap_or(f64::INFINITY);
        let away = half_width_95(calibration.interval_factor * variance.max(0.0).sqrt());
        let (a, b) = (coordinate.value(at - away), coordinate.value(at + away));
        let estimate = Estimate {
            value,
            low: a.min(b),
            high: a.max(b),
            unit: parameter.unit.to_string(),
            neutral: parameter.neutral,
            size: size_in_words(parameter, value),
        };
        (name_of(info, parameter), estimate)
    };
    parameters.enumerate().map(estimate).collect()
}

pub(crate) fn name_of(info: &EffectInfo, parameter: &EffectParameter) -> String {
    if info.parameters.len() == 1 { info.id.to_string() } else { format!("{}.{}", info.id, parameter.name) }
}

/// If no cause is named but one is more probable than none: the causes and the null hypothesis, most probable first.
pub(crate) fn suspicions<'a>(
    probabilities: &CauseProbabilities,
    fits: &'a [Fit],
    null: &'a Fit,
) -> Option<Rivals<'a>> {
    let CauseProbabilities { none, causes, .. } = probabilities;
    if causes.first()?.probability <= *none {
        return None;
    }
    let mut open: Vec<(f64, &Fit)> =
        causes.iter().map(|RankedCause { set, probability }| (*probability, &fits[*set])).collect();
    let nothing = open.partition_point(|(probability, _)| probability > none);
    open.insert(nothing, (*none, null));
    let (probabilities, fits) = open.into_iter().unzip();
    Some(Rivals { fits, probabilities })
}

/// Open causes, best first; `None` if the first is settled.
pub(crate) fn rivals<'a>(probabilities: &CauseProbabilities, fits: &'a [Fit]) -> Option<Rivals<'a>> {
    let causes = &probabilities.causes;
    let probabilities: Vec<f64> = causes.iter().map(|cause| cause.probability).collect();
    let total: f64 = probabilities.iter().sum();
    (probabilities.len() > 1 && probabilities[0] < SETTLED * total)
        .then(|| Rivals { fits: causes.iter().map(|cause| &fits[cause.set]).collect(), probabilities })
}

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
