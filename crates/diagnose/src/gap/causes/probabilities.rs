//! Converts scores into probabilities and describes each cause.

use crate::gap::best_fit::adequacy::Adequacy;
use crate::gap::best_fit::coordinate::{Coordinate, infos};
use crate::gap::best_fit::fit::Fit;
use crate::gap::causes::calibration::Calibration;
use crate::gap::findings::report::{Candidate, Estimate, MAX_EQUIVALENT, Onset, size_in_words};
use crate::gap::next_experiment::best_experiment::{Rivals, SETTLED};
use crate::gap::residuals::nuisance::onset_step;
use crate::gap::residuals::study::{EffectValues, Hypothesis, Study, members};
use mapper_core::half_width_95;
use mapper_inference::posterior::{CauseProbabilities, CauseSet, RankedCause};
use mapper_inference::time_history::{Shape, TimeHistory};
use mapper_physics::rig::effect::{Effect, EffectInfo, EffectParameter};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Probabilities of the causes that fit a recording.
pub(crate) struct Posterior {
    /// The probabilities.
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

/// Logarithm of the prior of a cause. Pairs are rarer than singles, and there are many pairs. Causes that begin during the recording are
/// rarer still, and may begin with any step.
pub(crate) fn prior(calibration: &Calibration, study: &Study, hypothesis: &Hypothesis) -> f64 {
    let of_number = prior_of_number(calibration, study.catalogue, hypothesis.effects.len());
    let late =
        hypothesis.effects.iter().filter(|(index, _)| study.histories[*index] != TimeHistory::THROUGHOUT);
    of_number + late.count() as f64 * (LATE_RATIO / (2.0 * study.steps.len().max(1) as f64)).ln()
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

/// Probabilities of the causes of these fits, best first. An inadequate best fit supports a cause that is not in the library.
pub(crate) fn posterior(
    study: &Study,
    calibration: &Calibration,
    null: &Fit,
    fits: &[Fit],
    adequacy: &Adequacy,
) -> Posterior {
    let set = |fit: &Fit| CauseSet {
        members: members(&fit.hypothesis).iter().map(|member| study.family(*member)).collect(),
        ln_weight: weight(calibration, study, fit),
    };
    let sets: Vec<CauseSet> = fits.iter().map(set).collect();
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
        .map(|(place, RankedCause { set, probability })| {
            let (fit, covariance) = (&fits[*set], Some(&fits[*set].covariance));
            let others = if place == 0 { alike.get(1..).unwrap_or_default() } else { &[] };
            Candidate {
                onsets: onsets(study, fit),
                equivalent: others.iter().map(ids).collect(),
                ..candidate(calibration, &study.effects, &fit.hypothesis, covariance, *probability)
            }
        })
        .collect();
    Posterior { probabilities, candidates, alike }
}

/// A cause for the report, without onsets and equivalent causes.
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
        parameters: estimates(calibration, effects, &hypothesis.effects, covariance),
        onsets: BTreeMap::new(),
        equivalent: Vec::new(),
    }
}

/// Ids of a hypothesis' effects.
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

/// Parameters of effects with 95 % intervals, computed in the search coordinate so that they stay within range. `covariance`: of the search
/// coordinates, in order.
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

/// Name of a parameter among those of all effects.
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
