//! Contributions of the sources of uncertainty to a number of the joint fit.
//!
//! The posterior is linearised at the fit. Declared errors of readings are independent of each other and of everything else, so each contributes
//! its sensitivity, as the smoothness prior leaves it, times its declared size. So does the loss of efficiency at low speed, which looks like
//! an offset and limits what smoothness corrects. alpha_A, probe and heating/cooling ratio are correlated: each contributes the part that the
//! previous ones do not explain (Cholesky factor of their covariance). The step's own noise and the scatter of its h about the law come next.
//! The remainder is due to the shared law of h and the shape of the map, which the noise of all steps limits.

use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::Covariance;
use crate::joint::step_model::parameters::{
    BAROMETER, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_AREA, OFFSET_CHANNELS, OFFSETS, PROBE_MM2, SURFACE,
    symbol,
};
use crate::joint::step_model::surface::SLOW_LOSS;
use crate::joint::uncertainty::quantity::Quantity;
use crate::single_step::budgets;
use mapper_core::BudgetRow;
use nalgebra::DVector;

/// Names of the sources that are not shared parameters.
const NOISE: &str = "noise of the step, scatter about the law of h";
const SLOW: &str = "efficiency lost at low speed";
const LAW: &str = "law of h and shape of the map";
const NEUTRAL: &str = "alpha_A, probe and heating/cooling ratio taken for neutral";

/// Unit of a source that is given in the unit of the number.
const OWN_UNIT: &str = "of the number";

/// Change of a number by changes of the points' efficiencies, which a shared parameter causes.
pub(crate) type Correction<'a> = dyn Fn(&DVector<f64>, Option<usize>) -> f64 + 'a;

/// A number with its error after smoothing: without the excess of the interval over the mixture, and that excess.
pub(crate) struct ReportedError {
    pub(crate) error: f64,
    pub(crate) added: f64,
    /// Degrees of freedom of the step's noise.
    pub(crate) degrees_of_freedom: f64,
}

/// The rows of a number. `step`: its position among `etas`. `correction`: change of the smoothness prior's correction by changes of the points'
/// efficiencies that a shared parameter, or the true efficiency, causes; `pull`: the same per change of the step's own.
pub(crate) fn rows(
    covariance: &Covariance,
    refined: Option<(&Refinements, &Gain)>,
    (quantity, etas, step): (&Quantity, &[Quantity], usize),
    (correction, pull, slowness): (&Correction<'_>, f64, &[f64]),
    reported: &ReportedError,
) -> Vec<BudgetRow> {
    let mut rows = Vec::new();
    let mut left = reported.error * reported.error;
    let mut push = |source: String, sigma: f64, unit: &str, contribution: f64, freedom: Option<f64>| {
        left = (left - contribution * contribution).max(0.0);
        if sigma > 0.0 && contribution != 0.0 {
            let row = budgets::row(source, sigma, unit, contribution / sigma, contribution);
            rows.push(BudgetRow { degrees_of_freedom: freedom, ..row });
        }
        left
    };
    for (row, index) in covariance.fitted.iter().enumerate() {
        if (OFFSETS..SURFACE).contains(index) {
            let sigma = covariance.shared[(row, row)].sqrt();
            let of = |quantity: &Quantity| quantity.by_shared[row] / sigma;
            let changes = DVector::from_iterator(etas.len(), etas.iter().map(of));
            let contribution = of(quantity) - correction(&changes, Some(*index));
            push(symbol(*index), sigma, unit(*index), contribution, None);
        }
    }
    for (name, sigma, contribution, unit) in refinement_rows(refined, quantity) {
        push(name, sigma, unit, contribution, None);
    }
    // The fitted efficiencies have the loss, as the true ones do.
    if slowness.len() == etas.len() {
        let changes = SLOW_LOSS * DVector::from_column_slice(slowness);
        push(SLOW.to_owned(), SLOW_LOSS, "1", -correction(&changes, None), None);
    }
    let pulled = pull * (pull * etas[step].own_variance - 2.0 * quantity.own_with_eta);
    let before = push(String::new(), 0.0, "", 0.0, None);
    let noise = (quantity.own_variance + pulled).clamp(0.0, before).sqrt();
    let rest = push(NOISE.to_owned(), noise, OWN_UNIT, noise, Some(reported.degrees_of_freedom)).sqrt();
    push(LAW.to_owned(), rest, OWN_UNIT, rest, None);
    push(NEUTRAL.to_owned(), reported.added.abs(), OWN_UNIT, reported.added, None);
    rows
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

/// Name, standard uncertainty, contribution and unit of each parameter that may be neutral.
fn refinement_rows(
    refined: Option<(&Refinements, &Gain)>,
    quantity: &Quantity,
) -> Vec<(String, f64, f64, &'static str)> {
    let Some((refinements, gain)) = refined else { return Vec::new() };
    let Some(covariance) = refinements.mixture.covariance() else { return Vec::new() };
    let answer = gain.0.tr_mul(&quantity.answer);
    // A parameter that is neutral for certain has no variance.
    let open: Vec<usize> = (0..covariance.nrows()).filter(|k| covariance[(*k, *k)] > 0.0).collect();
    let part = nalgebra::DMatrix::from_fn(open.len(), open.len(), |a, b| covariance[(open[a], open[b])]);
    let Some(factor) = part.cholesky() else { return Vec::new() };
    let lower = factor.l();
    let contribution = |k: usize| (k..open.len()).map(|a| lower[(a, k)] * answer[open[a]]).sum::<f64>();
    open.iter()
        .enumerate()
        .map(|(k, place)| {
            let index = refinements.indices[*place];
            let unit = if index == PROBE_MM2 { "mm2" } else { "1" };
            (symbol(index), covariance[(*place, *place)].sqrt(), contribution(k), unit)
        })
        .collect()
}

/// Unit of a declared error.
fn unit(index: usize) -> &'static str {
    match index {
        BAROMETER => "Pa",
        HUMIDITY => "kg/kg",
        FLOW_GAIN | GAINS..BAROMETER | INLET | LN_AREA => "1",
        _ => OFFSET_CHANNELS
            .get(index.wrapping_sub(OFFSETS))
            .map_or("1", |channel| channel.info().dimension.unit()),
    }
}
