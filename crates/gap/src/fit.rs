//! The best fit of a hypothesis, nuisances and their priors included, and how well it is supported.
//!
//! Gauss and Newton on the whitened residuals. What effects do is taken again from runs of the model in each iteration
//! (they are strong, and bend); what nuisances do is taken once, where nothing is off (they are small), but the
//! residual is always that of the model itself.

use crate::coordinate::{Coordinate, coordinates, parameters, set_parameter};
use crate::normal::{Normal, nuisance_products};
use crate::selection::{Selection, dot_over};
use crate::study::{Hypothesis, PredictError, Prediction, Study};
use crate::whiten::Linearised;
use nalgebra::{DMatrix, DVector};

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

/// How thoroughly to fit.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Maximum number of iterations.
    pub iterations: usize,
    /// Stop where an iteration promises less than this in the cost.
    pub enough: f64,
    /// Maximum number of sigmas that a nuisance may move: few while an effect is far from its best, so that tolerances do not run into
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

/// Six sigma of a declared tolerance is no longer a tolerance.
pub const MOST_SIGMAS: f64 = 6.0;
/// Maximum number of typical steps an effect moves in one iteration: effects bend.
const MOST_STEPS: f64 = 2.0;

/// The step to the minimum cost within all bounds: unknowns that would leave theirs are held there, and the others
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
