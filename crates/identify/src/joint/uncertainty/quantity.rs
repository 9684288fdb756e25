//! Quantities that depend on the parameters of a joint fit, and the covariance of their errors.

use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::step_model::parameters::{
    ETA, EXPONENT, HUMIDITY, LN_AREA, LN_COEFFICIENT, LN_DEVIATION, OFFSETS, SHARED, SharedVector,
};
use crate::joint::step_model::rows::StepRows;
use nalgebra::DVector;

/// Step of the derivative of h by an offset, in prior standard deviations. Bound: the law is nearly linear over it.
const STEP_SIGMAS: f64 = 0.1;

/// A quantity that depends on the parameters: its covariance with every point's efficiency, its variance, and its covariances with the shared
/// parameters.
pub(crate) struct Quantity {
    pub(crate) value: f64,
    pub(crate) by_eta: DVector<f64>,
    /// The part of `by_eta` that the smoothness prior may reduce: from the offsets and from the step's own noise.
    pub(crate) by_smooth: DVector<f64>,
    pub(crate) variance: f64,
    pub(crate) by_shared: DVector<f64>,
    /// Sensitivity of the quantity to the shared parameters.
    pub(crate) answer: DVector<f64>,
    /// Variance with all shared parameters known (the step's own noise), and its covariance with the step's efficiency.
    pub(crate) own_variance: f64,
    pub(crate) own_with_eta: f64,
}

pub(crate) fn is_offset(index: usize) -> bool {
    (OFFSETS..=HUMIDITY).contains(&index)
}

/// A shared parameter, relative to the fitted value.
pub(crate) fn of_shared(covariance: &Covariance, row: usize) -> Quantity {
    let by_shared: DVector<f64> = covariance.shared.column(row).into_owned();
    let by_eta = DVector::from_iterator(
        covariance.sensitivities.len(),
        covariance.sensitivities.iter().map(|answer| answer.row(ETA).transpose().dot(&by_shared)),
    );
    let by_smooth = by_offsets(covariance, &by_shared);
    let variance = covariance.shared[(row, row)];
    let mut answer = DVector::zeros(by_shared.len());
    answer[row] = 1.0;
    let (value, own_variance, own_with_eta) = (0.0, 0.0, 0.0);
    Quantity { value, by_eta, by_smooth, variance, by_shared, answer, own_variance, own_with_eta }
}

/// Covariance of a quantity with every point's efficiency, through the offsets alone.
fn by_offsets(covariance: &Covariance, by_shared: &DVector<f64>) -> DVector<f64> {
    let carried: Vec<(usize, f64)> = (0..covariance.fitted.len())
        .filter(|row| is_offset(covariance.fitted[*row]))
        .map(|row| (row, by_shared[row] / covariance.shared[(row, row)]))
        .collect();
    let of_step = |(_, mixed): &(_, nalgebra::Matrix4xX<f64>)| {
        carried.iter().map(|(row, factor)| factor * mixed[(ETA, *row)]).sum::<f64>()
    };
    DVector::from_iterator(covariance.own.len(), covariance.own.iter().map(of_step))
}

/// Covariance of two quantities of one step with all shared parameters known.
fn alone(covariance: &Covariance, step: usize, first: usize, second: usize) -> f64 {
    let (own, mixed) = &covariance.own[step];
    own[(first, second)] - mixed.row(second).dot(&covariance.sensitivities[step].row(first))
}

/// Efficiency and ln h of every step, relative to the fitted values.
pub(crate) fn quantities(
    problem: &Problem<'_>,
    covariance: &Covariance,
    steps: &[StepRows],
) -> (Vec<Quantity>, Vec<Quantity>) {
    let count = problem.members.len();
    let sensitivities: Vec<DVector<f64>> =
        covariance.sensitivities.iter().map(|answer| answer.row(ETA).transpose()).collect();
    let etas: Vec<Quantity> = (0..count)
        .map(|i| {
            let (own, mixed) = &covariance.own[i];
            let by_shared: DVector<f64> = mixed.row(ETA).transpose();
            let mut by_eta =
                DVector::from_iterator(count, sensitivities.iter().map(|answer| answer.dot(&by_shared)));
            by_eta[i] = own[(ETA, ETA)];
            let mut by_smooth = by_offsets(covariance, &by_shared);
            let own_variance = alone(covariance, i, ETA, ETA);
            by_smooth[i] += own_variance;
            let (value, variance) = (problem.members[i].local[ETA], own[(ETA, ETA)]);
            let (answer, own_with_eta) = (sensitivities[i].clone(), own_variance);
            Quantity { value, by_eta, by_smooth, variance, by_shared, answer, own_variance, own_with_eta }
        })
        .collect();
    let ln_hs = (0..count)
        .map(|i| {
            let (own, mixed) = &covariance.own[i];
            let mut weights = [0.0; SHARED];
            weights[LN_AREA] = -1.0;
            let at = |shared: &SharedVector| {
                problem.setting.h_at_end(&steps[i].end, shared, &problem.members[i].local)
            };
            let (h_w_m2k, ln_re) = at(&problem.shared);
            weights[LN_COEFFICIENT] = 1.0;
            weights[EXPONENT] = ln_re;
            // The convection law is evaluated at the readings, so a flow error is an error of h.
            for index in covariance.fitted.iter().copied().filter(|index| is_offset(*index)) {
                let step = STEP_SIGMAS * problem.priors[index].sigma;
                let mut moved = problem.shared;
                moved[index] += step;
                weights[index] = (at(&moved).0 / h_w_m2k).ln() / step;
            }
            let weights = DVector::from_iterator(
                covariance.fitted.len(),
                covariance.fitted.iter().map(|k| weights[*k]),
            );
            let deviation: DVector<f64> = mixed.row(LN_DEVIATION).transpose();
            let by_shared = &deviation + &covariance.shared * &weights;
            let mut by_eta =
                DVector::from_iterator(count, sensitivities.iter().map(|answer| answer.dot(&by_shared)));
            by_eta[i] = own[(LN_DEVIATION, ETA)] + mixed.row(ETA).transpose().dot(&weights);
            let variance = own[(LN_DEVIATION, LN_DEVIATION)] + weights.dot(&(&by_shared + &deviation));
            let mut by_smooth = by_offsets(covariance, &by_shared);
            let own_with_eta = alone(covariance, i, ETA, LN_DEVIATION);
            by_smooth[i] += own_with_eta;
            let answer = covariance.sensitivities[i].row(LN_DEVIATION).transpose() + &weights;
            let own_variance = alone(covariance, i, LN_DEVIATION, LN_DEVIATION);
            let value = 0.0;
            Quantity { value, by_eta, by_smooth, variance, by_shared, answer, own_variance, own_with_eta }
        })
        .collect();
    (etas, ln_hs)
}
