//! The efficiencies that the steps show by T2 alone, for the search for faults of sensors.
//!
//! Neither the shape of the map nor the balance of the housing acts on them: the search has both as hypotheses of its own, and an error that one
//! of them has removed no longer counts against a fault. Steps excluded from the shared parameters are left out.

use crate::IdentifyConfig;
use crate::faults::balances::efficiency::{FittedEfficiencies, FittedQuantity};
use crate::faults::end_readings::CHANNELS;
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::step_noise;
use crate::joint::step_model::parameters::{
    FLOW_GAIN, HOUSING, OFFSET_CHANNELS, OFFSETS, PREHEAT, REFINEMENTS, SURFACE,
};
use crate::joint::step_model::rows::StepRows;
use crate::joint::uncertainty::numbers::{quantities, together};
use crate::joint::uncertainty::quantity::Quantity;
use mapper_core::Channel;
use nalgebra::DMatrix;

/// Evaluates them on a problem at its minimum; `None` if they are not determined.
pub(crate) fn as_measured(
    problem: &Problem<'_>,
    steps: &[StepRows],
    config: &IdentifyConfig,
) -> Option<FittedEfficiencies> {
    let problem = &t2_alone(problem, config)?;
    let covariance = &problem.considered()?;
    let (etas, ln_hs) = quantities(problem, covariance, steps);
    let kept: Vec<usize> = (0..etas.len()).filter(|i| problem.members[*i].contributes).collect();
    let ln_h = |i: &usize| {
        problem.model.at_end(&steps[*i].end, &problem.shared, &problem.members[*i].local).h_w_m2k.ln()
    };
    let fitted = |quantities: &[Quantity], value: &dyn Fn(&usize) -> f64| {
        let (without, by_reading) = without_readings(covariance, quantities, &kept, steps);
        FittedQuantity { values: kept.iter().map(value).collect(), covariance: without, by_reading }
    };
    Some(FittedEfficiencies {
        positions: kept.iter().map(|i| steps[*i].position).collect(),
        eta: fitted(&etas, &|i| etas[*i].value),
        ln_h: fitted(&ln_hs, &ln_h),
    })
}

/// The problem at its minimum without surface and balance, with readings that have no error.
fn t2_alone<'a>(problem: &Problem<'a>, config: &IdentifyConfig) -> Option<Problem<'a>> {
    let mut free = problem.clone();
    free.surface_sigma = f64::INFINITY;
    free.active[SURFACE..].fill(false);
    free.active[HOUSING..SURFACE].fill(false);
    // Only the balance tells it from alpha_A.
    free.active[PREHEAT] = false;
    free.model.has_balance = false;
    for member in &mut free.members {
        member.measured_k.truncate(member.history.step.rows.len());
    }
    for refinement in REFINEMENTS {
        free.priors[refinement.index].sigma = refinement.slab_sigma;
    }
    let errors: Vec<bool> = free.active[OFFSETS..HOUSING].to_vec();
    free.active[OFFSETS..HOUSING].fill(false);
    for index in OFFSETS..HOUSING {
        free.shared[index] =
            if free.priors[index].sigma.is_finite() { free.priors[index].mean } else { free.shared[index] };
    }
    step_noise::set(&mut free, config)?;
    free.minimise_roughly()?;
    free.active[OFFSETS..HOUSING].copy_from_slice(&errors);
    Some(free)
}

/// Covariance of a quantity over the kept steps without the declared errors of the readings, and its sensitivities to them.
fn without_readings(
    covariance: &Covariance,
    quantities: &[Quantity],
    kept: &[usize],
    steps: &[StepRows],
) -> (DMatrix<f64>, Vec<[Option<f64>; CHANNELS.len()]>) {
    let carried: Vec<usize> = (0..covariance.fitted.len())
        .filter(|row| (OFFSETS..HOUSING).contains(&covariance.fitted[*row]))
        .collect();
    // The errors are independent of all else, so their share is their sensitivity times their spread.
    let by_shared = |i: usize, row: usize| covariance.shared.row(row).transpose().dot(&quantities[i].answer);
    let answer = |i: usize, row: usize| by_shared(i, row) / covariance.shared[(row, row)];
    let by_reading = |i: usize| {
        CHANNELS.map(|channel| {
            let row = carried.iter().find(|row| channel_of(covariance.fitted[**row]) == Some(channel))?;
            // If the error is known, the efficiency rises by the amount that the error had lowered it.
            let per_unit = -answer(i, *row);
            let flow_kg_s = steps[i].end.flow_kg_s;
            // The parameter of the flow meter is a gain.
            Some(if channel == Channel::CompressorFlow { per_unit / flow_kg_s } else { per_unit })
        })
    };
    let all = together(quantities, covariance);
    let matrix = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
        let (i, j) = (kept[i], kept[j]);
        let by_readings = |row: &usize| answer(i, *row) * by_shared(j, *row);
        all[(i, j)] - carried.iter().map(by_readings).sum::<f64>()
    });
    (matrix, kept.iter().map(|i| by_reading(*i)).collect())
}

/// The channel whose error a shared parameter describes.
fn channel_of(index: usize) -> Option<Channel> {
    if index == FLOW_GAIN {
        return Some(Channel::CompressorFlow);
    }
    OFFSET_CHANNELS.get(index.checked_sub(OFFSETS)?).copied()
}
