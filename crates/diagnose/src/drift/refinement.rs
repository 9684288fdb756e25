//! Fits sizes and onsets of detected causes, adds them to the model and fits again.

use crate::drift::candidates::{FINE_ONSETS, LowRank, time_histories};
use crate::drift::causes::{Cause, Drift};
use crate::drift::constants::constants;
use crate::drift::decide::{Decision, decide};
use crate::drift::drive::{Drive, predict};
use crate::drift::readings::{Readings, Response};
use crate::drift::runs::{DriftError, Unsolvable};
use mapper_inference::time_history::TimeHistory;
use mapper_numerics::least_squares::descent::{ENOUGH, ROUNDS};
use mapper_numerics::statistics::{CHI_SQUARE_1_95, NORMAL_975};
use mapper_observe::declared::Declared;
use nalgebra::{DMatrix, DVector};

/// Readings, constants, decision and fits, for the model with the detected drift.
pub(crate) struct Refinement {
    pub readings: Readings,
    pub constants: Vec<Response>,
    pub decision: Decision,
    pub fits: FittedDrifts,
}

impl Refinement {
    /// Decides and fits, and repeats both with the result in the model. Keeps the last result that the model can follow.
    pub(super) fn new(
        readings: Readings,
        own: &[DMatrix<f64>],
        drives: &mut [Drive<'_>],
        declared: &Declared,
    ) -> Result<Refinement, DriftError> {
        let mut refined = Refinement::of(readings, own, declared, &[])?;
        for _ in 0..ROUNDS {
            match refined.refine(own, drives, declared) {
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
        declared: &Declared,
        known: &[FittedDrift],
    ) -> Result<Refinement, DriftError> {
        let constants = constants(&readings, declared);
        let columns =
            DMatrix::from_fn(readings.row_count(), constants.len(), |row, column| constants[column][row]);
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
        declared: &Declared,
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
        let refined = Refinement::of(readings, own, declared, fitted).ok()?;
        (!refined.fits.drifts.is_empty()).then_some(refined)
    }
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

/// The best fit of a drift.
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

/// The fits of all drifts, with the constants.
pub(crate) struct FittedDrifts {
    pub drifts: Vec<FittedDrift>,
    /// Most probable constants, in standard deviations.
    pub constants: DVector<f64>,
    /// Noise and constants.
    pub noise: LowRank,
}

/// FittedDrifts all causes jointly, each with the kind of its time history, starting at its onset. `constants` are the responses to the constants, a column
/// each.
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
    fine.retain(|history| history.shape == start.shape);
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
