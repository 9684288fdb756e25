//! Adds a detected drift to the model and fits again. The first signature of a drift is that of a small constant change, but the metal lags behind a
//! real one.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::drift::Drift;
use crate::drift::likelihood::candidates::FINE_ONSETS;
use crate::drift::likelihood::decide::{Decision, decide};
use crate::drift::likelihood::fit::{FittedDrift, FittedDrifts, fit};
use crate::drift::runs::request::DriftError;
use crate::drift::sensitivity::constants::constants;
use crate::drift::sensitivity::drive::{Drive, predict};
use crate::drift::sensitivity::readings::{Readings, Response};
use mapper_inference::descent::ROUNDS;
use mapper_inference::time_history::TimeHistory;
use mapper_observe::declared::Declared;
use nalgebra::DMatrix;

/// Readings, constants, decision and fits, for the model with the detected drift.
pub(crate) struct Refinement {
    pub readings: Readings,
    pub constants: Vec<Response>,
    pub decision: Decision,
    pub fits: FittedDrifts,
}

impl Refinement {
    /// Decides and fits, and repeats both with the result in the model. Keeps the last result that the model can follow.
    pub fn new(
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
