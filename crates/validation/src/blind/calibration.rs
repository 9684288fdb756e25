//! Calibrates the diagnosis: draws separate cases, with outside causes that the check does not use, diagnoses them, and fits the constants that convert scores into probabilities.

use crate::blind::cases::{BlindError, Case, CaseKind, Cause, Draw, SignatureMeter};
use crate::blind::outside::{OutsideUse, outside_kinds};
use crate::blind::virtual_runs::Schedule;
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::NoiseColour;
use mapper_diagnose::gap;
use mapper_diagnose::gap::{
    Calibration, ClosureSearch, Diagnosed, EffectVisibility, GapRequest, Origin, RigRecording, Scores,
    Verdict,
};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::{NORMAL_975, quantile};
use mapper_observe::Declared;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_recording::ChannelMap;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// The cases of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Seed of all random draws.
    pub seed: u64,
    /// Cases without a cause, which set the threshold.
    pub nulls: usize,
    /// Cases of all other kinds.
    pub others: usize,
}

impl Plan {
    /// The study of this calibration.
    pub fn study(&self, campaign: &Path) -> String {
        let (campaign, Plan { seed, nulls, others }) = (campaign.display(), self);
        format!(
            "mapper fleet run, study: {{study: calibration, campaign: {campaign}, seed: {seed}, nulls: {nulls}, cases: {others}}}"
        )
    }
}

/// The values of one diagnosis that the calibration needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisSummary {
    /// Kind of the case.
    pub kind: CaseKind,
    /// Ids of its causes.
    pub causes: BTreeSet<String>,
    /// Verdict of the diagnosis with the previous calibration.
    pub verdict: Verdict,
    /// Length of the shortest of their signatures, sigmas.
    pub sigma: Option<f64>,
    /// Score of the hypothesis without a cause, prior included.
    pub nothing: f64,
    /// Each candidate with its score, prior included.
    pub candidates: Vec<(BTreeSet<String>, f64)>,
    /// Features of the logistic of an outside cause.
    pub features: [f64; 2],
    /// Error of each parameter in its own standard errors, where the causes were found.
    pub errors_sigma: Vec<f64>,
}

impl DiagnosisSummary {
    fn margin(&self) -> f64 {
        self.candidates.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max) - self.nothing
    }

    pub(crate) fn is_listed(&self) -> bool {
        matches!(self.kind, CaseKind::None | CaseKind::Outside)
            || self.candidates.iter().any(|(causes, _)| *causes == self.causes)
    }
}

pub(crate) fn shipped() -> Result<Calibration, BlindError> {
    Calibration::shipped().map_err(BlindError::signatures)
}

/// The cases of a calibration.
pub fn cases(
    campaign: &Campaign,
    catalogue: &[Arc<dyn Effect>],
    plan: &Plan,
) -> Result<Vec<Case>, BlindError> {
    let nominal = nominal_model(campaign)?;
    let schedule = Schedule::new(campaign, &nominal)?;
    let mut known = catalogue.to_vec();
    known.extend(outside_kinds(OutsideUse::Calibration));
    let meter = visibility(campaign, &schedule, &nominal, known, plan.seed)?;
    let draw = |cases, kinds, seed| Draw { kinds, ..Draw::new(seed, cases, OutsideUse::Calibration) };
    let others = vec![CaseKind::Single, CaseKind::Pair, CaseKind::Outside];
    let mut cases = draw(plan.others, others, plan.seed).cases(catalogue, &meter);
    cases.extend(draw(plan.nulls, vec![CaseKind::None], plan.seed.wrapping_add(1)).cases(catalogue, &meter));
    Ok(cases)
}

/// The settings with which every case of a calibration is diagnosed.
pub struct CalibrationSettings<'a> {
    campaign: &'a Campaign,
    catalogue: &'a [Arc<dyn Effect>],
    nominal: Model,
    before: Calibration,
}

impl<'a> CalibrationSettings<'a> {
    /// The settings with the shipped calibration.
    pub fn new(campaign: &'a Campaign, catalogue: &'a [Arc<dyn Effect>]) -> Result<Self, BlindError> {
        Ok(CalibrationSettings { campaign, catalogue, nominal: nominal_model(campaign)?, before: shipped()? })
    }

    /// Runs and diagnoses a case; `None` if its recording cannot be diagnosed.
    pub fn observe(&self, case: &Case) -> Result<Option<DiagnosisSummary>, BlindError> {
        let recording = Schedule::new(self.campaign, &self.nominal)?.record(case)?;
        let declared = declared(self.campaign);
        let diagnosed = gap(GapRequest {
            recording: RigRecording::simulated(recording, declared, self.nominal.clone()),
            baseline: None,
            effects: self.catalogue.to_vec(),
            experiments: Vec::new(),
            closure_search: ClosureSearch::Never,
            calibration: self.before.clone(),
            warnings: Vec::new(),
            progress: &|_, _| {},
        });
        Ok(diagnosed.ok().and_then(|diagnosed| observe(case, &self.before, &diagnosed)))
    }
}

fn observe(case: &Case, calibration: &Calibration, diagnosed: &Diagnosed) -> Option<DiagnosisSummary> {
    let truth: Vec<(String, Vec<f64>)> = case.causes.iter().map(Cause::id_and_values).collect();
    let Scores { nothing, candidates, features, errors_sigma } = diagnosed.scores(calibration, &truth)?;
    Some(DiagnosisSummary {
        kind: case.kind,
        causes: truth.into_iter().map(|(id, _)| id).collect(),
        verdict: diagnosed.diagnosis.verdict,
        sigma: case.sigmas.iter().copied().reduce(f64::min),
        nothing,
        candidates,
        features,
        errors_sigma,
    })
}

/// Weight of each case, 1 on average: cases without a cause count together as much as their prior, so that probabilities are the user's.
pub(crate) fn weights(calibration: &Calibration, observed: &[DiagnosisSummary]) -> Vec<f64> {
    let all = observed.len() as f64;
    let nothing = observed.iter().filter(|o| o.kind == CaseKind::None).count() as f64;
    if nothing == 0.0 || nothing == all {
        return vec![1.0; observed.len()];
    }
    let (of_nothing, of_causes) =
        (calibration.prior_none * all / nothing, (1.0 - calibration.prior_none) * all / (all - nothing));
    observed.iter().map(|o| if o.kind == CaseKind::None { of_nothing } else { of_causes }).collect()
}

/// Share of the cases without a cause that stay below the threshold.
const QUIET_SHARE: f64 = 0.985;
/// Minimum threshold: odds of e^3 for the cause, even if the cases without a cause would permit less.
const MIN_THRESHOLD: f64 = 3.0;

/// The calibration that fits the observed cases, based on the shipped one.
pub fn fitted(observed: &[DiagnosisSummary], made_by: String) -> Result<Calibration, BlindError> {
    Ok(fit(&shipped()?, observed, made_by))
}

/// Fits the calibration to all cases, weak signatures included: hardly visible outside causes are mistaken for effects of the catalogue.
pub fn fit(before: &Calibration, observed: &[DiagnosisSummary], made_by: String) -> Calibration {
    let margins = observed.iter().filter(|o| o.kind == CaseKind::None).map(DiagnosisSummary::margin);
    let threshold = at_least(quantile(margins, QUIET_SHARE), MIN_THRESHOLD, before.threshold);
    let weights = weights(before, observed);
    let weighted = || observed.iter().zip(weights.iter().copied());
    let inside: Vec<(&DiagnosisSummary, f64)> =
        weighted().filter(|(o, _)| o.kind != CaseKind::Outside).collect();
    let rows: Vec<Row> = weighted()
        .map(|(o, weight)| Row { features: o.features, outside: o.kind == CaseKind::Outside, weight })
        .collect();
    let errors = observed.iter().flat_map(|o| &o.errors_sigma).map(|z| z.abs());
    // Never narrower than the standard errors of the fit, because a few cases do not justify more confidence.
    let interval_factor =
        at_least(quantile(errors, 0.95).map(|z| z / NORMAL_975), 1.0, before.interval_factor);
    let temperature = temperature(&inside, before.temperature);
    let unlisted = unlisted(observed).unwrap_or((before.unlisted, Origin::Copied));
    let (outside, of_outside) = logistic(&rows).unwrap_or((before.outside, [Origin::Copied; 3]));
    let copied =
        ["prior_none", "prior_single", "prior_pair", "prior_triple"].map(|key| (key, Origin::Copied));
    let fitted = [
        ("threshold", threshold.1),
        ("temperature", temperature.1),
        ("interval_factor", interval_factor.1),
        ("unlisted", unlisted.1),
        ("outside_0", of_outside[0]),
        ("outside_1", of_outside[1]),
        ("outside_2", of_outside[2]),
    ];
    Calibration {
        made_by,
        threshold: threshold.0,
        temperature: temperature.0,
        interval_factor: interval_factor.0,
        unlisted: unlisted.0,
        outside,
        origins: copied.into_iter().chain(fitted).map(|(key, origin)| (key.to_owned(), origin)).collect(),
        ..before.clone()
    }
}

/// A fitted number, at least `lowest`; `before` if the cases give none.
fn at_least(found: Option<f64>, lowest: f64, before: f64) -> (f64, Origin) {
    match found {
        None => (before, Origin::Copied),
        Some(found) if found <= lowest => (lowest, Origin::Bound),
        Some(found) => (found, Origin::Data),
    }
}

/// The numbers of a calibration that the data do not determine, one line for each reason.
pub fn undetermined(calibration: &Calibration) -> Vec<String> {
    let keys = |of: Origin| -> Vec<&str> {
        let all = calibration.origins.iter().filter(|(_, origin)| **origin == of);
        all.map(|(key, _)| key.as_str()).collect()
    };
    let reasons = [
        (Origin::Bound, "at a bound that was set by hand"),
        (Origin::Prior, "hardly determined by the data"),
        (Origin::Copied, "copied from the previous calibration"),
    ];
    let lines = reasons.into_iter().map(|(of, reason)| (keys(of), reason));
    lines
        .filter(|(keys, _)| !keys.is_empty())
        .map(|(keys, reason)| format!("{}: {reason}", keys.join(", ")))
        .collect()
}

/// Weakest cause of the cases that decide how often the causes are not listed, sigmas: one of 70 causes is named in 95 of 100 recordings from
/// 5.4 sigmas on (`evidence_needed` in `mapper_diagnose`, and 1.64 for the noise).
const DETECTABLE_SIGMAS: f64 = 6.0;

/// Share of cases whose detectable catalogue causes are no candidates: posterior mean (Jeffreys' prior), origin. `None` without cases.
fn unlisted(observed: &[DiagnosisSummary]) -> Option<(f64, Origin)> {
    let is_detectable = |o: &&DiagnosisSummary| {
        !matches!(o.kind, CaseKind::None | CaseKind::Outside)
            && o.sigma.is_some_and(|sigma| sigma >= DETECTABLE_SIGMAS)
    };
    let cases: Vec<_> = observed.iter().filter(is_detectable).collect();
    let missed = cases.iter().filter(|case| !case.is_listed()).count();
    (!cases.is_empty()).then(|| {
        let (all, mean) = (cases.len() as f64 + 1.0, (missed as f64 + 0.5) / (cases.len() as f64 + 1.0));
        let sigma = |mean: f64, all: f64| (mean * (1.0 - mean) / (all + 1.0)).sqrt();
        (mean, of_width(sigma(mean, all), sigma(0.5, 1.0)))
    })
}

/// Prior standard deviation of the logarithm of the temperature around the previous one. Without it, cases that are all right would lead to
/// certainty.
const TEMPERATURE_SPREAD: f64 = 0.3;

/// The temperature with the largest posterior probability of the true causes, with `before` as prior, and its origin.
fn temperature(cases: &[(&DiagnosisSummary, f64)], before: f64) -> (f64, Origin) {
    let cost = |temperature: f64| -> f64 {
        let deviation = (temperature / before).ln() / TEMPERATURE_SPREAD;
        let misses: f64 = cases
            .iter()
            .filter_map(|(case, weight)| {
                let truth = match case.kind {
                    CaseKind::None => Some(case.nothing),
                    _ => case.candidates.iter().find(|(names, _)| *names == case.causes).map(|(_, s)| *s),
                };
                let all = case.candidates.iter().map(|(_, score)| *score).chain([case.nothing]);
                let top = all.clone().fold(f64::NEG_INFINITY, f64::max);
                let sum: f64 = all.map(|score| ((score - top) / temperature).exp()).sum();
                truth.map(|score| weight * (sum.ln() - (score - top) / temperature))
            })
            .sum();
        misses + 0.5 * deviation * deviation
    };
    let at = |i: i32| 30f64.powf(f64::from(i) / 60.0);
    let best = (0..=60).min_by(|a, b| cost(at(*a)).total_cmp(&cost(at(*b)))).unwrap_or(0);
    let step_ln = 30f64.ln() / 60.0;
    let curvature = (cost(at(best + 1)) + cost(at(best - 1)) - 2.0 * cost(at(best))) / (step_ln * step_ln);
    let origin = match best {
        0 | 60 => Origin::Bound,
        _ => of_width(curvature.max(0.0).sqrt().recip(), TEMPERATURE_SPREAD),
    };
    (at(best), origin)
}

/// Maximum number of iterations of coordinate descent; about fifty are needed.
const ROUNDS: usize = 300;
/// Prior mean of the offset: the share of unmodelled causes, 15 %, before anything is known.
const PRIOR_OFFSET: f64 = -1.7;
/// Prior mean of the slopes.
const PRIOR_SLOPE: f64 = 1.0;
/// Precision of both: about ten cases outweigh the prior.
const PRIOR_PRECISION: f64 = 0.25;
/// Minimum slopes: a larger misfit never contradicts an unmodelled cause. The slope of the smooth misfit is at least half of that from noise
/// for any cases: a failed search with the right cause leaves a residual of thousands of sigmas, and a few such cases would otherwise make
/// a gross misfit meaningless.
const MIN_SLOPES: [f64; 2] = [0.5, 0.0];

/// Distance from a bound at which a weight counts as on it.
const BOUND_TOLERANCE: f64 = 1e-4;
/// Posterior over prior standard deviation above which the data do not determine a number.
const MAX_WIDTH_RATIO: f64 = 0.5;

fn of_width(posterior_sigma: f64, prior_sigma: f64) -> Origin {
    if posterior_sigma > MAX_WIDTH_RATIO * prior_sigma { Origin::Prior } else { Origin::Data }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub features: [f64; 2],
    pub outside: bool,
    /// Weight of the case.
    pub weight: f64,
}

/// Offset and slopes of the logistic that separates outside causes, each with its origin. `None` if one of the classes is empty.
fn logistic(rows: &[Row]) -> Option<([f64; 3], [Origin; 3])> {
    if rows.iter().all(|row| row.outside) || rows.iter().all(|row| !row.outside) {
        return None;
    }
    let rows: Vec<(Row, [f64; 2])> =
        rows.iter().map(|row| (*row, Calibration::logistic_features(row.features))).collect();
    let loss = |weights: &[f64; 3]| -> f64 {
        let means = [PRIOR_OFFSET, PRIOR_SLOPE, PRIOR_SLOPE];
        let penalty: f64 =
            weights.iter().zip(means).map(|(w, mean)| 0.5 * PRIOR_PRECISION * (w - mean).powi(2)).sum();
        let miss = |(row, terms): &(Row, [f64; 2])| {
            let x = argument(weights, terms);
            row.weight * if row.outside { (-x).exp().ln_1p() } else { x.exp().ln_1p() }
        };
        penalty + rows.iter().map(miss).sum::<f64>()
    };
    let mut weights = [PRIOR_OFFSET, PRIOR_SLOPE, PRIOR_SLOPE];
    // Coordinate descent within bounds converges because the loss is convex.
    for _ in 0..ROUNDS {
        let last = weights;
        for place in 0..weights.len() {
            let (low, high) = bounds(place);
            weights[place] = minimise(low, high, 1e-9, |value| {
                let mut tried = weights;
                tried[place] = value;
                loss(&tried)
            })
            .at;
        }
        let moved = weights.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if moved < 1e-5 {
            break;
        }
    }
    Some((weights, origins(&weights, &curvatures(&loss, &weights))))
}

fn bounds(place: usize) -> (f64, f64) {
    if place == 0 { (-30.0, 30.0) } else { (MIN_SLOPES[place - 1], 10.0) }
}

fn curvatures(loss: &dyn Fn(&[f64; 3]) -> f64, weights: &[f64; 3]) -> Matrix3<f64> {
    const STEP: f64 = 1e-3;
    Matrix3::from_fn(|i, j| {
        let at = |a: f64, b: f64| {
            let mut moved = *weights;
            moved[i] += a * STEP;
            moved[j] += b * STEP;
            loss(&moved)
        };
        (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * STEP * STEP)
    })
}

/// Where each weight comes from: weights at a bound are fixed for the errors of the others.
fn origins(weights: &[f64; 3], curvatures: &Matrix3<f64>) -> [Origin; 3] {
    let is_bound = |place: usize| {
        let (low, high) = bounds(place);
        (weights[place] - low).min(high - weights[place]) < BOUND_TOLERANCE
    };
    let mut free = *curvatures;
    for place in (0..3).filter(|place| is_bound(*place)) {
        free.row_mut(place).fill(0.0);
        free.column_mut(place).fill(0.0);
        free[(place, place)] = 1.0;
    }
    let covariance = free.try_inverse();
    std::array::from_fn(|place| match &covariance {
        _ if is_bound(place) => Origin::Bound,
        Some(covariance) => {
            of_width(covariance[(place, place)].max(0.0).sqrt(), PRIOR_PRECISION.recip().sqrt())
        }
        None => Origin::Prior,
    })
}

/// Argument of the logistic for features that [`Calibration::logistic_features`] has limited.
fn argument(weights: &[f64; 3], features: &[f64; 2]) -> f64 {
    // Beyond 500 an exponential is infinite.
    let x = weights[0] + weights[1..].iter().zip(features).map(|(w, f)| w * f).sum::<f64>();
    x.clamp(-500.0, 500.0)
}

/// The uncertainties and tolerances that the campaign declares: those from which the lab of a case draws.
pub(crate) fn declared(campaign: &Campaign) -> Declared {
    Declared {
        sensors: mapper_session::declared(campaign, &ChannelMap::native()),
        noise_colour: NoiseColour::default(),
        tolerances: campaign.tolerances,
        nominal: campaign.boundary,
        common_offsets: Vec::new(),
        actuators: campaign.actuators,
    }
}

/// The visibility of `effects` on a recording without a cause. Equal seeds give equal recordings; weather changes it by a few per cent.
pub(crate) fn visibility(
    campaign: &Campaign,
    schedule: &Schedule<'_>,
    nominal: &Model,
    effects: Vec<Arc<dyn Effect>>,
    seed: u64,
) -> Result<EffectVisibility, BlindError> {
    let case = Case {
        name: "without_causes".to_owned(),
        kind: CaseKind::None,
        causes: Vec::new(),
        sigmas: Vec::new(),
        seed,
    };
    let recorded = RigRecording::simulated(schedule.record(&case)?, declared(campaign), nominal.clone());
    EffectVisibility::new(recorded, effects).map_err(BlindError::signatures)
}

impl SignatureMeter for EffectVisibility {
    fn lengths(&self, causes: &[Cause]) -> Vec<f64> {
        let values: Vec<(String, Vec<f64>)> = causes.iter().map(Cause::id_and_values).collect();
        EffectVisibility::lengths(self, &values).unwrap_or_else(|| vec![0.0; causes.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observed(kind: CaseKind, truth: f64, rival: f64) -> DiagnosisSummary {
        let set = |id: &str| BTreeSet::from([id.to_owned()]);
        DiagnosisSummary {
            kind,
            causes: if kind == CaseKind::None { BTreeSet::new() } else { set("a") },
            verdict: Verdict::Explained,
            sigma: (kind != CaseKind::None).then_some(30.0),
            nothing: 0.0,
            candidates: vec![(set("a"), truth), (set("b"), rival)],
            features: [0.0; 2],
            errors_sigma: Vec::new(),
        }
    }

    /// Two candidates whose scores differ by x are right in a share s of the cases: the likeliest temperature is that at
    /// which the better has probability s, x/ln(s/(1-s)).
    #[test]
    fn the_temperature_reproduces_the_share_of_correct_answers() {
        let mut cases: Vec<DiagnosisSummary> =
            (0..80).map(|_| observed(CaseKind::Single, 40.0, 36.0)).collect();
        cases.extend((0..20).map(|_| observed(CaseKind::Single, 36.0, 40.0)));
        let expected = 4.0 / 4f64.ln();
        let (fitted, _) = temperature(&cases.iter().map(|case| (case, 1.0)).collect::<Vec<_>>(), expected);
        // The grid's own steps are 6 %.
        assert!((fitted / expected - 1.0).abs() < 0.06, "{fitted} for {expected}");
    }

    /// 90 cases without and 10 with a cause count according to the priors, and on average 1.
    #[test]
    fn cases_without_a_cause_count_in_proportion_to_their_prior() {
        let before = Calibration { prior_none: 0.3, ..Calibration::shipped().unwrap() };
        let cases_of = |kind, count| (0..count).map(move |_| observed(kind, 0.0, 0.0));
        let cases: Vec<DiagnosisSummary> =
            cases_of(CaseKind::None, 90).chain(cases_of(CaseKind::Single, 10)).collect();
        let fitted = weights(&before, &cases);
        let [nothing, causes] = [&fitted[..90], &fitted[90..]].map(|part| part.iter().sum::<f64>());
        assert!((nothing - 30.0).abs() < 1e-9 && (causes - 70.0).abs() < 1e-9, "{nothing} {causes}");
        assert_eq!(weights(&before, &cases[90..]), vec![1.0; 10]);
    }

    #[test]
    fn the_threshold_lets_most_effect_free_cases_pass() {
        let before = Calibration::shipped().unwrap();
        let cases: Vec<DiagnosisSummary> =
            (0..200).map(|i| observed(CaseKind::None, f64::from(i) / 20.0, -50.0)).collect();
        let fitted = fit(&before, &cases, String::new());
        let alarms = cases.iter().filter(|case| case.margin() > fitted.threshold).count();
        // 1.5 % of 200.
        assert_eq!(alarms, 3);
    }

    fn row(features: [f64; 2], outside: bool) -> Row {
        Row { features, outside, weight: 1.0 }
    }

    /// Two classes that only the second feature separates, 2 and 20; the others carry no information.
    #[test]
    fn the_boundary_lies_between_the_classes() {
        let rows: Vec<Row> =
            (0..80).map(|i| row([-1.0, if i % 2 == 0 { 2.0 } else { 20.0 }], i % 2 == 1)).collect();
        let (weights, _) = logistic(&rows).unwrap();
        // Eighty cases against a weak prior: each class on its side with odds of e^2 at least.
        let at = |features| argument(&weights, &Calibration::logistic_features(features));
        assert!(at([-1.0, 2.0]) < -2.0 && at([-1.0, 20.0]) > 2.0);
        assert!(logistic(&[row([1.0; 2], true)]).is_none());
    }

    /// Features of zero say nothing of the slopes, and a thousand cases determine the offset.
    #[test]
    fn numbers_without_data_come_from_their_prior() {
        let rows: Vec<Row> = (0..1000).map(|i| row([0.0; 2], i % 2 == 0)).collect();
        let (_, origins) = logistic(&rows).unwrap();
        assert_eq!(origins, [Origin::Data, Origin::Prior, Origin::Prior]);
        // Gross misfit in sound cases pulls its slope below its bound.
        let rows: Vec<Row> =
            (0..80).map(|i| row([if i % 2 == 0 { 9.0 } else { 0.0 }, 0.0], i % 2 == 1)).collect();
        assert_eq!(logistic(&rows).unwrap().1[1], Origin::Bound);
    }

    /// Failed searches do not remove the effect of a gross misfit.
    #[test]
    fn a_gross_misfit_stays_evidence_of_an_outside_cause() {
        let rows: Vec<Row> =
            (0..80).map(|i| row([if i % 8 == 0 { 1e4 } else { 0.0 }, 0.0], i % 8 == 1)).collect();
        let (weights, _) = logistic(&rows).unwrap();
        assert!(argument(&weights, &Calibration::logistic_features([20.0, 0.0])) > 10.0, "{weights:?}");
    }
}
