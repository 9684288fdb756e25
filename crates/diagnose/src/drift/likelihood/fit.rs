//! FittedDrifts sizes and onsets of detected causes together with all constants.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::drift::Drift;
use crate::drift::likelihood::candidates::{FINE_ONSETS, time_histories};
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::runs::request::{DriftError, Unsolvable};
use crate::drift::sensitivity::readings::{Readings, Response};
use mapper_inference::descent::{ENOUGH, ROUNDS};
use mapper_inference::time_history::TimeHistory;
use mapper_numerics::statistics::{CHI_SQUARE_1_95, NORMAL_975};
use nalgebra::{DMatrix, DVector};

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
    let pull = inverse.tr_mul(&noise.whiten(readings.difference.clone()));
    let information: Vec<f64> = (0..fine.len())
        .map(|index| columns.column(index).dot(&inverse.column(index)).max(f64::MIN_POSITIVE))
        .collect();
    let size = |index: usize| {
        let size = pull[index] / information[index];
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
