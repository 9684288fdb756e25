//! Plants a detected drift in the model and fits again about it. The first signature is that of a small constant change, but the metal lags
//! behind a real one.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::planted::Planted;
use crate::drift::causes::time_history::Course;
use crate::drift::likelihood::candidates::{FINE_ONSETS, mean_of};
use crate::drift::likelihood::decide::{Decision, decide};
use crate::drift::likelihood::fit::{Fit, Fits, fit};
use crate::drift::runs::request::DriftError;
use crate::drift::sensitivity::drive::{Drive, predict};
use crate::drift::sensitivity::nuisance;
use crate::drift::sensitivity::readings::{Constant, Readings};
use mapper_inference::descent::ROUNDS;
use mapper_observe::declared::Declared;
use nalgebra::DMatrix;

/// Readings, constants, decisions and fits about the detected drift.
pub(crate) struct Refined {
    pub readings: Readings,
    pub constants: Vec<Constant>,
    pub decision: Decision,
    pub fits: Fits,
}

impl Refined {
    /// Decides and fits, then repeats about the result; keeps the last result that the model can follow.
    pub fn new(
        readings: Readings,
        own: &[DMatrix<f64>],
        drives: &mut [Drive<'_>],
        declared: &Declared,
    ) -> Result<Refined, DriftError> {
        let mut refined = Refined::of(readings, own, declared, &[])?;
        for _ in 0..ROUNDS {
            match refined.round(own, drives, declared) {
                Some(better) => refined = better,
                None => break,
            }
        }
        Ok(refined)
    }

    /// Decides from these readings and the known drifts; first with onsets on a grid, then with closer ones about the result.
    fn of(
        readings: Readings,
        own: &[DMatrix<f64>],
        declared: &Declared,
        known: &[Fit],
    ) -> Result<Refined, DriftError> {
        let constants = nuisance::constants(&readings, declared);
        let columns = columns(&constants, &readings);
        let decided = |known: &[Fit]| -> Result<(Decision, Fits), DriftError> {
            let courses: Vec<(Cause, Course)> = known.iter().map(|fit| (fit.cause, fit.course)).collect();
            let decision =
                decide(&readings, own.to_vec(), &with_dates(&columns, &readings, known), &courses)?;
            let fits = fit(&readings, &decision.own, &columns, &decision.courses())?;
            Ok((decision, fits))
        };
        let (mut decision, mut fits) = decided(known)?;
        if known.is_empty() && !fits.drifts.is_empty() {
            (decision, fits) = decided(&fits.drifts)?;
        }
        Ok(Refined { readings, constants, decision, fits })
    }

    /// `None` if there is nothing to plant, the model cannot follow it, or nothing is found about it.
    fn round(&self, own: &[DMatrix<f64>], drives: &mut [Drive<'_>], declared: &Declared) -> Option<Refined> {
        let drifts = &self.fits.drifts;
        let planted: Vec<Planted> = drifts
            .iter()
            .map(|Fit { cause, course, size, .. }| Planted { cause: *cause, course: *course, size: *size })
            .filter(Planted::is_in_model)
            .collect();
        if planted.is_empty() {
            return None;
        }
        let (base, turned) = predict(drives, &planted).ok()?;
        let mut readings = self.readings.around(base, &turned)?;
        // The planted drift is fitted again as a whole, so its linear part is added back to the readings.
        for Planted { cause, course, size } in planted {
            let signature = readings.planted_signature(cause)?;
            let of_rows: Vec<f64> =
                (0..readings.difference.len()).map(|row| size * mean_of(&readings, row, course)).collect();
            let of_steps: Vec<f64> =
                readings.steps.iter().map(|step| size * course.at(step.end_s + step.offset_s)).collect();
            readings.give_back(&signature, &of_rows, &of_steps);
        }
        let refined = Refined::of(readings, own, declared, drifts).ok()?;
        (!refined.fits.drifts.is_empty()).then_some(refined)
    }
}

/// The constants, and the effect of a date error of each known drift, which would otherwise look like another drift.
fn with_dates(columns: &DMatrix<f64>, readings: &Readings, known: &[Fit]) -> DMatrix<f64> {
    let (start_s, end_s) = readings.span_s();
    // Use the onset spacing of the fit.
    let dated_s = (end_s - start_s) / FINE_ONSETS as f64;
    let mut all = columns.clone().resize_horizontally(columns.ncols() + known.len(), 0.0);
    for (place, Fit { cause, course, size, .. }) in known.iter().enumerate() {
        let Some(signature) = readings.signature(*cause) else { continue };
        let dated = |row: usize, by_s: f64| {
            mean_of(readings, row, Course { onset_s: course.onset_s + by_s, ..*course })
        };
        for (row, value) in signature.readings.iter().enumerate() {
            all[(row, columns.ncols() + place)] =
                0.5 * size * value * (dated(row, dated_s) - dated(row, -dated_s));
        }
    }
    all
}

/// Effects of constants on the readings, a column each.
fn columns(constants: &[Constant], readings: &Readings) -> DMatrix<f64> {
    DMatrix::from_fn(readings.difference.len(), constants.len(), |row, column| {
        constants[column].readings[row]
    })
}
