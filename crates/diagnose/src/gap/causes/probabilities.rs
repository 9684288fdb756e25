//! Converts scores into probabilities and describes each cause.

use crate::gap::best_fit::adequacy::Adequacy;
use crate::gap::best_fit::coordinate::{Coordinate, infos};
use crate::gap::best_fit::fit::Fit;
use crate::gap::causes::calibration::Calibration;
use crate::gap::findings::in_words;
use crate::gap::findings::report::{Candidate, Estimate, MAX_EQUIVALENT, Onset};
use crate::gap::next_experiment::best_experiment::{Rivals, SETTLED};
use crate::gap::residuals::hypothesis::TimeHistory;
use crate::gap::residuals::study::{EffectValues, Hypothesis, Study};
use mapper_core::half_width_95;
use mapper_inference::interval::COVERAGE;
use mapper_physics::rig::effect::{Effect, EffectInfo, EffectParameter};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::Arc;

pub(crate) struct CauseProbabilities {
    /// Causes, best first, without supersets of a better one.
    pub candidates: Vec<Candidate>,
    /// For each candidate, the index of its fit.
    pub shown: Vec<usize>,
    /// The fits of the named cause and of those that the data do not distinguish from it, by index; empty if no cause is named.
    pub alike: Vec<usize>,
    /// Probability that everything is within tolerance.
    pub none: f64,
    /// Probability of causes of the effect library that are not among the candidates.
    pub unlisted: f64,
    /// Probability of an unmodelled cause, from the residual of the best fit.
    pub outside: f64,
    /// Whether a cause is named.
    pub named: bool,
}

/// Prior share of causes that begin during the recording. Judgement: one in two hundred, because they are rare and can imitate other
/// causes.
const LATE_RATIO: f64 = 0.005;

/// Logarithm of the prior of a cause. Pairs are rarer than singles, and there are many pairs. Causes that begin during the recording are
/// rarer still, and may begin with any step.
pub(crate) fn prior(calibration: &Calibration, study: &Study, hypothesis: &Hypothesis) -> f64 {
    let of_number = prior_of_number(calibration, study.catalogue, hypothesis.effects.len());
    let late =
        hypothesis.effects.iter().filter(|(index, _)| study.histories[*index] != TimeHistory::Throughout);
    of_number + late.count() as f64 * (LATE_RATIO / (2.0 * study.steps.len().max(1) as f64)).ln()
}

/// Logarithm of the prior of one set of so many effects, of a library of `count`.
pub fn prior_of_number(calibration: &Calibration, count: usize, effects: usize) -> f64 {
    let count = count.max(2) as f64;
    match effects {
        0 => calibration.prior_none.ln(),
        1 => (calibration.prior_single / count).ln(),
        2 => (calibration.prior_pair / (0.5 * count * (count - 1.0))).ln(),
        _ => {
            let sets: f64 = (0..effects).map(|i| ((count - i as f64) / (i as f64 + 1.0)).max(0.1).ln()).sum();
            (effects - 2) as f64 * calibration.prior_triple.ln() - sets
        }
    }
}

/// Evidence of a fit, including its prior.
pub fn weight(calibration: &Calibration, study: &Study, fit: &Fit) -> f64 {
    fit.score + prior(calibration, study, &fit.hypothesis)
}

/// Whether `whole` includes all effects of `part`, regardless of their onset.
fn includes(study: &Study, whole: &Fit, part: &Fit) -> bool {
    let whole = ids(study, whole);
    ids(study, part).iter().all(|effect| whole.contains(effect))
}

pub(crate) fn cause_probabilities(
    study: &Study,
    calibration: &Calibration,
    null: &Fit,
    fits: &[Fit],
    adequacy: &Adequacy,
) -> CauseProbabilities {
    let scores: Vec<f64> =
        std::iter::once(null).chain(fits).map(|fit| weight(calibration, study, fit)).collect();
    let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = scores.iter().map(|s| ((s - top) / calibration.temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    let best_cause = scores.iter().skip(1).copied().fold(f64::NEG_INFINITY, f64::max);
    let named = best_cause - scores[0] > calibration.threshold;
    let outside = calibration.outside(adequacy.features());
    // If no cause is named, an inadequate fit also supports an unmodelled cause.
    let inside = 1.0 - outside;
    let none = inside * weights[0] / total;
    let unlisted = calibration.unlisted * (inside - none);
    let listed = inside * (1.0 - calibration.unlisted);
    // A superset of a better cause counts as that cause with an additional effect too weak to detect.
    let mut shown: Vec<usize> = Vec::new();
    let mut probabilities: Vec<f64> = Vec::new();
    for (place, fit) in fits.iter().enumerate() {
        let probability = listed * weights[place + 1] / total;
        match shown.iter().position(|better| includes(study, fit, &fits[*better])) {
            Some(better) => probabilities[better] += probability,
            None => {
                shown.push(place);
                probabilities.push(probability);
            }
        }
    }
    let near = |place: &usize| named && scores[1] - scores[*place + 1] < evidence_resolution(calibration);
    let alike: Vec<usize> = shown.iter().copied().filter(near).take(1 + MAX_EQUIVALENT).collect();
    let candidate = |(place, probability): (&usize, f64)| {
        let fit = &fits[*place];
        let (effects, covariance) = (&fit.hypothesis.effects, Some(&fit.covariance));
        let others = if *place == 0 { alike.get(1..).unwrap_or_default() } else { &[] };
        Candidate {
            effects: ids(study, fit),
            names: infos(&study.effects, &fit.hypothesis).map(|info| info.name.to_string()).collect(),
            probability,
            parameters: estimates(calibration, &study.effects, effects, covariance),
            onsets: onsets(study, fit),
            equivalent: others.iter().map(|place| ids(study, &fits[*place])).collect(),
        }
    };
    let candidates = shown.iter().zip(probabilities).map(candidate).collect();
    CauseProbabilities { candidates, shown, alike, none, unlisted, outside, named }
}

fn ids(study: &Study, fit: &Fit) -> Vec<String> {
    infos(&study.effects, &fit.hypothesis).map(|info| info.id.to_string()).collect()
}

fn onsets(study: &Study, fit: &Fit) -> BTreeMap<String, Onset> {
    let begun = fit.hypothesis.effects.iter().filter_map(|(index, _)| {
        let history = study.histories[*index];
        let step = history.onset()?;
        let onset = Onset {
            step,
            t_s: study.steps.get(step)?.marker.start_s,
            grows: matches!(history, TimeHistory::Growing(_)),
        };
        Some((study.effects[*index].info().id.to_string(), onset))
    });
    begun.collect()
}

/// Difference in evidence below which data do not distinguish causes: the odds at which an interval excludes a value.
pub fn evidence_resolution(calibration: &Calibration) -> f64 {
    -(1.0 - COVERAGE).ln() * calibration.temperature
}

/// Parameters of effects with 95 % intervals, computed in the search coordinate so that they stay within range. `covariance`: of the search
/// coordinates, in order.
pub fn estimates(
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
            size: in_words::size(parameter, value),
        };
        (name_of(info, parameter), estimate)
    };
    parameters.enumerate().map(estimate).collect()
}

/// Name of a parameter among those of all effects.
pub fn name_of(info: &EffectInfo, parameter: &EffectParameter) -> String {
    if info.parameters.len() == 1 { info.id.to_string() } else { format!("{}.{}", info.id, parameter.name) }
}

/// If no cause is named but one is more probable than none: the causes and the null hypothesis, most probable first.
pub(crate) fn suspicions<'a>(
    posterior: &CauseProbabilities,
    fits: &'a [Fit],
    null: &'a Fit,
) -> Option<Rivals<'a>> {
    if posterior.candidates.first()?.probability <= posterior.none {
        return None;
    }
    let causes = posterior.candidates.iter().zip(&posterior.shown);
    let mut open: Vec<(f64, &Fit)> =
        causes.map(|(cause, place)| (cause.probability, &fits[*place])).collect();
    let nothing = open.partition_point(|(probability, _)| *probability > posterior.none);
    open.insert(nothing, (posterior.none, null));
    let (probabilities, fits) = open.into_iter().unzip();
    Some(Rivals { fits, probabilities })
}

/// Open causes, best first; `None` if the first is settled.
pub(crate) fn rivals<'a>(posterior: &CauseProbabilities, fits: &'a [Fit]) -> Option<Rivals<'a>> {
    let probabilities: Vec<f64> =
        posterior.candidates.iter().map(|candidate| candidate.probability).collect();
    let total: f64 = probabilities.iter().sum();
    (probabilities.len() > 1 && probabilities[0] < SETTLED * total)
        .then(|| Rivals { fits: posterior.shown.iter().map(|place| &fits[*place]).collect(), probabilities })
}
