//! Uncertainty of the joint fit: covariances, budgets, and errors common to all points.

use crate::IdentifyConfig;
use crate::faults::balances::efficiency::{FittedEfficiencies, FittedQuantity};
use crate::faults::end_readings::CHANNELS;
use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::step_noise;
use crate::joint::step_model::parameters::{
    BAROMETER, ETA, EXPONENT, FLOW_GAIN, GAIN_CHANNELS, GAINS, HOUSING, HUMIDITY, INLET, LN_AREA,
    LN_COEFFICIENT, LN_DEVIATION, LOCAL, OFFSET_CHANNELS, OFFSETS, PREHEAT, PROBE_MM2, REFINEMENTS, SHARED,
    SURFACE, TC_LAG, THERMOMETERS, symbol,
};
use crate::joint::step_model::parts::Parts;
use crate::joint::step_model::rows::StepRows;
use crate::single_step::budgets;
use crate::single_step::dynamic::ReadingError;
use mapper_core::{BudgetRow, Channel, EstimateUncertainty, confidence_interval_95};
use mapper_inference::mixture::MIN_WEIGHT;
use mapper_numerics::parallel;
use mapper_numerics::statistics::median;
use nalgebra::{DMatrix, DVector};

/// A number as a function of the shared parameters.
pub(crate) struct Quantity {
    pub(crate) value: f64,
    /// Sensitivity to the shared parameters.
    pub(crate) answer: DVector<f64>,
    /// Variance with all shared parameters known.
    pub(crate) own_variance: f64,
}

impl Quantity {
    pub(crate) fn variance(&self, covariance: &Covariance) -> f64 {
        self.own_variance + self.answer.dot(&(&covariance.shared * &self.answer))
    }
}

/// A number with its error by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Number {
    pub(crate) value: f64,
    pub(crate) uncertainty: EstimateUncertainty,
    /// Its 95 % interval: symmetric about the value for a normal distribution, otherwise the shortest one.
    pub(crate) interval: (f64, f64),
    /// Standard error without the interval's excess over the mixture, and that excess, which all numbers share.
    pub(crate) error: f64,
    pub(crate) added: f64,
}

/// Change of each quantity per standard deviation of each common error: the common part of their errors, as a few independent ones.
///
/// `covariance` is that of the quantities, `own_variances` the part of its diagonal that no other quantity shares. The common remainder is
/// described by its leading eigenvectors (factor analysis by principal factors), scaled to the standard errors in `errors`.
pub(crate) fn common_part(covariance: &DMatrix<f64>, own_variances: &[f64], errors: &[f64]) -> Vec<Vec<f64>> {
    let count = errors.len();
    let none = vec![Vec::new(); count];
    let mut rest = covariance.clone();
    for (i, own) in own_variances.iter().enumerate() {
        rest[(i, i)] = (rest[(i, i)] - own.max(0.0)).max(0.0);
    }
    if count < 2 || !rest.iter().all(|x| x.is_finite()) {
        return none;
    }
    let trace = rest.trace();
    let eigen = rest.symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let leading = order.iter().filter(|k| eigen.eigenvalues[**k] > MIN_WEIGHT * trace);
    let mut changes = none;
    for k in leading {
        let vector = eigen.eigenvectors.column(*k);
        // The sign of an eigenvector is arbitrary: make its sum positive.
        let size = eigen.eigenvalues[*k].sqrt() * if vector.sum() < 0.0 { -1.0 } else { 1.0 };
        for (i, changes) in changes.iter_mut().enumerate() {
            changes.push(size * vector[i]);
        }
    }
    for (i, (changes, error)) in changes.iter_mut().zip(errors).enumerate() {
        let all = covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        let shared = changes.iter().map(|change| change * change).sum::<f64>().sqrt();
        // The common part must not exceed the whole.
        let scale = error / all.max(shared);
        changes.iter_mut().for_each(|change| *change *= scale);
    }
    changes
}

// Contributions of the sources of uncertainty to a number of the joint fit.
// A parameter that is off its prior mean by one standard deviation moves a number by its covariance with that parameter over that standard
// deviation: the posterior mean is off by `-S P^-1 (theta - mean)`, with posterior covariance S and prior precision P. So the contribution of a
// declared error is what the whole identification makes of a reading that is off by it. alpha_A, probe, heating/cooling ratio, preheating and the
// lag of Tc are correlated: each contributes the part that the previous ones do not explain (Cholesky factor of their mixture). The heat balance
// of the housing is one source, the step's own noise and the scatter of its h about the law another. The remainder is due to the shared law of h
// and the shape of the map, which the noise of all steps limits.

/// Names of the sources that are several parameters, or none.
const NOISE: &str = "noise of the step, scatter about the law of h";
const LAW: &str = "law of h and shape of the map";
const BALANCE: &str = "heat balance of the housing";
const DIVISION: &str = "housing of few parts";
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

    /// Change of a number by one standard deviation of each error of readings that a turbine point depends on as well.
    fn by_reading(&self, quantity: &Quantity) -> Vec<(ReadingError, f64)> {
        let of_reading = |(index, change)| Some((reading_error(index)?, change));
        self.by_prior(quantity).into_iter().filter_map(of_reading).collect()
    }

    /// Variance by the declared errors of the readings.
    pub(crate) fn bias_variance(&self, quantity: &Quantity) -> f64 {
        let errors = self.by_prior(quantity).into_iter().filter(|(index, _)| is_error(*index));
        errors.map(|(_, contribution)| contribution * contribution).sum()
    }

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

fn reading_error(index: usize) -> Option<ReadingError> {
    match index {
        BAROMETER => Some(ReadingError::Barometer),
        FLOW_GAIN => Some(ReadingError::Gain(Channel::CompressorFlow)),
        GAINS..BAROMETER => GAIN_CHANNELS.get(index - GAINS).copied().map(ReadingError::Gain),
        _ => OFFSET_CHANNELS.get(index.wrapping_sub(OFFSETS)).copied().map(ReadingError::Offset),
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

// The numbers of all points, efficiency and h, with their errors.
// A number depends on the step's own parameters and on the shared ones. The parameters of a step respond to the shared ones as the fit does, so
// that a number is a linear function of the shared parameters plus an error of the step alone.

/// Step of the derivative of h by a declared error, in its standard deviations. Bound: the law is nearly linear over it.
const STEP_SIGMAS: f64 = 0.1;

#[derive(Debug, Clone)]
pub(crate) struct Numbers {
    pub(crate) eta: Vec<Number>,
    /// ln of h at the step's end, relative to the fitted value.
    pub(crate) ln_h: Vec<Number>,
    /// Effect of each common error of the points on every point's efficiency, and on its ln h.
    pub(crate) common: [Vec<Vec<f64>>; 2],
    /// Sources of the uncertainty of each point's efficiency and of its ln h.
    pub(crate) budgets: Vec<[Vec<BudgetRow>; 2]>,
    /// Change of each point's efficiency by one standard deviation of the errors of readings.
    pub(crate) eta_errors: Vec<Vec<(ReadingError, f64)>>,
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
        let sources = Sources { problem, covariance, refined };
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
        let eta_errors = etas.iter().map(|quantity| sources.by_reading(quantity)).collect();
        Numbers { eta, ln_h, common, budgets, eta_errors }
    }

    /// With the error of a housing of few parts: of efficiency and ln h, on both sides of each interval.
    pub(crate) fn with_truncation(mut self, changes: &[[f64; 2]]) -> Self {
        let numbers = [&mut self.eta, &mut self.ln_h];
        for (k, (numbers, common)) in numbers.into_iter().zip(&mut self.common).enumerate() {
            for (i, (number, change)) in numbers.iter_mut().zip(changes).enumerate() {
                let size = change[k].abs();
                number.interval = (number.interval.0 - size, number.interval.1 + size);
                let bias = &mut number.uncertainty.bias_standard_error;
                *bias = bias.hypot(change[k]);
                common[i].push(change[k]);
                let row = budgets::row(DIVISION.to_owned(), size, OWN_UNIT, 1.0, change[k]);
                self.budgets[i][k].push(row);
            }
        }
        self
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

// The efficiencies that the steps show by T2 alone, for the search for faults of sensors.
// Neither the shape of the map nor the balance of the housing acts on them: the search has both as hypotheses of its own, and an error that one
// of them has removed no longer counts against a fault. Steps excluded from the shared parameters are left out.

/// Evaluates them on a problem at its minimum; `None` if they are not determined.
pub(crate) fn as_measured(
    problem: &Problem<'_>,
    steps: &[StepRows],
    truncation: Option<&[[f64; 2]]>,
    config: &IdentifyConfig,
) -> Option<FittedEfficiencies> {
    let problem = &t2_alone(problem, config)?;
    let covariance = &problem.considered()?;
    let (etas, ln_hs) = quantities(problem, covariance, steps);
    let kept: Vec<usize> = (0..etas.len()).filter(|i| problem.members[*i].contributes).collect();
    let ln_h = |i: &usize| {
        problem.model.at_end(&steps[*i].end, &problem.shared, &problem.members[*i].local).h_w_m2k.ln()
    };
    let fitted = |quantities: &[Quantity], which: usize, value: &dyn Fn(&usize) -> f64| {
        let (mut without, by_reading) = without_readings(covariance, quantities, &kept, steps);
        if let Some(changes) = truncation {
            let changes = DVector::from_iterator(kept.len(), kept.iter().map(|i| changes[*i][which]));
            without += &changes * changes.transpose();
        }
        FittedQuantity { values: kept.iter().map(value).collect(), covariance: without, by_reading }
    };
    Some(FittedEfficiencies {
        positions: kept.iter().map(|i| steps[*i].position).collect(),
        eta: fitted(&etas, 0, &|i| etas[*i].value),
        ln_h: fitted(&ln_hs, 1, &ln_h),
        has_one_wall: matches!(problem.model.parts, Parts::One | Parts::InnerWall),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Recovers two common errors and one individual error per quantity from their combined covariance.
    #[test]
    fn what_was_put_in_comes_out() {
        let [first, second] = [[1.0, 2.0, 3.0, 2.0, 1.0], [0.5, -0.5, 0.0, 0.5, -0.5]];
        let own: [f64; 5] = [0.1, 0.4, 0.2, 0.3, 0.1];
        let covariance = DMatrix::from_fn(5, 5, |i, j| {
            first[i] * first[j] + second[i] * second[j] + if i == j { own[i] } else { 0.0 }
        });
        let errors: Vec<f64> = (0..5).map(|i| covariance[(i, i)].sqrt()).collect();
        let found = common_part(&covariance, &own, &errors);
        for i in 0..5 {
            for j in 0..5 {
                let shared: f64 = found[i].iter().zip(&found[j]).map(|(a, b)| a * b).sum();
                let expected = covariance[(i, j)] - if i == j { own[i] } else { 0.0 };
                assert!((shared - expected).abs() < 1e-9, "{i} {j}: {shared} and {expected}");
            }
        }
    }
}
