//! Contributions of the sources of uncertainty to a number of the joint fit.
//!
//! A parameter that is off its prior mean by one standard deviation moves a number by its covariance with that parameter over that standard
//! deviation: the posterior mean is off by `-S P^-1 (theta - mean)`, with posterior covariance S and prior precision P. So the contribution of a
//! declared error is what the whole identification makes of a reading that is off by it. alpha_A, probe, heating/cooling ratio, preheating and the
//! lag of Tc are correlated: each contributes the part that the previous ones do not explain (Cholesky factor of their mixture). The heat balance
//! of the housing is one source, the step's own noise and the scatter of its h about the law another. The remainder is due to the shared law of h
//! and the shape of the map, which the noise of all steps limits.

use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::step_model::parameters::{
    BAROMETER, FLOW_GAIN, GAINS, HOUSING, HUMIDITY, INLET, LN_AREA, OFFSET_CHANNELS, OFFSETS, PREHEAT,
    PROBE_MM2, REFINEMENTS, SURFACE, TC_LAG, THERMOMETERS, symbol,
};
use crate::joint::uncertainty::quantity::{Number, Quantity};
use crate::single_step::budgets;
use mapper_core::BudgetRow;
use nalgebra::DMatrix;

/// Names of the sources that are several parameters, or none.
const NOISE: &str = "noise of the step, scatter about the law of h";
const LAW: &str = "law of h and shape of the map";
const BALANCE: &str = "heat balance of the housing";
const NEUTRAL: &str = "alpha_A, probe, heating/cooling ratio, preheating and lag of Tc taken for neutral";

/// Unit of a source that is given in the unit of the number.
const OWN_UNIT: &str = "of the number";

/// What the rows of a number are computed from.
pub(crate) struct Sources<'a, 'p> {
    pub(crate) problem: &'a Problem<'p>,
    pub(crate) covariance: &'a Covariance,
    pub(crate) refined: Option<(&'a Refinements, &'a Gain)>,
}

fn is_error(index: usize) -> bool {
    (OFFSETS..HOUSING).contains(&index)
}

fn is_refinement(index: usize) -> bool {
    REFINEMENTS.iter().any(|refinement| refinement.index == index)
}

impl Sources<'_, '_> {
    /// Contributions of the parameters with a prior that is their own.
    fn by_prior(&self, quantity: &Quantity) -> Vec<(usize, f64)> {
        let by_shared = &self.covariance.shared * &quantity.answer;
        let fitted = self.covariance.fitted.iter().enumerate();
        fitted
            .filter(|(_, index)| is_error(**index) || (HOUSING..SURFACE).contains(*index))
            .filter(|(_, index)| !is_refinement(**index))
            .map(|(row, index)| (*index, -by_shared[row] / self.problem.priors[*index].sigma))
            .collect()
    }

    /// Variance by the declared errors of the readings.
    pub(crate) fn bias_variance(&self, quantity: &Quantity) -> f64 {
        let errors = self.by_prior(quantity).into_iter().filter(|(index, _)| is_error(*index));
        errors.map(|(_, contribution)| contribution * contribution).sum()
    }

    /// The rows of a number.
    pub(crate) fn rows(&self, quantity: &Quantity, freedom: f64, number: &Number) -> Vec<BudgetRow> {
        let mut rows = Vec::new();
        let mut left = number.error * number.error;
        let mut push = |source: String, sigma: f64, unit: &str, contribution: f64, freedom: Option<f64>| {
            left = (left - contribution * contribution).max(0.0);
            if sigma > 0.0 && contribution != 0.0 {
                let row = budgets::row(source, sigma, unit, contribution / sigma, contribution);
                rows.push(BudgetRow { degrees_of_freedom: freedom, ..row });
            }
            left
        };
        let mut balance = 0.0;
        for (index, contribution) in self.by_prior(quantity) {
            if is_error(index) {
                push(symbol(index), self.problem.priors[index].sigma, unit(index), contribution, None);
            } else {
                balance += contribution * contribution;
            }
        }
        for (index, sigma, contribution) in self.refinements(quantity) {
            push(symbol(index), sigma, unit(index), contribution, None);
        }
        let balance = balance.sqrt();
        let before = push(BALANCE.to_owned(), balance, OWN_UNIT, balance, None);
        let noise = quantity.own_variance.clamp(0.0, before).sqrt();
        let rest = push(NOISE.to_owned(), noise, OWN_UNIT, noise, Some(freedom)).sqrt();
        push(LAW.to_owned(), rest, OWN_UNIT, rest, None);
        push(NEUTRAL.to_owned(), number.added.abs(), OWN_UNIT, number.added, None);
        rows
    }

    /// Index, standard uncertainty and contribution of each parameter that may be neutral.
    fn refinements(&self, quantity: &Quantity) -> Vec<(usize, f64, f64)> {
        let Some((refinements, gain)) = self.refined else { return Vec::new() };
        let Some(covariance) = refinements.mixture.covariance() else { return Vec::new() };
        let answer = gain.0.tr_mul(&quantity.answer);
        // A parameter that is neutral for certain has no variance.
        let open: Vec<usize> = (0..covariance.nrows()).filter(|k| covariance[(*k, *k)] > 0.0).collect();
        let part = DMatrix::from_fn(open.len(), open.len(), |a, b| covariance[(open[a], open[b])]);
        let Some(factor) = part.cholesky() else { return Vec::new() };
        let lower = factor.l();
        let contribution = |k: usize| (k..open.len()).map(|a| lower[(a, k)] * answer[open[a]]).sum::<f64>();
        open.iter()
            .enumerate()
            .map(|(k, place)| {
                (refinements.indices[*place], covariance[(*place, *place)].sqrt(), contribution(k))
            })
            .collect()
    }
}

/// A row of ln of a number as one of the number itself.
pub(crate) fn in_unit(row: BudgetRow, number: f64, unit: &str) -> BudgetRow {
    let (scale, unit) = if row.unit == OWN_UNIT { (number, unit.to_owned()) } else { (1.0, row.unit) };
    let (standard_uncertainty, contribution) = (scale * row.standard_uncertainty, number * row.contribution);
    BudgetRow {
        degrees_of_freedom: row.degrees_of_freedom,
        ..budgets::row(
            row.source,
            standard_uncertainty,
            &unit,
            contribution / standard_uncertainty,
            contribution,
        )
    }
}

/// Unit of a parameter.
fn unit(index: usize) -> &'static str {
    match index {
        BAROMETER => "Pa",
        THERMOMETERS => "K",
        HUMIDITY => "kg/kg",
        PROBE_MM2 => "mm2",
        PREHEAT => "W/K",
        TC_LAG => "s",
        FLOW_GAIN | GAINS..BAROMETER | INLET | LN_AREA => "1",
        _ => OFFSET_CHANNELS
            .get(index.wrapping_sub(OFFSETS))
            .map_or("1", |channel| channel.info().dimension.unit()),
    }
}
