//! The best fit of a hypothesis, nuisances and their priors included, and how well it is supported.
//!
//! Gauss and Newton on the whitened residuals. What effects do is taken anew from runs of the model in each iteration
//! (they are strong, and bend); what nuisances do is taken once, where nothing is off (they are small), but the
//! residual is always that of the model itself.

use crate::study::{Hypothesis, PredictError, Prediction, Study};
use crate::whiten::{Linearised, dot};
use mapper_physics::effect::EffectParameter;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A hypothesis at its best.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Nuisances and effects there.
    pub hypothesis: Hypothesis,
    /// Squared whitened residuals and squared nuisances.
    pub cost: f64,
    /// Logarithm of the evidence, up to what all hypotheses share (Laplace's approximation).
    pub score: f64,
    /// Whitened residuals.
    pub residual: Vec<f64>,
    /// Prediction.
    pub prediction: Prediction,
    /// Whitened change for a unit of each effect's search coordinate.
    pub effect_columns: Vec<Vec<f64>>,
    /// Covariance of the effects' search coordinates, nuisances free.
    pub covariance: DMatrix<f64>,
    /// Precision of nuisances and the effects' search coordinates, priors included.
    pub precision: DMatrix<f64>,
}

/// Prior width of an effect's parameter, in typical steps.
const PRIOR_STEPS: f64 = 10.0;

/// The coordinate in which a parameter is searched: itself in typical steps, or its logarithm where it spans decades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinate {
    low: f64,
    high: f64,
    scale: f64,
    logarithmic: bool,
}

impl Coordinate {
    /// The coordinate of a parameter.
    pub fn new(parameter: &EffectParameter) -> Self {
        let logarithmic = parameter.low > 0.0 && parameter.high / parameter.low > 20.0;
        let scale = if logarithmic { 1.0 } else { parameter.typical_step.abs().max(1e-12) };
        Coordinate { low: parameter.low, high: parameter.high, scale, logarithmic }
    }

    /// Coordinate of a value.
    pub fn of(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(1e-300).ln() } else { value / self.scale }
    }

    /// Value of a coordinate, within the parameter's range.
    pub fn value(&self, coordinate: f64) -> f64 {
        let value = if self.logarithmic { coordinate.exp() } else { coordinate * self.scale };
        value.clamp(self.low, self.high)
    }
}

/// Coordinates of all parameters of a hypothesis' effects, in order.
pub fn coordinates(study: &Study, hypothesis: &Hypothesis) -> Vec<Coordinate> {
    let parameters =
        hypothesis.effects.iter().flat_map(|(index, _)| study.effects[*index].info().parameters.iter());
    parameters.map(Coordinate::new).collect()
}

/// Moves the `place`-th parameter of all effects to a value.
pub fn set_parameter(hypothesis: &mut Hypothesis, place: usize, value: f64) {
    if let Some(slot) = hypothesis.effects.iter_mut().flat_map(|(_, values)| values.iter_mut()).nth(place) {
        *slot = value;
    }
}

/// Values of all effects' parameters, in order.
pub fn parameters(hypothesis: &Hypothesis) -> Vec<f64> {
    hypothesis.effects.iter().flat_map(|(_, values)| values.iter().copied()).collect()
}

/// Which rows count.
#[derive(Debug, Clone)]
pub struct Selection {
    /// For each step, whether it counts.
    pub steps: Vec<bool>,
}

impl Selection {
    /// All steps.
    pub fn all(study: &Study) -> Selection {
        Selection { steps: vec![true; study.steps.len()] }
    }

    /// Rows of the steps that count.
    pub fn rows(&self, study: &Study) -> Vec<std::ops::Range<usize>> {
        let counts = |step: &usize| self.steps.get(*step).copied().unwrap_or(false);
        (0..study.steps.len()).filter(counts).map(|step| crate::whiten::rows_of_step(study, step)).collect()
    }
}

/// Scalar product over some rows.
pub fn dot_over(rows: &[std::ops::Range<usize>], a: &[f64], b: &[f64]) -> f64 {
    rows.iter().map(|range| dot(&a[range.clone()], &b[range.clone()])).sum()
}

/// How thoroughly to fit.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Most iterations.
    pub iterations: usize,
    /// Stop where an iteration promises less than this in the cost.
    pub enough: f64,
    /// Most sigmas that a nuisance may move: few while an effect is far from its best, so that tolerances do not run into
    /// its place.
    pub most_sigmas: f64,
}

impl Default for Effort {
    fn default() -> Self {
        Effort { iterations: 10, enough: 0.02, most_sigmas: MOST_SIGMAS }
    }
}

/// Fits nuisances and effects from where `start` stands.
///
/// # Errors
/// [`PredictError`] where the model cannot follow at the start itself.
pub fn fit(
    study: &Study,
    linearised: &Linearised,
    start: &Hypothesis,
    selection: &Selection,
    effort: Effort,
) -> Result<Fit, PredictError> {
    let rows = selection.rows(study);
    let coordinates = coordinates(study, start);
    let nuisance_products = nuisance_products(study, linearised, selection);
    let mut hypothesis = start.clone();
    let mut prediction = study.predict(&hypothesis)?;
    let mut residual = linearised.residual(study, &prediction);
    let mut cost = cost_of(&rows, &residual, &hypothesis);
    let mut effect_columns = Vec::new();
    let mut normal = Normal::default();
    let mut beside = FINE;
    for iteration in 0..effort.iterations.max(1) {
        effect_columns = changes_beside(study, linearised, &hypothesis, &prediction, &coordinates, beside);
        normal = Normal::new(&rows, linearised, &nuisance_products, &effect_columns, &residual, &hypothesis);
        if iteration + 1 == effort.iterations.max(1) {
            break;
        }
        let Some((step, promised)) = bounded_step(&normal, &hypothesis, &coordinates, effort.most_sigmas)
        else {
            break;
        };
        if promised < effort.enough {
            break;
        }
        let mut accepted = false;
        let mut share = 1.0;
        for _ in 0..5 {
            let moved = moved(&hypothesis, &step, share, &coordinates, effort.most_sigmas);
            if let Ok(there) = study.predict(&moved) {
                let there_residual = linearised.residual(study, &there);
                let there_cost = cost_of(&rows, &there_residual, &moved);
                if there_cost < cost {
                    (hypothesis, prediction, residual, cost) = (moved, there, there_residual, there_cost);
                    accepted = true;
                    break;
                }
            }
            share *= 0.35;
        }
        if !accepted {
            // Near surge the cost has small steps: a slope taken over more of the way sees past them.
            if beside == COARSE {
                break;
            }
            beside = COARSE;
        }
    }
    let nuisances = hypothesis.nuisances.len();
    let (score, covariance) = normal.evidence(cost, nuisances);
    Ok(Fit {
        hypothesis,
        cost,
        score,
        residual,
        prediction,
        effect_columns,
        covariance,
        precision: normal.matrix,
    })
}

fn cost_of(rows: &[std::ops::Range<usize>], residual: &[f64], hypothesis: &Hypothesis) -> f64 {
    let cost = dot_over(rows, residual, residual) + hypothesis.nuisances.iter().map(|u| u * u).sum::<f64>();
    if cost.is_finite() { cost } else { f64::INFINITY }
}

/// Products of the nuisances' columns over the steps that count.
pub fn nuisance_products(study: &Study, linearised: &Linearised, selection: &Selection) -> DMatrix<f64> {
    let n = study.nuisances.len();
    let counted = linearised.products.iter().zip(&selection.steps).filter(|(_, counts)| **counts);
    counted.fold(DMatrix::zeros(n, n), |sum, (products, _)| sum + products)
}

/// Distance of the runs beside a hypothesis from which slopes are taken, in typical steps.
const FINE: f64 = 0.02;
const COARSE: f64 = 0.2;

/// Whitened change for a unit of each effect's coordinate, by runs of the model beside the hypothesis.
pub fn effect_changes(
    study: &Study,
    linearised: &Linearised,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
) -> Vec<Vec<f64>> {
    changes_beside(study, linearised, hypothesis, here, coordinates, FINE)
}

/// As [`effect_changes`], from runs `beside` the hypothesis in the coordinate's unit.
fn changes_beside(
    study: &Study,
    linearised: &Linearised,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
    beside: f64,
) -> Vec<Vec<f64>> {
    let values = parameters(hypothesis);
    coordinates
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(place, (coordinate, value))| {
            let at = coordinate.of(*value);
            // To the side where there is room.
            let tried = [at + beside, at - beside];
            let away = tried.into_iter().find(|x| (coordinate.of(coordinate.value(*x)) - x).abs() < 1e-9);
            let away = away.unwrap_or(at - beside);
            let mut moved = hypothesis.clone();
            set_parameter(&mut moved, place, coordinate.value(away));
            let step = coordinate.of(coordinate.value(away)) - at;
            let mut change: Vec<f64> = match study.predict(&moved) {
                Ok(there) if step != 0.0 => {
                    there.values.iter().zip(&here.values).map(|(t, h)| (t - h) / step).collect()
                }
                _ => vec![0.0; here.values.len()],
            };
            linearised.whiten(study, &mut change);
            change
        })
        .collect()
}

/// The normal equations of one iteration: nuisances first, effects behind them.
#[derive(Debug, Default)]
struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    fn new(
        rows: &[std::ops::Range<usize>],
        linearised: &Linearised,
        nuisance_products: &DMatrix<f64>,
        effect_columns: &[Vec<f64>],
        residual: &[f64],
        hypothesis: &Hypothesis,
    ) -> Normal {
        let (n, k) = (hypothesis.nuisances.len(), effect_columns.len());
        let mut matrix = DMatrix::zeros(n + k, n + k);
        let mut right = DVector::zeros(n + k);
        matrix.view_mut((0, 0), (n, n)).copy_from(nuisance_products);
        for i in 0..n {
            matrix[(i, i)] += 1.0;
            right[i] = dot_over(rows, &linearised.columns[i], residual) - hypothesis.nuisances[i];
        }
        for (j, column) in effect_columns.iter().enumerate() {
            for i in 0..n {
                let product = dot_over(rows, &linearised.columns[i], column);
                matrix[(i, n + j)] = product;
                matrix[(n + j, i)] = product;
            }
            for (l, other) in effect_columns.iter().enumerate().take(j + 1) {
                let product = dot_over(rows, other, column);
                matrix[(n + l, n + j)] = product;
                matrix[(n + j, n + l)] = product;
            }
            // Next to nothing: keeps the equations solvable where a parameter does nothing.
            matrix[(n + j, n + j)] += 1e-6;
            right[n + j] = dot_over(rows, column, residual);
        }
        Normal { matrix, right }
    }

    /// The step with some unknowns held to given steps, and what it promises in the cost.
    fn solve(&self, held: &[Option<f64>]) -> Option<(DVector<f64>, f64)> {
        let free: Vec<usize> = (0..held.len()).filter(|i| held[*i].is_none()).collect();
        let mut step = DVector::from_fn(held.len(), |i, _| held[i].unwrap_or(0.0));
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| self.matrix[(free[i], free[j])]);
        let pushed = &self.matrix * &step;
        let right = DVector::from_fn(free.len(), |i, _| self.right[free[i]] - pushed[free[i]]);
        let part = matrix.cholesky()?.solve(&right);
        for (place, index) in free.iter().enumerate() {
            step[*index] = part[place];
        }
        let promised = 2.0 * step.dot(&self.right) - step.dot(&(&self.matrix * &step));
        Some((step, promised))
    }

    /// Laplace's evidence, and the covariance of the effects' coordinates.
    fn evidence(&self, cost: f64, nuisances: usize) -> (f64, DMatrix<f64>) {
        let effects = self.matrix.nrows() - nuisances;
        let Some(cholesky) = self.matrix.clone().cholesky() else {
            return (f64::NEG_INFINITY, DMatrix::from_element(effects, effects, f64::INFINITY));
        };
        let half_ln_determinant = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let each = 0.5 * (2.0 * std::f64::consts::PI).ln() - PRIOR_STEPS.ln();
        let score = -0.5 * cost - half_ln_determinant + effects as f64 * each;
        (score, covariance_of_effects(&cholesky, nuisances))
    }
}

fn covariance_of_effects(cholesky: &Cholesky<f64, Dyn>, nuisances: usize) -> DMatrix<f64> {
    let inverse = cholesky.inverse();
    let effects = inverse.nrows() - nuisances;
    inverse.view((nuisances, nuisances), (effects, effects)).into_owned()
}

/// Six sigma of a declared tolerance is no tolerance any more.
pub const MOST_SIGMAS: f64 = 6.0;
/// Most typical steps an effect moves in one iteration: effects bend.
const MOST_STEPS: f64 = 2.0;

/// The step to the least cost within all bounds: unknowns that would leave theirs are held there, and the others
/// solved for again.
fn bounded_step(
    normal: &Normal,
    hypothesis: &Hypothesis,
    coordinates: &[Coordinate],
    most_sigmas: f64,
) -> Option<(DVector<f64>, f64)> {
    let values = parameters(hypothesis);
    // Room below and above.
    let mut room: Vec<(f64, f64)> =
        hypothesis.nuisances.iter().map(|u| (-most_sigmas - u, most_sigmas - u)).collect();
    room.extend(coordinates.iter().zip(&values).map(|(coordinate, value)| {
        let at = coordinate.of(*value);
        let ends = [coordinate.of(coordinate.low), coordinate.of(coordinate.high)];
        (
            (ends[0].min(ends[1]) - at).clamp(-MOST_STEPS, 0.0),
            (ends[0].max(ends[1]) - at).clamp(0.0, MOST_STEPS),
        )
    }));
    let mut held: Vec<Option<f64>> = vec![None; room.len()];
    for _ in 0..room.len() {
        let (step, promised) = normal.solve(&held)?;
        let outside = |i: usize| step[i] < room[i].0 - 1e-9 || step[i] > room[i].1 + 1e-9;
        let leaving: Vec<usize> = (0..room.len()).filter(|i| held[*i].is_none() && outside(*i)).collect();
        if leaving.is_empty() {
            return Some((step, promised));
        }
        for i in leaving {
            held[i] = Some(step[i].clamp(room[i].0.min(0.0), room[i].1.max(0.0)));
        }
    }
    None
}

fn moved(
    hypothesis: &Hypothesis,
    step: &DVector<f64>,
    share: f64,
    coordinates: &[Coordinate],
    most_sigmas: f64,
) -> Hypothesis {
    let n = hypothesis.nuisances.len();
    let mut moved = hypothesis.clone();
    for (i, nuisance) in moved.nuisances.iter_mut().enumerate() {
        *nuisance = (*nuisance + share * step[i]).clamp(-most_sigmas, most_sigmas);
    }
    for (j, (coordinate, value)) in coordinates.iter().zip(parameters(hypothesis)).enumerate() {
        set_parameter(&mut moved, j, coordinate.value(coordinate.of(value) + share * step[n + j]));
    }
    moved
}
