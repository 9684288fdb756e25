//! Widens intervals by the faults that the balances neither show nor exclude.
//!
//! Even if no fault is found, each fault has a probability and a size. The interval of a number covers its value without a fault and its value
//! with each single fault that is not excluded. A fault that the balances determine well changes nothing. Without a declared machine they
//! determine few faults, and the intervals are valid for sensors as declared.

use crate::IdentifyConfig;
use crate::faults::Hypotheses;
use crate::faults::balance_rows::Rows;
use crate::faults::balances::efficiency::FittedEfficiencies;
use crate::faults::balances::{efficiency, housing};
use crate::faults::end_readings::Readings;
use crate::faults::found_fault::Suspect;
use crate::single_step::budgets::own_row;
use crate::single_step::dynamic::Estimate;
use mapper_core::{EstimateUncertainty, half_width_95, standard_error_of};
use mapper_inference::hypotheses::Single;
use mapper_inference::mixture::MIN_WEIGHT;
use nalgebra::DVector;

/// A fault that is not excluded.
struct PossibleFault {
    /// Its size: mean and standard deviation.
    size: (f64, f64),
    /// Its effects on efficiency and on ln h, per unit of the size.
    effects: [DVector<f64>; 2],
}

/// `readings`: of all steps, by position; `estimates` likewise.
pub(crate) fn widen(
    estimates: &mut [Estimate],
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    hypotheses: &Hypotheses,
    config: &IdentifyConfig,
) -> Option<()> {
    let [etas, ln_hs] = [efficiency::measured(fitted, readings), housing::measured(fitted, readings, config)];
    let possible = |single: Single| {
        let Suspect::Sensor(fault) = hypotheses.suspects[single.index] else { return None };
        let effect = |rows: &Rows| rows.by_fault(&fault);
        (single.odds > MIN_WEIGHT).then(|| PossibleFault {
            size: (single.value, single.sigma),
            effects: [effect(&etas), effect(&ln_hs)],
        })
    };
    let singles = hypotheses.likelihood.singles(&hypotheses.priors)?;
    let possible: Vec<PossibleFault> = singles.into_iter().filter_map(possible).collect();
    let positions = fitted.positions.iter().filter(|position| readings[**position].is_some());
    for (row, position) in positions.enumerate() {
        widen_one(estimates.get_mut(*position)?, &possible, row);
    }
    Some(())
}

fn widen_one(estimate: &mut Estimate, possible: &[PossibleFault], row: usize) -> Option<()> {
    let intervals = estimate.intervals?;
    let (eta, h_w_m2k) = (estimate.eta.as_mut()?, estimate.h_w_m2k.as_mut()?);
    let mut widened = intervals;
    for (which, (value, uncertainty)) in [eta, h_w_m2k].into_iter().enumerate() {
        let (low, high) = intervals[which];
        let error = standard_error_of(low, high);
        // The effect on h is one on its logarithm.
        let scale = if which == 0 { 1.0 } else { *value };
        let (mut after, mut shift) = ((low, high), 0.0);
        for fault in possible {
            let effect = scale * fault.effects[which][row];
            let (by, sigma) = (effect * fault.size.0, (effect * fault.size.1).abs());
            let half = half_width_95(error.hypot(sigma));
            after = (after.0.min(*value - by - half), after.1.max(*value - by + half));
            shift -= by;
        }
        let added = (standard_error_of(after.0, after.1).powi(2) - error * error).max(0.0).sqrt();
        if let Some(uncertainty) = uncertainty {
            let bias_standard_error = uncertainty.bias_standard_error.hypot(added);
            *uncertainty = EstimateUncertainty { bias_standard_error, ..*uncertainty };
        }
        // One fault moves all points.
        estimate.common[which].push(added.copysign(shift));
        if added > 0.0 {
            let unit = ["1", "W/(m2 K)"][which];
            let row = own_row("faults that are not excluded", added.copysign(shift), unit);
            estimate.budgets[which].push(row);
        }
        widened[which] = after;
    }
    estimate.intervals = Some(widened);
    Some(())
}
