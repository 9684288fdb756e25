//! A drift that was found is planted in the model, with the constants beside it, and fitted again around that: signatures
//! of the first look are those of a small change that has always been there, on the nominal machine.

use crate::Cause;
use crate::candidates::mean_of;
use crate::decide::Decision;
use crate::fit::{Fit, fit};
use crate::leftovers::AS_GOOD_AS_NOTHING;
use crate::low_rank::LowRank;
use crate::nuisance::{self, Constant};
use crate::planted::Planted;
use crate::simulate::Drive;
use crate::study::{Readings, SURGE_LIMIT, predict};
use mapper_core::{Channel, DeclaredUncertainty};
use nalgebra::DMatrix;

/// Rounds: each leaves about a tenth of what the one before had wrong.
const ROUNDS: usize = 3;

/// Readings, constants and fit around what was found.
pub(crate) struct Refined {
    pub readings: Readings,
    pub constants: Vec<Constant>,
    pub fit: Fit,
}

/// Fits again around what was found; what was found first stays where the model cannot follow it further.
pub(crate) fn refine(
    drives: &mut [Drive<'_>],
    declared: &dyn Fn(Channel) -> DeclaredUncertainty,
    readings: Readings,
    constants: Vec<Constant>,
    decision: &mut Decision,
    first: Fit,
) -> Refined {
    let mut refined = Refined { readings, constants, fit: first };
    for _ in 0..ROUNDS {
        match round(drives, declared, &refined, decision) {
            Some(better) => refined = better,
            None => break,
        }
    }
    refined
}

fn round(
    drives: &mut [Drive<'_>],
    declared: &dyn Fn(Channel) -> DeclaredUncertainty,
    now: &Refined,
    decision: &mut Decision,
) -> Option<Refined> {
    let cause = decision.cause;
    let mut planted = Planted::default();
    for (constant, size) in now.constants.iter().zip(now.fit.constants.iter()) {
        if let Some((knob, over, sigma)) = constant.turn {
            planted.turns.push((knob, over, sigma * size));
        }
    }
    // What an output's sensor adds is linear already.
    let in_model = !matches!(cause, Cause::Sensor(channel) if !crate::knob::INPUTS.contains(&channel));
    if in_model {
        planted.drift = Some((cause, now.fit.course, now.fit.size));
    }
    let (base, turned) = predict(drives, &planted).ok()?;
    let mut readings = now.readings.around(base, &turned)?;
    let constants = nuisance::constants(&readings, declared);

    // What is planted stays part of what is fitted: its linear part is given back.
    let by = |constant: &Constant| constant.turn.map(|(knob, over, sigma)| planted.by(knob, over) / sigma);
    for constant in &constants {
        if let Some(size) = by(constant) {
            readings.give_back(constant, &|_| size, &|_| size);
        }
    }
    if in_model && let Some(signature) = readings.signature(cause) {
        let means: Vec<f64> = (0..readings.difference.len())
            .map(|row| now.fit.size * mean_of(&readings, row, now.fit.course))
            .collect();
        let ends: Vec<f64> =
            readings.steps.iter().map(|step| now.fit.drift_at(step.end_s + step.offset_s)).collect();
        readings.give_back(&signature, &|row| means[row], &|step| ends[step]);
    }
    for (own, surge_position) in decision.own.iter_mut().zip(&readings.surge_position_ratio) {
        // Beyond that the model is not linear around anything.
        if *surge_position >= SURGE_LIMIT && own.iter().all(|value| value.abs() < AS_GOOD_AS_NOTHING) {
            *own *= AS_GOOD_AS_NOTHING;
        }
    }
    let columns = DMatrix::from_fn(readings.difference.len(), constants.len(), |row, column| {
        constants[column].readings[row]
    });
    let noise = LowRank::new(&decision.own, &columns).ok()?;
    let fit = fit(&readings, noise, cause, now.fit.course.kind).ok()?;
    Some(Refined { readings, constants, fit })
}
