//! The whole diagnosis of one recording.

use crate::additions::additions;
use crate::adequacy::{Adequacy, adequacy};
use crate::another_machine::another_machine;
use crate::calibration::Calibration;
use crate::coordinate::{coordinates, parameters};
use crate::fit::{Effort, Fit, fit};
use crate::how_far::{held_out, how_far};
use crate::next::{Rivals, next, sensor_beside};
use crate::outlook::AllowedJump;
use crate::place::{Gain, places};
use crate::problem::Problem;
use crate::report::{Candidate, Diagnosis, Estimate, Verdict};
use crate::select::{Search, does_something, keep_best, refit, search};
use crate::selection::Selection;
use crate::study::{Hypothesis, PredictError, Prediction, Study, members};
use crate::usable::usable;
use crate::whiten::Linearised;
use mapper_core::Recording;
use mapper_numerics::parallel;
use mapper_observe::declared::Declared;
use mapper_observe::table::Table;
use mapper_physics::effect::Effect;
use mapper_physics::model::Model;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Why a recording cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GapError {
    /// The recording does not fit the campaign, or lacks what is needed.
    #[error(transparent)]
    Recording(#[from] Problem),
    /// The nominal model cannot follow.
    #[error("the nominal model cannot follow this recording: {0}; is it of this machine?")]
    Predict(#[from] PredictError),
}

/// What a diagnosis starts from.
pub struct Question<'a> {
    /// What was recorded.
    pub recording: &'a Recording,
    /// What is declared.
    pub declared: Declared,
    /// The nominal machine.
    pub model: Model,
    /// Candidate effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Jumps that the planner allows on this machine, for what to do next; those of the recording where there are none.
    pub jumps: Vec<AllowedJump>,
    /// Numbers behind the probabilities.
    pub calibration: Calibration,
    /// Told the share done, and what comes.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

/// A diagnosis with what it was made from, for pictures and calibration.
#[derive(Debug)]
pub struct Diagnosed {
    /// What is said.
    pub diagnosis: Diagnosis,
    /// The recording made ready.
    pub study: Study,
    /// Tolerances alone, on all steps.
    pub null: Fit,
    /// Prediction and whitened residual of the nominal model with the tolerances of the best fit, but without its cause:
    /// in [`Diagnosed::null`] tolerances are strained to stand in for it. The null itself where no cause is named.
    pub without_cause: (Prediction, Vec<f64>),
    /// Best fits on all steps, best first.
    pub fits: Vec<Fit>,
    /// What the best leaves.
    pub adequacy: Adequacy,
    /// Whitening and derivatives.
    pub linearised: Linearised,
}

/// Fits of the search that are made again on all steps.
const FINALISTS: usize = 7;
/// Of these, beyond the first three, a fit this far behind the best in the logarithm of the evidence is left out.
const HOPELESS: f64 = 60.0;
/// Share of the null's misfit that a cause must remove to explain a gap in part.
const MOST: f64 = 0.5;

/// Diagnoses a recording.
///
/// # Errors
/// [`GapError`] with a clear word where no diagnosis can be made.
pub fn diagnose(question: Question<'_>) -> Result<Diagnosed, GapError> {
    let Question { recording, declared, model, effects, jumps, calibration, progress } = question;
    progress(0.0, "reading");
    let table = Table::new(recording).ok_or(Problem::Empty)?;
    let warnings = usable(recording, &table, &declared)?;
    let study = Study::new(recording, table, declared, model, effects);
    let linearised = Linearised::new(&study)?;
    another_machine(&study, &linearised.base.values)?;
    // Hold-outs are chosen by place, before anything is fitted.
    let held_out = held_out(&study);
    let mut training = Selection::all(&study);
    for step in &held_out {
        training.steps[*step] = false;
    }
    let found = search(Search {
        study: &study,
        nominal: &linearised,
        linearised: &linearised,
        selection: &training,
        progress,
    })?;
    progress(0.75, "all steps");
    let everywhere = Selection::all(&study);
    let beside = found.refound.as_ref().map_or(&linearised, |(linearised, _)| linearised);
    // Far behind the best without the held-out steps is far behind it with them.
    let hopeless = |f: &&Fit| found.fits.first().is_some_and(|best| best.score - f.score > HOPELESS);
    let mut finalists: Vec<&Fit> = found
        .fits
        .iter()
        .take(FINALISTS)
        .enumerate()
        .filter(|(place, f)| *place < 3 || !hopeless(f))
        .map(|(_, f)| f)
        .collect();
    // Whatever a pair adds, its members alone must have lost on all steps likewise.
    if let Some(best) = found.fits.first() {
        for effect in members(&best.hypothesis) {
            let alone = found.fits.iter().find(|f| members(&f.hypothesis) == [effect]);
            finalists.extend(alone.filter(|f| !finalists.iter().any(|other| std::ptr::eq(*other, *f))));
        }
    }
    let effort = Effort { iterations: 5, enough: 0.1, ..Effort::default() };
    let null = fit(&study, &linearised, &found.null.hypothesis, &everywhere, Effort::default())?;
    let mut fits: Vec<Fit> = Vec::new();
    let again = parallel::map(&finalists, |f| fit(&study, beside, &f.hypothesis, &everywhere, effort));
    for fitted in again.into_iter().flatten() {
        keep_best(&mut fits, fitted);
    }
    fits.retain(|fit| does_something(&study, fit));
    by_weight(&calibration, &study, &mut fits);
    // Close races are run where the best stands, not where nothing is off.
    let refound = match (fits.first(), &found.refound) {
        (Some(best), Some((_, there))) if members(&best.hypothesis) != *there => {
            linearised.at(&study, &best.hypothesis).ok()
        }
        _ => None,
    };
    let beside = refound.as_ref().unwrap_or(beside);
    if refound.is_some() {
        let finals = Search {
            study: &study,
            nominal: &linearised,
            linearised: beside,
            selection: &everywhere,
            progress,
        };
        refit(finals, &mut fits, 4, effort);
        by_weight(&calibration, &study, &mut fits);
    }
    progress(0.9, "what is left");
    let best = fits.first().unwrap_or(&null);
    let one_more =
        additions(&study, beside, &everywhere, best).into_iter().map(|a| a.gain).fold(0.0, f64::max);
    let left = adequacy(&study, &linearised, best, one_more);
    let left_by_null = adequacy(&study, &linearised, &null, 0.0);
    let weighed = weigh(&study, &calibration, &null, &fits, &left);
    let named = weighed.named;
    let verdict = if !named {
        if weighed.outside > 0.5 { Verdict::Unexplained } else { Verdict::WithinTolerance }
    } else if weighed.outside <= 0.5 {
        Verdict::Explained
    } else {
        let n = null.residual.len() as f64;
        let removed = 1.0 - (best.cost - n).max(0.0) / (null.cost - n).max(1.0);
        let smooth = 1.0 - left.smooth_excess.max(0.0) / left_by_null.smooth_excess.max(1.0);
        if removed > MOST && smooth > MOST { Verdict::PartlyExplained } else { Verdict::Unexplained }
    };
    // The gap before and after, by what was found and fitted without the held-out steps.
    let trained = found.fits.iter().find(|f| members(&f.hypothesis) == members(&best.hypothesis));
    let after = if named { trained.unwrap_or(&found.null) } else { &found.null };
    let gap = how_far(&study, &found.null, after, &held_out, 7);
    let mut gains: Vec<Gain<'_>> = fits.iter().map(|fit| Gain { fit, gain: null.cost - fit.cost }).collect();
    let counted = training.steps.iter().filter(|counts| **counts).count().max(1);
    let whole = study.steps.len() as f64 / counted as f64;
    for fit in &found.fits {
        if gains.iter().all(|other| members(&other.fit.hypothesis) != members(&fit.hypothesis)) {
            gains.push(Gain { fit, gain: whole * (found.null.cost - fit.cost) });
        }
    }
    let r#where = if verdict == Verdict::WithinTolerance {
        Vec::new()
    } else {
        places(&study, &linearised, &null, &gains, named)
    };
    progress(0.95, "what next");
    let next = match verdict {
        Verdict::WithinTolerance => None,
        Verdict::Unexplained => sensor_beside(&r#where),
        Verdict::Explained | Verdict::PartlyExplained => {
            rivals(&weighed, &fits).and_then(|rivals| next(&study, rivals, &jumps))
        }
    };
    progress(1.0, "done");
    let diagnosis = Diagnosis {
        verdict,
        r#where,
        candidates: weighed.candidates,
        probability_none: weighed.none,
        probability_outside: weighed.outside_probability,
        laws: Vec::new(),
        forces: Vec::new(),
        gap,
        next,
        warnings,
    };
    let without_cause = without_cause(&study, &linearised, fits.first().filter(|_| named))
        .unwrap_or_else(|| (null.prediction.clone(), null.residual.clone()));
    Ok(Diagnosed { diagnosis, study, null, without_cause, fits, adequacy: left, linearised })
}

fn without_cause(
    study: &Study,
    linearised: &Linearised,
    named: Option<&Fit>,
) -> Option<(Prediction, Vec<f64>)> {
    let bare = Hypothesis { nuisances: named?.hypothesis.nuisances.clone(), effects: Vec::new() };
    let prediction = study.predict(&bare).ok()?;
    let residual = linearised.residual(study, &prediction);
    Some((prediction, residual))
}

/// Scores turned into probabilities.
struct Weighed {
    candidates: Vec<Candidate>,
    none: f64,
    /// Probability that is reported.
    outside_probability: f64,
    /// Probability by what the best fit leaves, by which the verdict is made.
    outside: f64,
    /// Whether a cause is named at all.
    named: bool,
}

/// Logarithm of what is known of a cause before any data: pairs are rarer than singles, and many.
pub fn prior(calibration: &Calibration, study: &Study, fit: &Fit) -> f64 {
    let count = study.effects.len().max(2) as f64;
    match fit.hypothesis.effects.len() {
        0 => calibration.prior_none.ln(),
        1 => (calibration.prior_single / count).ln(),
        _ => (calibration.prior_pair / (0.5 * count * (count - 1.0))).ln(),
    }
}

/// Best first, priors included.
fn by_weight(calibration: &Calibration, study: &Study, fits: &mut [Fit]) {
    let weight = |fit: &Fit| fit.score + prior(calibration, study, fit);
    fits.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
}

fn weigh(study: &Study, calibration: &Calibration, null: &Fit, fits: &[Fit], left: &Adequacy) -> Weighed {
    let scores: Vec<f64> =
        std::iter::once(null).chain(fits).map(|fit| fit.score + prior(calibration, study, fit)).collect();
    let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = scores.iter().map(|s| ((s - top) / calibration.temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    let best_cause = scores.iter().skip(1).copied().fold(f64::NEG_INFINITY, f64::max);
    let named = best_cause - scores[0] > calibration.threshold;
    let outside = calibration.outside(left.features());
    // Where nothing is named, an inadequate fit speaks for an outside cause likewise.
    let inside = 1.0 - outside;
    let none = inside * weights[0] / total;
    let candidates = fits
        .iter()
        .enumerate()
        .map(|(place, fit)| Candidate {
            effects: names(study, fit),
            probability: inside * weights[place + 1] / total,
            parameters: estimates(study, calibration, fit),
            equivalent: if place == 0 && named {
                equivalents(study, calibration, fits, &scores)
            } else {
                Vec::new()
            },
        })
        .collect();
    Weighed { candidates, none, outside_probability: outside, outside, named }
}

fn names(study: &Study, fit: &Fit) -> Vec<String> {
    fit.hypothesis.effects.iter().map(|(index, _)| study.effects[*index].info().id.to_string()).collect()
}

/// Maximum number of causes named beside the first: a longer list helps nobody.
const MOST_EQUIVALENT: usize = 2;

/// Other causes whose scores the data do not tell from the best's, the nearest first; a cause that only adds to the best is
/// none.
fn equivalents(study: &Study, calibration: &Calibration, fits: &[Fit], scores: &[f64]) -> Vec<Vec<String>> {
    let Some(best) = fits.first() else { return Vec::new() };
    let of_best = members(&best.hypothesis);
    fits.iter()
        .enumerate()
        .skip(1)
        .filter(|(place, fit)| {
            let close = scores[1] - scores[place + 1] < 3.0 * calibration.temperature;
            let others = members(&fit.hypothesis);
            close && !of_best.iter().all(|effect| others.contains(effect))
        })
        .map(|(_, fit)| names(study, fit))
        .take(MOST_EQUIVALENT)
        .collect()
}

/// Parameters with their 95 % intervals, taken in the search's coordinate so that they stay within their range.
fn estimates(study: &Study, calibration: &Calibration, fit: &Fit) -> BTreeMap<String, Estimate> {
    let coordinates = coordinates(study, &fit.hypothesis);
    let values = parameters(&fit.hypothesis);
    let mut estimates = BTreeMap::new();
    let mut place = 0;
    for (index, of_effect) in &fit.hypothesis.effects {
        let info = study.effects[*index].info();
        for parameter in info.parameters.iter().take(of_effect.len()) {
            let coordinate = coordinates[place];
            let at = coordinate.of(values[place]);
            let variance = fit.covariance.get((place, place)).copied().unwrap_or(f64::INFINITY);
            let away = 1.96 * calibration.interval_factor * variance.max(0.0).sqrt();
            let (a, b) = (coordinate.value(at - away), coordinate.value(at + away));
            let name = if info.parameters.len() == 1 {
                info.id.to_string()
            } else {
                format!("{}.{}", info.id, parameter.name)
            };
            let estimate = Estimate {
                value: values[place],
                low: a.min(b),
                high: a.max(b),
                unit: parameter.unit.to_string(),
            };
            estimates.insert(name, estimate);
            place += 1;
        }
    }
    estimates
}

/// Share of the first among the causes that are open from which on it is settled.
const SETTLED: f64 = 0.95;

/// The causes that are still open, best first; `None` where the first is settled. A mere addition to the best is no
/// rival of it.
fn rivals<'a>(weighed: &Weighed, fits: &'a [Fit]) -> Option<Rivals<'a>> {
    let of_first = members(&fits.first()?.hypothesis);
    let rival = |fit: &Fit| {
        let others = members(&fit.hypothesis);
        !of_first.iter().all(|effect| others.contains(effect))
    };
    let open: Vec<usize> = (0..fits.len()).filter(|place| *place == 0 || rival(&fits[*place])).collect();
    let probabilities: Vec<f64> = open.iter().map(|place| weighed.candidates[*place].probability).collect();
    let total: f64 = probabilities.iter().sum();
    (open.len() > 1 && probabilities[0] < SETTLED * total)
        .then(|| Rivals { fits: open.iter().map(|place| &fits[*place]).collect(), probabilities })
}
