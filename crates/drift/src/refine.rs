//! A drift that was found is planted in the model and fitted again around that: the signature of the first look is that
//! of a small change that has always been there, while the metal lags behind a real one.

use crate::candidates::mean_of;
use crate::cause::{Cause, CauseKind};
use crate::constant::Constant;
use crate::course::Course;
use crate::decide::Decision;
use crate::drive::{Drive, predict};
use crate::fit::{Fit, Fits, fit};
use crate::nuisance;
use crate::planted::Planted;
use crate::readings::Readings;
use crate::request::DriftError;
use mapper_observe::declared::Declared;
use nalgebra::DMatrix;

/// Rounds: each leaves about a tenth of what the one before had wrong.
const ROUNDS: usize = 2;
/// How far, relative, the size of a change of the machine may be off beside what noise does: the model's answer to it is
/// that of the nominal machine. A recording of another program's simulation is 9 % off where noise allows for 3 %.
const MACHINE_SIZE_ERROR: f64 = 0.1;

/// Readings, constants and fits around what was found.
pub(crate) struct Refined {
    pub readings: Readings,
    pub constants: Vec<Constant>,
    pub fits: Fits,
}

impl Refined {
    /// Fits what was found, then again around that, in rounds; what was found last stays where the model cannot follow it further.
    pub fn new(
        readings: Readings,
        constants: Vec<Constant>,
        drives: &mut [Drive<'_>],
        declared: &Declared,
        decision: &Decision,
    ) -> Result<Refined, DriftError> {
        let found: Vec<(Cause, Course)> =
            decision.found.iter().map(|found| (found.cause, found.course)).collect();
        let fits = fit(&readings, &decision.own, &columns(&constants, &readings), &found)?;
        let mut refined = Refined { readings, constants, fits };
        for _ in 0..ROUNDS {
            match refined.round(drives, declared, &decision.own) {
                Some(better) => refined = better,
                None => break,
            }
        }
        for Fit { cause, size, low, high, .. } in &mut refined.fits.drifts {
            if cause.kind() == CauseKind::Machine {
                let wider = |end: f64| {
                    *size + (end - *size).signum() * (end - *size).hypot(MACHINE_SIZE_ERROR * *size)
                };
                (*low, *high) = (wider(*low), wider(*high));
            }
        }
        Ok(refined)
    }

    /// `None` where there is nothing to plant, or the model cannot follow what is planted.
    fn round(&self, drives: &mut [Drive<'_>], declared: &Declared, own: &[DMatrix<f64>]) -> Option<Refined> {
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
        let constants = nuisance::constants(&readings, declared);
        // What is planted is fitted again as a whole: its linear part is given back to the readings.
        for Planted { cause, course, size } in planted {
            let signature = readings.planted_signature(cause)?;
            let of_rows: Vec<f64> =
                (0..readings.difference.len()).map(|row| size * mean_of(&readings, row, course)).collect();
            let of_steps: Vec<f64> =
                readings.steps.iter().map(|step| size * course.at(step.end_s + step.offset_s)).collect();
            readings.give_back(&signature, &of_rows, &of_steps);
        }
        let found: Vec<(Cause, Course)> = drifts.iter().map(|fit| (fit.cause, fit.course)).collect();
        let fits = fit(&readings, own, &columns(&constants, &readings), &found).ok()?;
        Some(Refined { readings, constants, fits })
    }
}

/// Constants as the readings show them, a column each.
pub(crate) fn columns(constants: &[Constant], readings: &Readings) -> DMatrix<f64> {
    DMatrix::from_fn(readings.difference.len(), constants.len(), |row, column| {
        constants[column].readings[row]
    })
}
