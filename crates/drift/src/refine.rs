//! A drift that was found is planted in the model and fitted again around that: the signature of the first look is that
//! of a small change that has always been there, while the metal lags behind a real one.

use crate::candidates::mean_of;
use crate::cause::CauseKind;
use crate::constant::Constant;
use crate::decide::Decision;
use crate::drive::{Drive, predict};
use crate::fit::{Fit, fit};
use crate::low_rank::LowRank;
use crate::nuisance;
use crate::planted::Planted;
use crate::readings::Readings;
use mapper_observe::declared::Declared;
use nalgebra::DMatrix;

/// Rounds: each leaves about a tenth of what the one before had wrong.
const ROUNDS: usize = 2;
/// How far, relative, the size of a change of the machine may be off beside what noise does: the model's answer to it is
/// that of the nominal machine. A recording of another program's simulation is 9 % off where noise allows for 3 %.
const MACHINE_SIZE_ERROR: f64 = 0.1;

/// Readings, constants and fit around what was found.
pub(crate) struct Refined {
    pub readings: Readings,
    pub constants: Vec<Constant>,
    pub fit: Fit,
}

impl Refined {
    /// Fits again around what was found, in rounds; what was found last stays where the model cannot follow it further.
    pub fn around(mut self, drives: &mut [Drive<'_>], declared: &Declared, decision: &Decision) -> Self {
        for _ in 0..ROUNDS {
            match self.round(drives, declared, decision) {
                Some(better) => self = better,
                None => break,
            }
        }
        if decision.cause.kind() == CauseKind::Machine {
            let Fit { size, low, high, .. } = &mut self.fit;
            let wider =
                |end: f64| *size + (end - *size).signum() * (end - *size).hypot(MACHINE_SIZE_ERROR * *size);
            (*low, *high) = (wider(*low), wider(*high));
        }
        self
    }

    /// `None` where there is nothing to plant, or the model cannot follow what is planted.
    fn round(&self, drives: &mut [Drive<'_>], declared: &Declared, decision: &Decision) -> Option<Refined> {
        let Decision { cause, own, .. } = decision;
        let planted = Planted { cause: *cause, course: self.fit.course, size: self.fit.size };
        if !planted.is_in_model() {
            return None;
        }
        let (base, turned) = predict(drives, Some(planted)).ok()?;
        let mut readings = self.readings.around(base, &turned)?;
        let constants = nuisance::constants(&readings, declared);
        // What is planted is fitted again as a whole: its linear part is given back to the readings.
        let signature = readings.signature(*cause)?;
        let of_rows: Vec<f64> = (0..readings.difference.len())
            .map(|row| planted.size * mean_of(&readings, row, planted.course))
            .collect();
        let of_steps: Vec<f64> =
            readings.steps.iter().map(|step| self.fit.drift_at(step.end_s + step.offset_s)).collect();
        readings.give_back(&signature, &of_rows, &of_steps);
        let columns = DMatrix::from_fn(readings.difference.len(), constants.len(), |row, column| {
            constants[column].readings[row]
        });
        let noise = LowRank::new(own, &columns).ok()?;
        let fit = fit(&readings, noise, *cause, planted.course.kind).ok()?;
        Some(Refined { readings, constants, fit })
    }
}
