//! The best fit of a hypothesis, nuisances and their priors included, and how well it is supported.
//!
//! Gauss-Newton on the whitened residuals. The derivatives of effects are taken by runs of the model in each iteration, because effects are
//! strong and nonlinear; known ones are corrected along each step. Those of nuisances are taken once, because nuisances are small. The residual
//! is always that of the model itself.

use crate::gap::best_fit::coordinate::{Coordinate, coordinates, parameters, set_parameter};
use crate::gap::best_fit::first_step::is_start;
use crate::gap::best_fit::normal::{PRIOR_STEPS, normal_matrix, nuisance_products};
use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::residuals::hypothesis::Course;
use crate::gap::residuals::nuisance::NuisanceKind;
use crate::gap::residuals::study::{Hypothesis, PredictError, Prediction, Study};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_inference::descent::{End, Model, Normal, Reach, Until, descend, room_within};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

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
    /// What one more iteration promised in the cost: much where the nuisances act otherwise here than where they were linearised.
    pub promised: f64,
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
    /// Maximum number of sigmas of a tolerance of the rig; those of initial state, clocks and the shape of the map do not count.
    pub most_sigmas_of_rig: f64,
}

impl Effort {
    /// Maximum number of sigmas that a nuisance may move.
    pub fn most_sigmas_of(&self, kind: NuisanceKind) -> f64 {
        if is_of_rig(kind) { self.most_sigmas.min(self.most_sigmas_of_rig) } else { self.most_sigmas }
    }
}

impl Default for Effort {
    fn default() -> Self {
        let Until { iterations, enough } = Until::default();
        Effort { iterations, enough, most_sigmas: MAX_SIGMAS, most_sigmas_of_rig: MAX_SIGMAS }
    }
}

/// Start of a fit.
#[derive(Debug, Clone)]
pub struct Start {
    /// Nuisances and effects.
    pub hypothesis: Hypothesis,
    /// Their prediction; `None` if the model has not been run there.
    pub prediction: Option<Arc<Prediction>>,
    /// Change for a unit of each effect's search coordinate, which steps correct; empty if each iteration takes it by runs.
    pub columns: Vec<Column>,
}

/// Whitened change for a unit of an effect's search coordinate. Many starts share one, because a search offers thousands of them.
#[derive(Debug, Clone)]
pub struct Column {
    /// Change for this many units, of the effect throughout.
    pub change: Arc<Vec<f64>>,
    /// Units of that change.
    pub units: f64,
    /// The effect's share in each step.
    pub course: Course,
}

impl Column {
    fn values(&self, study: &Study) -> Vec<f64> {
        let mut values: Vec<f64> = self.change.iter().map(|change| change / self.units).collect();
        if self.course != Course::Throughout {
            let steps = study.steps.len();
            for step in 0..steps {
                let share = self.course.share(step, steps);
                values[rows_of_step(study, step)].iter_mut().for_each(|value| *value *= share);
            }
        }
        values
    }

    /// Those of a fit.
    pub fn of(fit: &Fit) -> Vec<Column> {
        let whole = |column: &Vec<f64>| Column {
            change: Arc::new(column.clone()),
            units: 1.0,
            course: Course::Throughout,
        };
        fit.effect_columns.iter().map(whole).collect()
    }
}

impl From<&Fit> for Start {
    fn from(fit: &Fit) -> Start {
        Start {
            hypothesis: fit.hypothesis.clone(),
            prediction: Some(Arc::new(fit.prediction.clone())),
            columns: Column::of(fit),
        }
    }
}

/// Fits nuisances and effects, starting at a hypothesis.
///
/// # Errors
/// [`PredictError`] if the model cannot follow at the start itself.
pub fn fit(
    study: &Study,
    linearised: &Linearised,
    start: &Hypothesis,
    selection: &Selection,
    effort: Effort,
) -> Result<Fit, PredictError> {
    let start = Start { hypothesis: start.clone(), prediction: None, columns: Vec::new() };
    fit_from(study, linearised, &start, selection, effort)
}

/// Fits nuisances and effects with everything that is known of the start.
///
/// # Errors
/// As [`fit`].
pub fn fit_from(
    study: &Study,
    linearised: &Linearised,
    start: &Start,
    selection: &Selection,
    effort: Effort,
) -> Result<Fit, PredictError> {
    let Start { hypothesis: start, prediction, columns } = start;
    let coordinates = coordinates(&study.effects, start);
    let at = coordinates.iter().zip(parameters(start)).map(|(coordinate, value)| coordinate.of(value));
    let unknowns = DVector::from_iterator(
        start.nuisances.len() + coordinates.len(),
        start.nuisances.iter().copied().chain(at),
    );
    let mut fitted = Fitted {
        study,
        linearised,
        start,
        rows: selection.rows(study),
        nuisance_products: nuisance_products(study, linearised, selection),
        coordinates,
        most_sigmas: study.nuisances.iter().map(|nuisance| effort.most_sigmas_of(nuisance.kind)).collect(),
        columns_known: !columns.is_empty(),
        effect_columns: columns.iter().map(|column| column.values(study)).collect(),
        last: None,
    };
    let until = Until { iterations: effort.iterations, enough: effort.enough };
    let point = match prediction {
        Some(prediction) => fitted.at_prediction(start.clone(), Prediction::clone(prediction)),
        None => fitted.at_hypothesis(start.clone())?,
    };
    let End { unknowns, point, normal, promised } = descend(&mut fitted, unknowns, point, until);
    let Point { hypothesis, prediction, residual } = point;
    let cost = cost_of(&fitted.rows, &residual, &hypothesis);
    let nuisances = hypothesis.nuisances.len();
    let effects = unknowns.len() - nuisances;
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
        promised,
    })
}

/// A hypothesis' nuisances, in sigmas, and behind them its effects' coordinates, as unknowns.
struct Fitted<'a> {
    study: &'a Study,
    linearised: &'a Linearised,
    start: &'a Hypothesis,
    rows: Vec<Range<usize>>,
    nuisance_products: DMatrix<f64>,
    coordinates: Vec<Coordinate>,
    /// Maximum number of sigmas of each nuisance.
    most_sigmas: Vec<f64>,
    /// Whitened changes for a unit of each effect's coordinate.
    effect_columns: Vec<Vec<f64>>,
    /// Whether they were known at the start, and are only corrected since.
    columns_known: bool,
    /// Unknowns and residual of the last point.
    last: Option<(DVector<f64>, Vec<f64>)>,
}

struct Point {
    hypothesis: Hypothesis,
    prediction: Prediction,
    residual: Vec<f64>,
}

impl Fitted<'_> {
    fn at_hypothesis(&self, hypothesis: Hypothesis) -> Result<Point, PredictError> {
        let prediction = self.study.predict(&hypothesis)?;
        Ok(self.at_prediction(hypothesis, prediction))
    }

    fn at_prediction(&self, hypothesis: Hypothesis, prediction: Prediction) -> Point {
        let residual = self.linearised.residual(self.study, &prediction);
        Point { hypothesis, prediction, residual }
    }

    /// Corrects the effects' columns along the last step, so that they give the residual that it led to (Broyden 1965). The nuisances'
    /// columns stay.
    fn correct_columns(&mut self, unknowns: &DVector<f64>, residual: &[f64]) {
        let Some((before, residual_before)) = &self.last else { return };
        let step = unknowns - before;
        let nuisances = self.linearised.columns.len();
        let moved = step.rows(nuisances, step.len() - nuisances).norm_squared();
        let by_nuisances = SHORT * SHORT * (1.0 + step.rows(0, nuisances).norm_squared());
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

/// Step of an effect's coordinate that is as nonlinear as a nuisance's of one sigma: after a short one, most of the change that a line does not
/// predict is due to the nuisances. Judgement: typical steps are some ten tolerances.
const SHORT: f64 = 0.1;

impl Model for Fitted<'_> {
    type Point = Point;

    fn at(&self, unknowns: &DVector<f64>) -> Option<Point> {
        let mut hypothesis = self.start.clone();
        for ((nuisance, sigmas), most) in
            hypothesis.nuisances.iter_mut().zip(unknowns.iter()).zip(&self.most_sigmas)
        {
            *nuisance = sigmas.clamp(-most, *most);
        }
        let n = hypothesis.nuisances.len();
        for (place, coordinate) in self.coordinates.iter().enumerate() {
            set_parameter(&mut hypothesis, place, coordinate.value(unknowns[n + place]));
        }
        self.at_hypothesis(hypothesis).ok()
    }

    fn cost(&self, _: &DVector<f64>, point: &Point) -> f64 {
        cost_of(&self.rows, &point.residual, &point.hypothesis)
    }

    fn normal(&mut self, unknowns: &DVector<f64>, point: &Point, reach: Reach) -> Normal {
        let Point { hypothesis, prediction, residual } = point;
        // Near surge the cost has small steps: a slope taken over more of the way sees past them.
        if reach == Reach::Coarse || !self.columns_known {
            let Fitted { study, linearised, coordinates, .. } = self;
            let mut columns = changes_near(study, hypothesis, prediction, coordinates, reach.distance());
            columns.iter_mut().for_each(|column| linearised.whiten(study, column));
            self.effect_columns = columns;
        } else {
            self.correct_columns(unknowns, residual);
        }
        self.last = Some((unknowns.clone(), residual.clone()));
        let Fitted { linearised, rows, effect_columns, .. } = self;
        let matrix = normal_matrix(rows, linearised, &self.nuisance_products, effect_columns);
        let ask = |column: &Vec<f64>| dot_over(rows, column, residual);
        let pulled = linearised.columns.iter().zip(&hypothesis.nuisances).map(|(c, sigmas)| ask(c) - sigmas);
        let pull = DVector::from_iterator(matrix.nrows(), pulled.chain(effect_columns.iter().map(ask)));
        Normal { matrix, pull }
    }

    fn room(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let n = unknowns.len() - self.coordinates.len();
        let of_nuisances =
            unknowns.iter().take(n).zip(&self.most_sigmas).map(|(u, most)| (-most - u, most - u));
        let of_effects = self.coordinates.iter().zip(unknowns.iter().skip(n)).map(|(coordinate, at)| {
            let (low, high) = coordinate.ends();
            room_within(low, high, *at)
        });
        of_nuisances.chain(of_effects).collect()
    }
}

fn cost_of(rows: &[std::ops::Range<usize>], residual: &[f64], hypothesis: &Hypothesis) -> f64 {
    let cost = dot_over(rows, residual, residual) + hypothesis.nuisances.iter().map(|u| u * u).sum::<f64>();
    if cost.is_finite() { cost } else { f64::INFINITY }
}

/// Whitened change for a unit of each effect's coordinate, by runs of the model next to the hypothesis.
pub fn effect_changes(
    study: &Study,
    linearised: &Linearised,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
) -> Vec<Vec<f64>> {
    let mut changes = changes_near(study, hypothesis, here, coordinates, Reach::Fine.distance());
    changes.iter_mut().for_each(|change| linearised.whiten(study, change));
    changes
}

/// Change for a unit of each effect's coordinate, from runs at `distance` from the hypothesis, in the coordinate's unit.
pub(crate) fn changes_near(
    study: &Study,
    hypothesis: &Hypothesis,
    here: &Prediction,
    coordinates: &[Coordinate],
    distance: f64,
) -> Vec<Vec<f64>> {
    let values = parameters(hypothesis);
    coordinates
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(place, (coordinate, value))| {
            let (next, step) = coordinate.next_to(*value, distance);
            let mut moved = hypothesis.clone();
            set_parameter(&mut moved, place, next);
            match study.predict_near(&moved, here) {
                Ok(there) if step != 0.0 => {
                    there.values.iter().zip(&here.values).map(|(t, h)| (t - h) / step).collect()
                }
                _ => vec![0.0; here.values.len()],
            }
        })
        .collect()
}

/// Whether a nuisance is a tolerance of the rig: initial metal state and clock errors are none, and a deviation of one corner of the map
/// is plausible.
pub fn is_of_rig(kind: NuisanceKind) -> bool {
    !matches!(kind, NuisanceKind::Delay(_) | NuisanceKind::Shape(_)) && !is_start(kind)
}

/// Limit of a nuisance in declared sigmas: a larger deviation does not count as a tolerance.
pub const MAX_SIGMAS: f64 = 6.0;
