//! Fits sizes and onsets of detected causes, adds them to the model and fits again.

use crate::drift::candidates::{Candidates, FINE_ONSETS, LowRank, time_histories};
use crate::drift::causes::{Cause, Drift};
use crate::drift::drive::{Drive, predict};
use crate::drift::readings::{OwnFactors, Readings, Response, constants};
use crate::drift::report::{Alternative, DetectionLimit};
use crate::drift::runs::{DriftError, Unsolvable};
use mapper_core::unit_factors::S_PER_H;
use mapper_inference::hypotheses::{Member, Shape, TimeHistory};
use mapper_inference::posterior::shares;
use mapper_numerics::least_squares::{ENOUGH, ROUNDS};
use mapper_numerics::statistics::{CHI_SQUARE_1_95, EXCLUDE_SIGMAS, NORMAL_975, median};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::UNINFORMATIVE;
use nalgebra::{DMatrix, DVector};

/// Readings, constants, decision and fits, for the model with the detected drift.
pub(crate) struct Refinement {
    pub readings: Readings,
    pub constants: Vec<Response>,
    pub decision: Decision,
    pub fits: FittedDrifts,
}

impl Refinement {
    /// Decides and fits, and repeats both with the result in the model. Keeps the last result that the model can follow. A drift must also be found
    /// with deviations of the operating points as large as they show.
    pub(super) fn new(
        readings: Readings,
        own: &[DMatrix<f64>],
        drives: &mut [Drive<'_>],
        declared: &Declared,
    ) -> Result<Refinement, DriftError> {
        let within = OwnFactors { all: OWN_FACTORS[0], turbine: OWN_FACTORS[0] };
        let mut refined = Refinement::of(readings, own, (declared, within), &[])?;
        if refined.fits.drifts.is_empty() {
            return Ok(refined);
        }
        let factors = own_factors(&refined.readings, own, (declared, within))?;
        if factors != within {
            let shown = Refinement::of(refined.readings.clone(), own, (declared, factors), &[])?;
            if shown.fits.drifts.is_empty() {
                return Ok(shown);
            }
        }
        for _ in 0..ROUNDS {
            match refined.refine(own, drives, (declared, within)) {
                Some(better) => refined = better,
                None => break,
            }
        }
        Ok(refined)
    }

    /// Decides and fits. Without known drifts it does so twice: with the onsets of the grid, then with finer onsets about the result.
    fn of(
        readings: Readings,
        own: &[DMatrix<f64>],
        (declared, factors): (&Declared, OwnFactors),
        known: &[FittedDrift],
    ) -> Result<Refinement, DriftError> {
        let (constants, columns) = constants_and_columns(&readings, declared, factors);
        let decide = |known: &[FittedDrift]| -> Result<(Decision, FittedDrifts), DriftError> {
            let histories: Vec<(Cause, TimeHistory)> =
                known.iter().map(|fit| (fit.drift.cause, fit.drift.history)).collect();
            let decision =
                decide(&readings, own.to_vec(), &with_date_errors(&columns, &readings, known), &histories)?;
            let detected: Vec<(Cause, TimeHistory)> =
                decision.detected.iter().map(|detected| (detected.cause, detected.history)).collect();
            let fits = fit(&readings, &decision.own, &columns, detected)?;
            Ok((decision, fits))
        };
        let (mut decision, mut fits) = decide(known)?;
        if known.is_empty() && !fits.drifts.is_empty() {
            (decision, fits) = decide(&fits.drifts)?;
        }
        Ok(Refinement { readings, constants, decision, fits })
    }

    /// The same for the model with these drifts; `None` if none of them acts on it, it cannot follow them, or none is detected then.
    fn refine(
        &self,
        own: &[DMatrix<f64>],
        drives: &mut [Drive<'_>],
        constants: (&Declared, OwnFactors),
    ) -> Option<Refinement> {
        let fitted = &self.fits.drifts;
        let drifts: Vec<Drift> = fitted.iter().map(|fit| fit.drift).filter(Drift::acts_on_model).collect();
        if drifts.is_empty() {
            return None;
        }
        let (base, perturbed) = predict(drives, &drifts).ok()?;
        let mut readings = self.readings.with_prediction(&base, &perturbed)?;
        // The next fit finds the whole drift, not its change: its linear part must not be in the model.
        for drift in &drifts {
            let signature = readings.model_signature(drift.cause)?;
            readings.subtract_from_model(&signature, drift);
        }
        let refined = Refinement::of(readings, own, constants, fitted).ok()?;
        (!refined.fits.drifts.is_empty()).then_some(refined)
    }
}

/// Responses to the constants, and as the columns of the readings.
fn constants_and_columns(
    readings: &Readings,
    declared: &Declared,
    factors: OwnFactors,
) -> (Vec<Response>, DMatrix<f64>) {
    let constants = constants(readings, declared, factors);
    let columns =
        DMatrix::from_fn(readings.row_count(), constants.len(), |row, column| constants[column][row]);
    (constants, columns)
}

/// Factors on the deviations of the operating points, of which the most probable is taken. Bound: from a model within tolerance to one that is off by a
/// cause of the gap of many declared tolerances; a size that is wrong by less than a half changes no decision.
const OWN_FACTORS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// The factors on the deviations of the operating points under which the readings are most probable, each with its best explanation: a cause of the
/// gap that acts all the time moves each operating point by more than tolerances do, without drift.
fn own_factors(
    readings: &Readings,
    own: &[DMatrix<f64>],
    (declared, within): (&Declared, OwnFactors),
) -> Result<OwnFactors, DriftError> {
    let candidates = Candidates::new(readings, &[])?;
    let mut own = own.to_vec();
    // A segment that the model cannot follow says nothing about the others.
    leave_out(&mut own, readings, &constants_and_columns(readings, declared, within).1, &candidates)?;
    let ln_likelihood = |factors: OwnFactors| -> Result<f64, DriftError> {
        let noise = LowRank::new(&own, &constants_and_columns(readings, declared, factors).1)?;
        let whitened = noise.whiten(readings.difference.clone());
        let explained = candidates.likelihood(&noise, &readings.difference).explain(&candidates.priors);
        let gained = explained.map_or(0.0, |explanation| explanation.ln_odds);
        let squares = whitened.dot(&noise.inverse_times(&whitened));
        Ok(gained - 0.5 * (squares + noise.ln_determinant()))
    };
    let mut best = (f64::NEG_INFINITY, within);
    for all in OWN_FACTORS {
        let factors = OwnFactors { all, ..within };
        best = better(best, (ln_likelihood(factors)?, factors));
    }
    let all = best.1.all;
    for turbine in OWN_FACTORS.into_iter().skip(1) {
        let factors = OwnFactors { all, turbine };
        best = better(best, (ln_likelihood(factors)?, factors));
    }
    Ok(best.1)
}

fn better(one: (f64, OwnFactors), other: (f64, OwnFactors)) -> (f64, OwnFactors) {
    if other.0 > one.0 { other } else { one }
}

/// The constants, and the effect of a small error of each known onset, which would otherwise look like another drift.
fn with_date_errors(columns: &DMatrix<f64>, readings: &Readings, known: &[FittedDrift]) -> DMatrix<f64> {
    let (start_s, end_s) = readings.span_s();
    // The spacing of the onsets in the fit.
    let error_s = (end_s - start_s) / FINE_ONSETS as f64;
    let mut all = columns.clone().resize_horizontally(columns.ncols() + known.len(), 0.0);
    for (position, FittedDrift { drift, .. }) in known.iter().enumerate() {
        let Some(signature) = readings.signature(drift.cause) else { continue };
        let mean = |row: usize, by_s: f64| {
            let onset = drift.history.onset + by_s;
            readings.mean_of(row, TimeHistory { onset, ..drift.history })
        };
        for row in 0..readings.row_count() {
            all[(row, columns.ncols() + position)] =
                0.5 * drift.size * signature[row] * (mean(row, error_s) - mean(row, -error_s));
        }
    }
    all
}

#[derive(Debug, Clone)]
pub(crate) struct FittedDrift {
    pub drift: Drift,
    /// 95 % interval of the size: the widest over the onsets compatible with the readings.
    pub low: f64,
    pub high: f64,
    /// 95 % interval of the onset, campaign time, s.
    pub onset_low_s: f64,
    pub onset_high_s: f64,
}

pub(crate) struct FittedDrifts {
    pub drifts: Vec<FittedDrift>,
    /// Most probable constants, in standard deviations.
    pub constants: DVector<f64>,
    /// Noise and constants.
    pub noise: LowRank,
}

/// Fits all causes jointly, each with its kind of time history from its onset. `constants`: responses to the constants, a column each.
pub(crate) fn fit(
    readings: &Readings,
    own: &[DMatrix<f64>],
    constants: &DMatrix<f64>,
    mut detected: Vec<(Cause, TimeHistory)>,
) -> Result<FittedDrifts, DriftError> {
    let mut drifts = Vec::new();
    for _ in 0..if detected.len() > 1 { ROUNDS } else { 1 } {
        drifts.clear();
        for position in 0..detected.len() {
            let mut others = detected.clone();
            let (cause, start) = others.remove(position);
            let noise = LowRank::new(own, &with_others(readings, constants, &others)?)?;
            let fit = fit_one(readings, &noise, cause, start)?;
            detected[position].1 = fit.drift.history;
            drifts.push(fit);
        }
    }
    let mut residual = readings.difference.clone();
    for FittedDrift { drift, .. } in &drifts {
        let column = readings.column(&signature(readings, drift.cause)?, drift.history);
        residual.iter_mut().zip(&column).for_each(|(residual, change)| *residual -= drift.size * change);
    }
    let noise = LowRank::new(own, constants)?;
    let constants = noise.constants(&noise.whiten(residual)).column(0).into_owned();
    Ok(FittedDrifts { drifts, constants, noise })
}

/// The constants, and the other drifts with their prior sizes.
fn with_others(
    readings: &Readings,
    constants: &DMatrix<f64>,
    others: &[(Cause, TimeHistory)],
) -> Result<DMatrix<f64>, DriftError> {
    let (start_s, end_s) = readings.span_s();
    let count = constants.ncols();
    let mut all = constants.clone().resize_horizontally(count + others.len(), 0.0);
    for (position, (cause, history)) in others.iter().enumerate() {
        let column = readings.column(&signature(readings, *cause)?, *history);
        all.set_column(count + position, &(column * cause.prior_sigma(history.shape, end_s - start_s)));
    }
    Ok(all)
}

fn signature(readings: &Readings, cause: Cause) -> Result<Response, Unsolvable> {
    readings.signature(cause).ok_or(Unsolvable::Hidden { cause })
}

/// FittedDrifts one cause with time histories of the same kind as `start`. `noise` includes everything else.
fn fit_one(
    readings: &Readings,
    noise: &LowRank,
    cause: Cause,
    start: TimeHistory,
) -> Result<FittedDrift, DriftError> {
    let (start_s, end_s) = readings.span_s();
    let mut fine = time_histories(start_s, end_s, FINE_ONSETS);
    fine.retain(|history| history.shape == start.shape && readings.is_seen(history));
    let signature = signature(readings, cause)?;
    let columns: Vec<DVector<f64>> =
        fine.iter().map(|history| readings.column(&signature, *history)).collect();
    let columns = noise.whiten(DMatrix::from_columns(&columns));
    let inverse = noise.inverse_times(&columns);
    let gradient = inverse.tr_mul(&noise.whiten(readings.difference.clone()));
    let information: Vec<f64> = (0..fine.len())
        .map(|index| columns.column(index).dot(&inverse.column(index)).max(f64::MIN_POSITIVE))
        .collect();
    let size = |index: usize| {
        let size = gradient[index] / information[index];
        if cause.is_at_least_zero() { size.max(0.0) } else { size }
    };
    let sigma = |index: usize| information[index].sqrt().recip();
    let evidence = |index: usize| size(index).powi(2) * information[index];
    let best = (0..fine.len())
        .max_by(|a, b| evidence(*a).total_cmp(&evidence(*b)))
        .ok_or(Unsolvable::Hidden { cause })?;
    // All onsets within a gap of the readings are equally good: the middle one has the smallest error.
    let is_as_good = |index: &usize| evidence(*index) > evidence(best) - ENOUGH;
    let first = (0..=best).rev().take_while(is_as_good).last().unwrap_or(best);
    let last = (best..fine.len()).take_while(is_as_good).last().unwrap_or(best);
    let peak = first.midpoint(last);
    let within: Vec<usize> =
        (0..fine.len()).filter(|index| evidence(*index) > evidence(peak) - CHI_SQUARE_1_95).collect();
    let extreme = |value: &dyn Fn(usize) -> f64, sign: f64| {
        sign * within.iter().map(|index| sign * value(*index)).fold(f64::NEG_INFINITY, f64::max)
    };
    Ok(FittedDrift {
        drift: Drift { cause, history: fine[peak], size: size(peak) },
        low: extreme(&|index| size(index) - NORMAL_975 * sigma(index), -1.0),
        high: extreme(&|index| size(index) + NORMAL_975 * sigma(index), 1.0),
        onset_low_s: extreme(&|index| fine[index].onset, -1.0),
        onset_high_s: extreme(&|index| fine[index].onset, 1.0),
    })
}

#[derive(Debug, Clone)]
pub(crate) struct DetectedCause {
    pub cause: Cause,
    pub history: TimeHistory,
    /// Its probability relative to alternatives and to none in its place.
    pub probability: f64,
    /// The alternatives, most probable first.
    pub alternatives: Vec<Alternative>,
}

pub(crate) struct Decision {
    /// Empty if nothing drifts.
    pub detected: Vec<DetectedCause>,
    /// No drift and each single cause, most probable first.
    pub alone: Vec<Alternative>,
    pub limits: Vec<DetectionLimit>,
    /// Number of segments that the model cannot follow, and of all.
    pub left_out: (usize, usize),
    /// Estimated covariance of each segment, without constants.
    pub own: Vec<DMatrix<f64>>,
}

/// `own`: declared covariance of each segment; `constants`: responses to the constants, a column each. Onsets are finer near `known` drifts.
pub(crate) fn decide(
    readings: &Readings,
    mut own: Vec<DMatrix<f64>>,
    constants: &DMatrix<f64>,
    known: &[(Cause, TimeHistory)],
) -> Result<Decision, DriftError> {
    let candidates = Candidates::new(readings, known)?;
    let (left_out, noise, residual) = leave_out(&mut own, readings, constants, &candidates)?;
    // The residual of the best explanation shows how much noise exceeds its declaration.
    inflate(&mut own, readings, &noise, &residual);
    let noise = LowRank::new(&own, constants)?;

    let likelihood = candidates.likelihood(&noise, &readings.difference);
    let explanation = likelihood.explain(&candidates.priors).ok_or(Unsolvable::NotFinite)?;
    let alone =
        explanation.alone.iter().map(|(family, ln_odds)| (Some(candidates.causes[*family]), *ln_odds));
    let detected = explanation.members.iter().map(|member| detected(&candidates, member)).collect();
    let (start_s, end_s) = readings.span_s();
    let is_steady = |index: &usize| {
        let TimeHistory { onset, shape } = candidates.all[*index].history;
        matches!(shape, Shape::Ramp(_)) && onset <= start_s
    };
    let limit = |index: usize| {
        let rate_per_h = likelihood.smallest_seen(&candidates.priors, index)?;
        let cause = candidates.cause(index);
        let change = rate_per_h * (end_s - start_s) / S_PER_H;
        change.is_finite().then(|| DetectionLimit { cause, change, unit: cause.unit() })
    };
    Ok(Decision {
        detected,
        alone: probabilities(alone.chain([(None, 0.0)]).collect()),
        limits: (0..candidates.all.len()).filter(is_steady).filter_map(limit).collect(),
        left_out: (left_out, readings.segments.len()),
        own,
    })
}

fn detected(candidates: &Candidates, member: &Member) -> DetectedCause {
    let cause = candidates.cause(member.index);
    let others = member
        .alternatives
        .iter()
        .map(|(family, relative)| (Some(candidates.causes[*family]), relative.ln()));
    let all = probabilities(others.chain([(Some(cause), 0.0), (None, -member.ln_odds)]).collect());
    let (own, alternatives): (Vec<_>, Vec<_>) = all.into_iter().partition(|one| one.cause == Some(cause));
    DetectedCause {
        cause,
        history: candidates.all[member.index].history,
        probability: own.first().map_or(0.0, |own| own.probability),
        alternatives,
    }
}

/// Probabilities from ln of the odds, most probable first.
fn probabilities(ln_odds: Vec<(Option<Cause>, f64)>) -> Vec<Alternative> {
    let (causes, ln_odds): (Vec<_>, Vec<f64>) = ln_odds.into_iter().unzip();
    let each = causes.into_iter().zip(shares(&ln_odds, 1.0));
    let mut all: Vec<Alternative> =
        each.map(|(cause, probability)| Alternative { cause, probability }).collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// Excludes outliers even for the best explanation (surge, a valve at its stop); returns their number, the remaining noise and residual.
pub(crate) fn leave_out(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    constants: &DMatrix<f64>,
    candidates: &Candidates,
) -> Result<(usize, LowRank, DMatrix<f64>), Unsolvable> {
    let count = readings.columns.len();
    let mut out = vec![false; own.len()];
    let mut noise = LowRank::new(own, constants)?;
    let mut residual = unexplained(&noise, &readings.difference, candidates);
    for _ in 0..ROUNDS {
        let sizes: Vec<f64> = (0..own.len())
            .map(|segment| {
                residual.rows(segment * count, count).iter().map(|value| value * value).sum::<f64>()
                    / count as f64
            })
            .collect();
        let kept = (0..own.len()).filter(|segment| !out[*segment]).map(|segment| sizes[segment]);
        let usual = median(kept).unwrap_or(1.0).max(1.0);
        let far: Vec<usize> = (0..own.len())
            .filter(|segment| !out[*segment] && sizes[*segment] > EXCLUDE_SIGMAS * EXCLUDE_SIGMAS * usual)
            .collect();
        if far.is_empty() {
            break;
        }
        for segment in far {
            out[segment] = true;
            own[segment] *= UNINFORMATIVE * UNINFORMATIVE;
        }
        noise = LowRank::new(own, constants)?;
        residual = unexplained(&noise, &readings.difference, candidates);
    }
    Ok((out.iter().filter(|out| **out).count(), noise, residual))
}

/// Residual after constants and the most probable causes, whitened.
fn unexplained(noise: &LowRank, difference: &DMatrix<f64>, candidates: &Candidates) -> DMatrix<f64> {
    let explained = candidates.likelihood(noise, difference).explain(&candidates.priors).unwrap_or_default();
    let mut residual = difference.clone();
    for member in explained.members {
        residual -= candidates.columns.columns(member.index, 1) * member.value;
    }
    noise.inverse_times(&noise.whiten(residual))
}

/// Minimum share of the degrees of freedom that constants leave. Bound: with fewer, the residual does not show the noise.
const MIN_FREE_SHARE: f64 = 0.2;

/// Increases each channel's noise to match the residual of the best explanation, whitened by `noise`.
pub(crate) fn inflate(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    noise: &LowRank,
    residual: &DMatrix<f64>,
) {
    let count = readings.columns.len();
    let rows = residual.nrows() as f64;
    // Constants use up their share of the degrees of freedom.
    let free = (1.0 - noise.degrees_of_freedom() / rows).max(MIN_FREE_SHARE);
    let factors: Vec<f64> = (0..count)
        .map(|column| {
            let own: Vec<f64> =
                residual.iter().skip(column).step_by(count).map(|value| value * value).collect();
            (own.iter().sum::<f64>() / own.len().max(1) as f64 / free).max(1.0).sqrt()
        })
        .collect();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(factors));
    for covariance in own {
        *covariance = &scale * &*covariance * &scale;
    }
}
