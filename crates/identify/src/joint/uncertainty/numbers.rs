//! The numbers of all points, efficiency and h, with their errors.
//!
//! A number depends on the step's own parameters and on the shared ones. The parameters of a step respond to the shared ones as the fit does, so
//! that a number is a linear function of the shared parameters plus an error of the step alone.

use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::step_model::parameters::{
    ETA, EXPONENT, HOUSING, LN_AREA, LN_COEFFICIENT, LN_DEVIATION, LOCAL, OFFSETS, SHARED,
};
use crate::joint::step_model::rows::StepRows;
use crate::joint::uncertainty::budget;
use crate::joint::uncertainty::quantity::{Number, Quantity, common_part};
use mapper_core::{BudgetRow, EstimateUncertainty, confidence_interval_95};
use mapper_numerics::parallel;
use mapper_numerics::statistics::median;
use nalgebra::{DMatrix, DVector};

/// Step of the derivative of h by a declared error, in its standard deviations. Bound: the law is nearly linear over it.
const STEP_SIGMAS: f64 = 0.1;

/// The numbers of all points.
#[derive(Debug, Clone)]
pub(crate) struct Numbers {
    pub(crate) eta: Vec<Number>,
    /// ln of h at the step's end, relative to the fitted value.
    pub(crate) ln_h: Vec<Number>,
    /// Effect of each common error of the points on every point's efficiency, and on its ln h.
    pub(crate) common: [Vec<Vec<f64>>; 2],
    /// Sources of the uncertainty of each point's efficiency and of its ln h.
    pub(crate) budgets: Vec<[Vec<BudgetRow>; 2]>,
}

impl Numbers {
    /// Evaluates a problem at its minimum. `refined`: the parameters that may be neutral.
    pub(crate) fn of(
        problem: &Problem<'_>,
        covariance: &Covariance,
        refined: Option<(&Refinements, &Gain)>,
        steps: &[StepRows],
    ) -> Self {
        let (etas, ln_hs) = quantities(problem, covariance, steps);
        let sources = budget::Sources { problem, covariance, refined };
        let rows = |quantities: &[Quantity]| -> Vec<(Number, Vec<BudgetRow>)> {
            let places: Vec<usize> = (0..quantities.len()).collect();
            parallel::map(&places, |i| {
                let quantity = &quantities[*i];
                let number = number(quantity, covariance, refined, sources.bias_variance(quantity));
                let freedom = steps[*i].rows.len().saturating_sub(LOCAL).max(1) as f64;
                let rows = sources.rows(quantity, freedom, &number);
                (number, rows)
            })
        };
        let (eta, eta_rows): (Vec<_>, Vec<_>) = rows(&etas).into_iter().unzip();
        let (ln_h, ln_h_rows): (Vec<_>, Vec<_>) = rows(&ln_hs).into_iter().unzip();
        let common = [(&etas, &eta), (&ln_hs, &ln_h)].map(|(quantities, numbers)| {
            let together = together(quantities, covariance);
            let own: Vec<f64> = quantities.iter().map(|quantity| quantity.own_variance).collect();
            let errors: Vec<f64> = numbers.iter().map(|one: &Number| one.error).collect();
            let mut changes = common_part(&together, &own, &errors);
            if refined.is_some() {
                changes.iter_mut().zip(numbers.iter()).for_each(|(changes, one)| changes.push(one.added));
            }
            changes
        });
        let budgets = eta_rows.into_iter().zip(ln_h_rows).map(|(eta, ln_h)| [eta, ln_h]).collect();
        Numbers { eta, ln_h, common, budgets }
    }

    /// Median standard error of the efficiencies, fraction; infinite without any.
    pub(crate) fn middle_error(&self) -> f64 {
        let errors = self.eta.iter().map(|number| number.uncertainty.combined_standard_error());
        median(errors).unwrap_or(f64::INFINITY)
    }
}

fn number(
    quantity: &Quantity,
    covariance: &Covariance,
    refined: Option<(&Refinements, &Gain)>,
    bias: f64,
) -> Number {
    let variance = quantity.variance(covariance).max(0.0);
    let value = quantity.value;
    let mixed =
        refined.and_then(|(refinements, gain)| refinements.interval(gain, &quantity.answer, value, variance));
    let error = variance.sqrt();
    let (interval, added) = mixed.unwrap_or_else(|| (confidence_interval_95(value, error), 0.0));
    let bias = bias.min(variance);
    let uncertainty = EstimateUncertainty {
        noise_standard_error: (variance + added * added - bias).max(0.0).sqrt(),
        bias_standard_error: bias.max(0.0).sqrt(),
    };
    Number { value, uncertainty, interval, error, added }
}

/// Efficiency and ln h of every step, relative to the fitted value.
pub(crate) fn quantities(
    problem: &Problem<'_>,
    covariance: &Covariance,
    steps: &[StepRows],
) -> (Vec<Quantity>, Vec<Quantity>) {
    let own = |step: usize, index: usize| {
        let (own, mixed) = &covariance.own[step];
        own[(index, index)] - mixed.row(index).dot(&covariance.sensitivities[step].row(index))
    };
    let count = problem.members.len();
    let etas = (0..count).map(|i| Quantity {
        value: problem.members[i].local[ETA],
        answer: covariance.sensitivities[i].row(ETA).transpose(),
        own_variance: own(i, ETA).max(0.0),
    });
    let ln_hs = (0..count).map(|i| {
        let local = &problem.members[i].local;
        let at = |shared: &[f64; SHARED]| problem.model.at_end(&steps[i].end, shared, local);
        let here = at(&problem.shared);
        let by = |index: &usize| match *index {
            LN_COEFFICIENT => 1.0,
            EXPONENT => here.ln_reynolds,
            LN_AREA => -1.0,
            // The law is evaluated at the readings, so an error of the flow is one of h.
            index if (OFFSETS..HOUSING).contains(&index) && problem.priors[index].sigma > 0.0 => {
                let step = STEP_SIGMAS * problem.priors[index].sigma;
                let mut moved = problem.shared;
                moved[index] += step;
                (at(&moved).h_w_m2k / here.h_w_m2k).ln() / step
            }
            _ => 0.0,
        };
        let direct = DVector::from_iterator(covariance.fitted.len(), covariance.fitted.iter().map(by));
        Quantity {
            value: 0.0,
            answer: direct + covariance.sensitivities[i].row(LN_DEVIATION).transpose(),
            own_variance: own(i, LN_DEVIATION).max(0.0),
        }
    });
    (etas.collect(), ln_hs.collect())
}

/// Covariance of a quantity over all steps.
pub(crate) fn together(quantities: &[Quantity], covariance: &Covariance) -> DMatrix<f64> {
    let answers: Vec<DVector<f64>> = quantities.iter().map(|quantity| quantity.answer.clone()).collect();
    if answers.is_empty() {
        return DMatrix::zeros(0, 0);
    }
    let answers = DMatrix::from_columns(&answers);
    let mut matrix = answers.tr_mul(&(&covariance.shared * &answers));
    for (i, quantity) in quantities.iter().enumerate() {
        // The noise of different steps is independent.
        matrix[(i, i)] += quantity.own_variance;
    }
    matrix
}
