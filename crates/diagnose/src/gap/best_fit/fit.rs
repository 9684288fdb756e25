//! Fits of effects and errors, and whether they explain the recording.
//!
//! Gauss-Newton on the whitened residuals, with Laplace's approximation of the evidence. Effects are strong and nonlinear, so each iteration computes
//! their derivatives by model runs, or corrects known ones along its step. Nuisances are small, so their derivatives are computed once. The residual is
//! always that of the model itself.

use crate::gap::best_fit::coordinate::{Coordinate, coordinates, effect_neighbours, hypothesis_at, unknowns};
use crate::gap::best_fit::normal::{PRIOR_STEPS, Selection, dot_over, normal_matrix, nuisance_products};
use crate::gap::residuals::nuisance::{NuisanceKind, RESPONSES_S};
use crate::gap::residuals::study::{EffectValues, Hypothesis, PredictError, Prediction, Study};
use crate::gap::residuals::true_inputs::LinearisedMachine;
use crate::gap::residuals::whiten::{Linearised, dot, rows_of_step};
use mapper_inference::hypotheses::TimeHistory;
use mapper_numerics::least_squares::{DifferenceStep, End, FINE, Model, Normal, Until, descend};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

#[derive(Debug, Clone)]
pub(crate) struct Fit {
    /// Best values of nuisances and effects.
    pub hypothesis: Hypothesis,
    /// Sum of the squared whitened residuals and the squared nuisances.
    pub cost: f64,
    /// Logarithm of the evidence, up to a constant that all hypotheses share.
    pub score: f64,
    /// Whitened residuals.
    pub residual: Vec<f64>,
    pub prediction: Prediction,
    /// Whitened change for a unit of each effect's search coordinate.
    pub effect_columns: Vec<Vec<f64>>,
    /// Covariance of the effects' search coordinates, nuisances free.
    pub covariance: DMatrix<f64>,
    /// Precision of nuisances and the effects' search coordinates, priors included.
    pub precision: DMatrix<f64>,
    /// Predicted decrease of the cost by one more iteration; large if the nuisances' derivatives differ from where they were linearised.
    pub predicted_decrease: f64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Maximum number of iterations.
    pub iterations: usize,
    /// Minimum predicted decrease of the cost for another iteration.
    pub enough: f64,
    /// Maximum size of a nuisance, in sigmas. Small while an effect is far from its best value, so that tolerances do not imitate it.
    pub max_sigmas: f64,
    /// The same of a tolerance of the rig; initial state, clocks and the shape of the map are none.
    pub max_sigmas_of_rig: f64,
    /// Whether each point is a run of its own; else it follows from the run of the linearisation: for fits that only select.
    pub exact: bool,
}

impl Effort {
    pub(crate) fn max_sigmas_of(&self, kind: NuisanceKind) -> f64 {
        if kind.is_of_rig() { self.max_sigmas.min(self.max_sigmas_of_rig) } else { self.max_sigmas }
    }
}

impl Default for Effort {
    fn default() -> Self {
        let Until { iterations, enough } = Until::default();
        Effort { iterations, enough, max_sigmas: MAX_SIGMAS, max_sigmas_of_rig: MAX_SIGMAS, exact: true }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// Nuisances and effects.
    pub hypothesis: Hypothesis,
    /// Their prediction; `None` if the model has not been run there.
    pub prediction: Option<Arc<Prediction>>,
    /// Change for a unit of each effect's search coordinate; empty if each iteration computes it by model runs.
    pub columns: Vec<Column>,
}

/// Whitened change due to an effect. The thousands of starts of a search share changes.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    /// Whitened change if the effect acts throughout.
    pub change: Arc<Vec<f64>>,
    /// Change of the effect's search coordinate that causes it.
    pub units: f64,
    /// When the effect acts.
    pub history: TimeHistory,
}

impl Column {
    /// Whitened change for a unit of the coordinate.
    fn values(&self, study: &Study) -> Vec<f64> {
        let mut values: Vec<f64> = self.change.iter().map(|change| change / self.units).collect();
        if self.history != TimeHistory::THROUGHOUT {
            for step in 0..study.steps.len() {
                let share = self.history.at(step as f64);
                values[rows_of_step(study, step)].iter_mut().for_each(|value| *value *= share);
            }
        }
        values
    }

    pub(crate) fn of(fit: &Fit) -> Vec<Column> {
        let of_unit = |column: &Vec<f64>| {
            let change = Arc::new(column.clone());
            Column { change, units: 1.0, history: TimeHistory::THROUGHOUT }
        };
        fit.effect_columns.iter().map(of_unit).collect()
    }
}

impl From<&Hypothesis> for Start {
    fn from(hypothesis: &Hypothesis) -> Start {
        Start { hypothesis: hypothesis.clone(), prediction: None, columns: Vec::new() }
    }
}

impl From<&Fit> for Start {
    fn from(fit: &Fit) -> Start {
        Start {
            hypothesis: fit.hypothesis.clone(),
            prediction: fit.prediction.run.is_exact.then(|| Arc::new(fit.prediction.clone())),
            columns: Column::of(fit),
        }
    }
}

/// Fits nuisances and effects from a start: a hypothesis, or another fit.
pub(crate) fn fit(
    study: &Study,
    linearised: &Linearised,
    start: impl Into<Start>,
    selection: &Selection,
    effort: Effort,
) -> Result<Fit, PredictError> {
    let Start { hypothesis: start, prediction, columns } = start.into();
    let coordinates = coordinates(&study.effects, &start);
    let unknowns = unknowns(&start, &coordinates);
    let mut fitted = Objective {
        study,
        linearised,
        start: &start,
        rows: selection.rows(study),
        nuisance_products: nuisance_products(study, linearised, selection),
        coordinates,
        max_sigmas: study.nuisances.iter().map(|nuisance| effort.max_sigmas_of(nuisance.kind)).collect(),
        exact: effort.exact,
        columns_known: !columns.is_empty(),
        effect_columns: columns.iter().map(|column| column.values(study)).collect(),
        last: None,
    };
    let until = Until { iterations: effort.iterations, enough: effort.enough };
    let point = match prediction {
        Some(prediction) => fitted.at_prediction(start.clone(), Arc::unwrap_or_clone(prediction)),
        None => fitted.at_hypothesis(start.clone())?,
    };
    let End { unknowns, point, normal, predicted_decrease } = descend(&mut fitted, unknowns, point, until);
    let Point { hypothesis, prediction, residual } = point;
    let cost = cost_of(&fitted.rows, &residual, &hypothesis);
    let nuisances = hypothesis.nuisances.len();
    let effects = unknowns.len() - nuisances;
    // Evidence of one parameter: its prior density times the width of its posterior.
    let each = 0.5 * (2.0 * std::f64::consts::PI).ln() - PRIOR_STEPS.ln();
    let score = normal
        .half_ln_determinant()
        .map_or(f64::NEG_INFINITY, |half| -0.5 * cost - half + effects as f64 * each);
    let unknown = || DMatrix::from_element(effects, effects, f64::INFINITY);
    Ok(Fit {
        hypothesis,
        cost,
        score,
        residual,
        prediction,
        effect_columns: fitted.effect_columns,
        covariance: normal.covariance_from(nuisances).unwrap_or_else(unknown),
        precision: normal.matrix,
        predicted_decrease,
    })
}

/// The cost of a hypothesis, as a function of its nuisances and the coordinates of its effects.
struct Objective<'a> {
    study: &'a Study,
    linearised: &'a Linearised,
    start: &'a Hypothesis,
    rows: Vec<Range<usize>>,
    nuisance_products: DMatrix<f64>,
    coordinates: Vec<Coordinate>,
    /// Maximum size of each nuisance, in sigmas.
    max_sigmas: Vec<f64>,
    exact: bool,
    /// Whitened changes for a unit of each effect's coordinate.
    effect_columns: Vec<Vec<f64>>,
    /// Whether they were known at the start, so that steps only correct them.
    columns_known: bool,
    /// Unknowns and residual of the last point.
    last: Option<(DVector<f64>, Vec<f64>)>,
}

struct Point {
    hypothesis: Hypothesis,
    prediction: Prediction,
    residual: Vec<f64>,
}

impl Objective<'_> {
    fn at_hypothesis(&self, hypothesis: Hypothesis) -> Result<Point, PredictError> {
        let prediction = match self.exact {
            true => self.study.predict(&hypothesis)?,
            false => self.study.predict_linearly(&hypothesis, &self.linearised.machine)?,
        };
        Ok(self.at_prediction(hypothesis, prediction))
    }

    fn at_prediction(&self, hypothesis: Hypothesis, prediction: Prediction) -> Point {
        let residual = self.linearised.residual(self.study, &prediction);
        Point { hypothesis, prediction, residual }
    }

    /// Corrects the effects' columns along the last step, so that they predict the residual after it (Broyden 1965). The nuisances' columns stay.
    fn correct_columns(&mut self, unknowns: &DVector<f64>, residual: &[f64]) {
        let Some((before, residual_before)) = &self.last else { return };
        let step = unknowns - before;
        let nuisances = self.linearised.columns.len();
        let moved = step.rows(nuisances, step.len() - nuisances).norm_squared();
        let by_nuisances = EQUIVALENT_STEP * EQUIVALENT_STEP * (1.0 + step.rows(0, nuisances).norm_squared());
        let columns = self.linearised.columns.iter().chain(&self.effect_columns);
        let mut missing: Vec<f64> = residual_before.iter().zip(residual).map(|(b, r)| b - r).collect();
        for (column, by) in columns.zip(step.iter()).filter(|(_, by)| **by != 0.0) {
            missing.iter_mut().zip(column).for_each(|(m, c)| *m -= by * c);
        }
        for (column, by) in self.effect_columns.iter_mut().zip(step.iter().skip(nuisances)) {
            let share = by / (moved + by_nuisances);
            column.iter_mut().zip(&missing).for_each(|(c, m)| *c += share * m);
        }
    }
}

/// Step of an effect's coordinate that is as nonlinear as one sigma of a nuisance: after a shorter step, most of the unpredicted change is due to the
/// nuisances. Bound: typical steps are some ten tolerances.
const EQUIVALENT_STEP: f64 = 0.1;

impl Model for Objective<'_> {
    type Point = Point;

    fn at(&self, unknowns: &DVector<f64>) -> Option<Point> {
        let mut hypothesis = hypothesis_at(self.start, &self.coordinates, unknowns);
        for (sigmas, max) in hypothesis.nuisances.iter_mut().zip(&self.max_sigmas) {
            *sigmas = sigmas.clamp(-max, *max);
        }
        self.at_hypothesis(hypothesis).ok()
    }

    fn cost(&self, _: &DVector<f64>, point: &Point) -> f64 {
        cost_of(&self.rows, &point.residual, &point.hypothesis)
    }

    fn normal(&mut self, unknowns: &DVector<f64>, point: &Point, reach: DifferenceStep) -> Normal {
        let Point { hypothesis, prediction, residual } = point;
        // Slopes are known to within the distance of their differences. Near surge the cost has small steps, which a longer difference averages.
        let is_near = |(before, _): &(DVector<f64>, Vec<f64>)| {
            let step = unknowns - before;
            step.iter().skip(hypothesis.nuisances.len()).all(|by| by.abs() < FINE)
        };
        let known = self.columns_known || self.last.as_ref().is_some_and(is_near);
        if reach == DifferenceStep::Coarse || !known {
            let Objective { study, linearised, coordinates, .. } = self;
            let distance = reach.distance();
            self.effect_columns =
                effect_changes(study, linearised, hypothesis, prediction, coordinates, distance);
        } else {
            self.correct_columns(unknowns, residual);
        }
        self.last = Some((unknowns.clone(), residual.clone()));
        let Objective { linearised, rows, effect_columns, .. } = self;
        let matrix = normal_matrix(rows, linearised, &self.nuisance_products, effect_columns);
        let ask = |column: &Vec<f64>| dot_over(rows, column, residual);
        let pulled = linearised.columns.iter().zip(&hypothesis.nuisances).map(|(c, sigmas)| ask(c) - sigmas);
        let gradient = DVector::from_iterator(matrix.nrows(), pulled.chain(effect_columns.iter().map(ask)));
        Normal { matrix, gradient }
    }

    fn step_bounds(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let n = unknowns.len() - self.coordinates.len();
        let nuisances = unknowns.iter().take(n).zip(&self.max_sigmas);
        let of_nuisances = nuisances.map(|(u, max)| (-max - u, max - u));
        let of_effects = self.coordinates.iter().zip(unknowns.iter().skip(n));
        of_nuisances.chain(of_effects.map(|(coordinate, at)| coordinate.step_bounds(*at))).collect()
    }
}

fn cost_of(rows: &[Range<usize>], residual: &[f64], hypothesis: &Hypothesis) -> f64 {
    let cost = dot_over(rows, residual, residual) + hypothesis.nuisances.iter().map(|u| u * u).sum::<f64>();
    if cost.is_finite() { cost } else { f64::INFINITY }
}

/// Whitened change for a unit of each effect's coordinate, from model runs at `distance` from the hypothesis, in the coordinate's unit.
pub(crate) fn effect_changes(
    study: &Study,
    linearised: &Linearised,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
    distance: f64,
) -> Vec<Vec<f64>> {
    let mut changes = changes_near(study, &linearised.machine, hypothesis, here, coordinates, distance);
    changes.iter_mut().for_each(|change| linearised.whiten(study, change));
    changes
}

/// The same, not whitened. A prediction that follows from `machine` is compared with others that do.
pub(crate) fn changes_near(
    study: &Study,
    machine: &LinearisedMachine,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
    distance: f64,
) -> Vec<Vec<f64>> {
    let predict = |moved: &Hypothesis| match here.run.is_exact {
        true => study.predict_near(moved, here),
        false => study.predict_linearly(moved, machine),
    };
    effect_neighbours(hypothesis, coordinates, distance)
        .map(|(moved, step)| match predict(&moved) {
            Ok(there) if step != 0.0 => {
                there.values.iter().zip(&here.values).map(|(t, h)| (t - h) / step).collect()
            }
            _ => vec![0.0; here.values.len()],
        })
        .collect()
}

/// Maximum size of a nuisance, in declared sigmas. Bound: a larger deviation is not a tolerance.
pub(crate) const MAX_SIGMAS: f64 = 6.0;

/// Refits only the initial state to the first step, whose unknown start would count as a misfit; unchanged if its misfit does not fall.
pub(crate) fn with_start_read(study: &Study, linearised: &Linearised, fit: Fit) -> Fit {
    let rows = [rows_of_step(study, 0)];
    let starts: Vec<usize> =
        study.nuisances.iter().enumerate().filter(|(_, n)| n.kind.is_start()).map(|(i, _)| i).collect();
    let column = |place: usize| &linearised.columns[starts[place]];
    let n = starts.len();
    let matrix =
        DMatrix::from_fn(n, n, |i, j| dot_over(&rows, column(i), column(j)) + if i == j { 1.0 } else { 0.0 });
    let right = DVector::from_fn(n, |i, _| {
        dot_over(&rows, column(i), &fit.residual) - fit.hypothesis.nuisances[starts[i]]
    });
    let Some(step) = matrix.cholesky().map(|cholesky| cholesky.solve(&right)) else { return fit };
    let mut moved = fit.hypothesis.clone();
    for (index, by) in starts.iter().zip(step.iter()) {
        moved.nuisances[*index] = (moved.nuisances[*index] + by).clamp(-MAX_SIGMAS, MAX_SIGMAS);
    }
    let Ok(prediction) = study.predict(&moved) else { return fit };
    let residual = linearised.residual(study, &prediction);
    if dot_over(&rows, &residual, &residual) >= dot_over(&rows, &fit.residual, &fit.residual) {
        return fit;
    }
    Fit { hypothesis: moved, prediction, residual, ..fit }
}

/// Effort of a fit of tolerances that imitate an effect. It runs the model, because they follow the nonlinearity of the effect. Bound: effort; the
/// declared size already penalises tolerances, so their limit is wide.
const IMITATION: Effort =
    Effort { iterations: 5, enough: 0.5, max_sigmas: 60.0, max_sigmas_of_rig: 60.0, exact: true };

/// Signature length of each of `effects` (indices into the study's effects, with values), given the others.
pub(crate) fn lengths(
    study: &Study,
    linearised: &Linearised,
    effects: &EffectValues,
) -> Result<Vec<f64>, PredictError> {
    let mut with = study.nothing();
    with.effects.clone_from(effects);
    let mut noise_free = study.clone();
    noise_free.measured = study.predict(&with)?.values;
    let everywhere = Selection::all(study);
    (0..effects.len())
        .map(|place| {
            let mut without = with.clone();
            without.effects.remove(place);
            Ok(fit(&noise_free, linearised, &without, &everywhere, IMITATION)?.cost.max(0.0).sqrt())
        })
        .collect()
}

/// Length of a direction that counts as none, in sigmas. Bound: rounding of the orthogonalisation.
const NO_LENGTH: f64 = 1e-6;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Adequacy {
    /// Energy in the smooth basis above its expectation, in its standard deviations.
    pub smooth_sigma: f64,
    /// Energy in the smooth basis above its expectation.
    pub smooth_excess: f64,
    /// Scatter of the effect's parameters from step to step above its expectation, in standard deviations; 0 without effects.
    pub scatter_sigma: f64,
}

impl Adequacy {
    pub(crate) fn features(&self) -> [f64; 2] {
        [self.smooth_sigma, self.scatter_sigma]
    }
}

pub(crate) fn smooth_energies(study: &Study, linearised: &Linearised, residual: &[f64]) -> Vec<f64> {
    study
        .groups
        .iter()
        .enumerate()
        .map(|(index, group)| {
            let here = &residual[group.rows.clone()];
            let mut directions: Vec<Vec<f64>> = Vec::new();
            for decay_s in RESPONSES_S.iter().take(here.len()) {
                let since_s = |block: &usize| study.steps[group.step].blocks[*block].since_jump_s;
                let mut direction: Vec<f64> =
                    group.blocks.iter().map(|block| (-since_s(block) / decay_s).exp()).collect();
                linearised.whiten_group(index, &mut direction);
                // Gram-Schmidt orthogonalisation.
                for before in &directions {
                    let along = dot(&direction, before);
                    for (d, b) in direction.iter_mut().zip(before) {
                        *d -= along * b;
                    }
                }
                let length = dot(&direction, &direction).sqrt();
                if length > NO_LENGTH {
                    directions.push(direction.into_iter().map(|d| d / length).collect());
                }
            }
            directions.iter().map(|direction| dot(direction, here).powi(2)).sum()
        })
        .collect()
}

pub(crate) fn adequacy(study: &Study, linearised: &Linearised, fit: &Fit) -> Adequacy {
    let energies = smooth_energies(study, linearised, &fit.residual);
    let expected: f64 = study.groups.iter().map(|group| RESPONSES_S.len().min(group.rows.len()) as f64).sum();
    let smooth_excess = energies.iter().sum::<f64>() - expected;
    let everywhere = Selection::all(study);
    let mut scatter_sigma: f64 = 0.0;
    for column in &fit.effect_columns {
        let (mut sum, mut count) = (0.0, 0.0);
        for rows in everywhere.rows(study) {
            let own = dot(&column[rows.clone()], &column[rows.clone()]);
            if own > 1.0 {
                sum += dot(&column[rows.clone()], &fit.residual[rows]).powi(2) / own;
                count += 1.0;
            }
        }
        if count > 1.0 {
            scatter_sigma = scatter_sigma.max((sum - count) / (2.0f64 * count).sqrt());
        }
    }
    let smooth_sigma = smooth_excess / (2.0 * expected.max(1.0)).sqrt();
    Adequacy { smooth_sigma, smooth_excess, scatter_sigma }
}

/// Misfit of each step: `(|r|^2 - n)/n`.
pub(crate) fn misfit_of_steps(study: &Study, residual: &[f64]) -> Vec<f64> {
    (0..study.steps.len())
        .map(|step| {
            let rows = rows_of_step(study, step);
            let n = rows.len().max(1) as f64;
            (dot(&residual[rows.clone()], &residual[rows]) - n) / n
        })
        .collect()
}
