//! Fits a hypothesis to the rows that count, and computes its evidence (Laplace's approximation).
//!
//! Gauss-Newton on whitened residuals, as in [`crate::gap::best_fit::fit`]. The model error is fitted too, because it is not declared for a machine on an
//! engine.

use crate::driven::side::{ModelError, SideModel};
use crate::gap::best_fit::coordinate::{
    Coordinate, coordinates, effect_neighbours, hypothesis_at, infos, nuisance_neighbours, unknowns,
};
use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::PRIOR_STEPS;
use crate::gap::residuals::study::Hypothesis;
use mapper_numerics::coloured_noise::{BlockNoise, WhiteningFilter};
use mapper_numerics::least_squares::{
    DifferenceStep, End, FINE, Model, Normal, Until, descend, step_bounds_within,
};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::HINT_SIGMAS;
use mapper_physics::rig::effect::{Effect, Rig, add};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// One column per judged channel.
pub(crate) type Columns = Vec<Vec<f64>>;

pub(crate) struct SideProblem<'a, S> {
    pub(crate) side: &'a S,
    pub(crate) nominal: &'a Rig,
    pub(crate) effects: &'a [Arc<dyn Effect>],
    /// White noise of each judged channel, K: of its sensor, and of the drives through the model.
    pub(crate) white_k: Vec<f64>,
}

#[derive(Debug, Clone)]
pub(crate) struct SideFit {
    /// Unknowns in standard normal numbers, effects in their units.
    pub(crate) hypothesis: Hypothesis,
    /// Logarithm of the evidence.
    pub(crate) score: f64,
    /// The same with the prior of the model error for a cause outside the library.
    pub(crate) score_outside: f64,
    /// Model error in addition to the noise, one standard deviation for each judged channel, K.
    pub(crate) model_error_sigma_k: Vec<f64>,
    /// Predicted readings of all rows, K.
    pub(crate) predicted: Columns,
    /// Precision of unknowns and coordinates, priors included.
    pub(crate) precision: DMatrix<f64>,
}

/// Model error if the cause is outside the library, over that of the model. Judgement: an error that explains any reading of a log, without favouring a size.
const OUTSIDE_RATIO: f64 = 12.0;
/// Minimum noise of a reading, K. Bound: below the resolution of any log.
const MIN_NOISE_K: f64 = 1e-6;
/// Maximum logarithm of a model error over its median, in widths. Bound: no prior reaches as far.
const MAX_WIDTHS: f64 = 9.0;
/// Accuracy of that logarithm. Bound: far below its uncertainty.
const WIDTHS_ACCURACY: f64 = 1e-3;
/// Step of the second difference of the misfit, in widths. Bound: large compared with rounding, small compared with the curvature.
const CURVATURE_STEP: f64 = 0.1;
/// Minimum curvature of the misfit. Bound: its prior alone has a curvature of one.
const MIN_CURVATURE: f64 = 0.1;

/// Median, K, and width of the logarithm of a channel's model error: its prior.
type ErrorPrior = (f64, f64);

impl<S: SideModel> SideProblem<'_, S> {
    pub(crate) fn nothing(&self) -> Hypothesis {
        Hypothesis { nuisances: vec![0.0; S::UNKNOWNS.len()], effects: Vec::new() }
    }

    /// Prior of the effects' coordinates: mean and precision. It is no wider than a parameter's range.
    fn priors(&self, hypothesis: &Hypothesis) -> Vec<(f64, f64)> {
        infos(self.effects, hypothesis)
            .flat_map(|info| &info.parameters)
            .map(|parameter| {
                let coordinate = Coordinate::new(parameter);
                let (low, high) = coordinate.ends();
                // A uniform distribution over the range has this standard deviation.
                let width = PRIOR_STEPS.min((high - low) / 12f64.sqrt());
                (coordinate.of(parameter.neutral), width.powi(-2))
            })
            .collect()
    }

    /// Predicted readings; `None` if a value is out of its range or the model has no solution.
    pub(crate) fn predict(&self, hypothesis: &Hypothesis) -> Option<Columns> {
        let mut rig = self.nominal.clone();
        for (index, values) in &hypothesis.effects {
            add(&mut rig, self.effects[*index].as_ref(), values).ok()?;
        }
        let unknowns: Vec<f64> =
            S::UNKNOWNS.iter().zip(&hypothesis.nuisances).map(|(unknown, z)| unknown.at(*z)).collect();
        let predicted = self.side.predict(&rig, &unknowns);
        predicted.iter().flatten().all(|k| k.is_finite()).then_some(predicted)
    }

    /// Readings minus predictions; 0 where a channel was not measured.
    fn residual(&self, predicted: &Columns) -> Columns {
        let judged = &self.side.rows().judged;
        let of_channel = |((_, read), expected): (&(_, Vec<f64>), &Vec<f64>)| {
            read.iter().zip(expected).map(|(r, s)| if r.is_nan() { 0.0 } else { r - s }).collect()
        };
        judged.iter().zip(predicted).map(of_channel).collect()
    }

    pub(crate) fn whitenings(&self, counts: &[bool], model_error_sigma_k: &[f64]) -> Vec<WhiteningFilter> {
        model_error_sigma_k
            .iter()
            .enumerate()
            .map(|(channel, model_error_sigma_k)| self.whitening(counts, channel, *model_error_sigma_k))
            .collect()
    }

    fn whitening(&self, counts: &[bool], channel: usize, model_error_sigma_k: f64) -> WhiteningFilter {
        let rows = self.side.rows();
        let (_, read) = &rows.judged[channel];
        let noise = BlockNoise {
            white: self.white_k[channel].max(MIN_NOISE_K).powi(2),
            first_order: model_error_sigma_k.powi(2),
        };
        let used = read.iter().zip(counts).map(|(read, counts)| *counts && read.is_finite());
        let rows = rows.t_s.iter().zip(used).map(|(t_s, used)| (*t_s, noise, used));
        WhiteningFilter::new(rows, S::MODEL_ERRORS[channel].correlation_s, 1.0, 1.0)
    }

    /// The most probable model error of one channel, K; the misfit there, and the logarithm of the posterior's width.
    fn model_error(
        &self,
        counts: &[bool],
        channel: usize,
        residual: &[f64],
        (median_k, width): ErrorPrior,
    ) -> (f64, f64, f64) {
        let misfit = |z: f64| {
            let whitening = self.whitening(counts, channel, median_k * (width * z).exp());
            let mut white = residual.to_vec();
            whitening.apply(&mut white);
            0.5 * white.iter().map(|w| w * w).sum::<f64>() + whitening.ln_spreads + 0.5 * z * z
        };
        if width == 0.0 {
            return (median_k, misfit(0.0), 0.0);
        }
        // A fit that happens to be closer is chance.
        let best = minimise(-HINT_SIGMAS, MAX_WIDTHS, WIDTHS_ACCURACY, misfit);
        let step = CURVATURE_STEP;
        let curvature = (misfit(best.at + step) + misfit(best.at - step) - 2.0 * best.value) / (step * step);
        (median_k * (width * best.at).exp(), best.value, -0.5 * curvature.max(MIN_CURVATURE).ln())
    }

    /// [`SideProblem::model_error`] of each channel.
    fn model_errors(
        &self,
        counts: &[bool],
        residual: &Columns,
        prior: &dyn Fn(&ModelError) -> ErrorPrior,
    ) -> Vec<(f64, f64, f64)> {
        let channels = residual.iter().zip(S::MODEL_ERRORS).enumerate();
        channels
            .map(|(channel, (residual, error))| self.model_error(counts, channel, residual, prior(error)))
            .collect()
    }

    fn model_error_sigma_k(&self, counts: &[bool], residual: &Columns) -> Vec<f64> {
        self.model_errors(counts, residual, &prior_inside).into_iter().map(|(k, ..)| k).collect()
    }

    /// The best fit to the rows selected by `counts`, starting at `start`; `None` if the model has no solution there.
    pub(crate) fn fit(&self, start: &Hypothesis, counts: &[bool]) -> Option<SideFit> {
        let coordinates = coordinates(self.effects, start);
        let unknowns = unknowns(start, &coordinates);
        let priors = self.priors(start);
        let mut objective =
            Objective { problem: self, start, counts, coordinates, priors, whitenings: Vec::new() };
        let point = objective.at(&unknowns)?;
        let End { unknowns, point, normal, .. } = descend(&mut objective, unknowns, point, Until::default());
        let half_ln_determinant = normal.half_ln_determinant()?;
        let outside = |error: &ModelError| match error.width {
            0.0 => (error.median_k, 0.0),
            // By a factor of e, one standard deviation.
            _ => (OUTSIDE_RATIO * error.median_k, 1.0),
        };
        let evidence = |prior: &dyn Fn(&ModelError) -> ErrorPrior| {
            let errors = self.model_errors(counts, &point.residual, prior);
            let misfit: f64 = errors.into_iter().map(|(_, misfit, ln_width)| ln_width - misfit).sum();
            let of_effects: f64 = objective.priors.iter().map(|(_, precision)| 0.5 * precision.ln()).sum();
            misfit - 0.5 * objective.prior_cost(&unknowns) - half_ln_determinant + of_effects
        };
        let (score, score_outside) = (evidence(&prior_inside), evidence(&outside));
        let model_error_sigma_k = self.model_error_sigma_k(counts, &point.residual);
        let Point { hypothesis, predicted, .. } = point;
        Some(SideFit {
            score,
            score_outside,
            model_error_sigma_k,
            predicted,
            precision: normal.matrix,
            hypothesis,
        })
    }

    pub(crate) fn linearise(&self, fit: &SideFit, counts: &[bool]) -> Option<LinearisedFit<'_, '_, S>> {
        let coordinates = coordinates(self.effects, &fit.hypothesis);
        let slopes = self.slopes(&fit.hypothesis, &fit.predicted, &coordinates, FINE);
        let whitenings = self.whitenings(counts, &fit.model_error_sigma_k);
        let (hypothesis, predicted) = (fit.hypothesis.clone(), fit.predicted.clone());
        self.linearised(hypothesis, predicted, &slopes, whitenings, fit.precision.clone())
    }

    pub(crate) fn linearise_without_cause(
        &self,
        fit: &SideFit,
        counts: &[bool],
    ) -> Option<LinearisedFit<'_, '_, S>> {
        let base = Hypothesis { effects: Vec::new(), nuisances: fit.hypothesis.nuisances.clone() };
        let predicted = self.predict(&base)?;
        let slopes = self.slopes(&base, &predicted, &[], FINE);
        let whitenings = self.whitenings(counts, &fit.model_error_sigma_k);
        let zero: Columns = predicted.iter().map(|column| vec![0.0; column.len()]).collect();
        let precision = normal(&whitenings, &slopes, &zero, &vec![(0.0, 1.0); slopes.len()]).matrix;
        self.linearised(base, predicted, &slopes, whitenings, precision)
    }

    fn linearised(
        &self,
        hypothesis: Hypothesis,
        predicted: Columns,
        slopes: &[Columns],
        whitenings: Vec<WhiteningFilter>,
        precision: DMatrix<f64>,
    ) -> Option<LinearisedFit<'_, '_, S>> {
        Some(LinearisedFit {
            problem: self,
            columns: slopes.iter().map(|slope| whitened(&whitenings, slope)).collect(),
            residual: whitened(&whitenings, &self.residual(&predicted)),
            precision: precision.cholesky()?,
            hypothesis,
            predicted,
            whitenings,
        })
    }

    /// Change of the predictions for a unit of each unknown and each coordinate, by model runs at the distance `step`.
    fn slopes(
        &self,
        hypothesis: &Hypothesis,
        here: &Columns,
        coordinates: &[Coordinate],
        step: f64,
    ) -> Vec<Columns> {
        let neighbours = nuisance_neighbours(hypothesis, step);
        neighbours
            .chain(effect_neighbours(hypothesis, coordinates, step))
            .map(|(moved, by)| match self.predict(&moved) {
                Some(there) if by != 0.0 => changes(&there, here, by),
                _ => here.iter().map(|column| vec![0.0; column.len()]).collect(),
            })
            .collect()
    }
}

fn changes(there: &Columns, here: &Columns, units: f64) -> Columns {
    let of_column = |(there, here): (&Vec<f64>, &Vec<f64>)| {
        there.iter().zip(here).map(|(there, here)| (there - here) / units).collect()
    };
    there.iter().zip(here).map(of_column).collect()
}

fn whitened(whitenings: &[WhiteningFilter], columns: &Columns) -> Columns {
    let mut white = columns.clone();
    whitenings.iter().zip(&mut white).for_each(|(whitening, column)| whitening.apply(column));
    white
}

fn dot(a: &Columns, b: &Columns) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
}

pub(crate) struct LinearisedFit<'a, 'p, S> {
    problem: &'a SideProblem<'p, S>,
    pub(crate) hypothesis: Hypothesis,
    predicted: Columns,
    whitenings: Vec<WhiteningFilter>,
    columns: Vec<Columns>,
    residual: Columns,
    precision: Cholesky<f64, Dyn>,
}

/// The whitened change from a fit to a hypothesis, and how far the free parameters can imitate it.
pub(crate) struct Change {
    change: Columns,
    /// Squared length of the part that the free parameters cannot imitate.
    pub(crate) own: f64,
    /// Squared length that each free parameter imitates.
    pub(crate) imitated: Vec<f64>,
}

impl<S: SideModel> LinearisedFit<'_, '_, S> {
    /// The change from the fit to a hypothesis; `None` if the model has no solution there.
    pub(crate) fn change(&self, there: &Hypothesis) -> Option<Change> {
        let change = changes(&self.problem.predict(there)?, &self.predicted, 1.0);
        let change = whitened(&self.whitenings, &change);
        let right = DVector::from_fn(self.columns.len(), |i, _| dot(&self.columns[i], &change));
        let solved = self.precision.solve(&right);
        let own = dot(&change, &change) - right.dot(&solved);
        Some(Change { change, own, imitated: solved.component_mul(&right).as_slice().to_vec() })
    }

    /// Cost reduction by a change of any size, all other parameters free: a fit has no slope along them, so the residual needs no projection.
    pub(crate) fn gain(&self, there: &Hypothesis) -> Option<f64> {
        let Change { change, own, .. } = self.change(there)?;
        let seen = dot(&change, &self.residual);
        Some(if own > 0.0 && seen > 0.0 { seen * seen / own } else { 0.0 })
    }
}

fn prior_inside(error: &ModelError) -> ErrorPrior {
    (error.median_k, error.width)
}

/// The cost of a hypothesis as a function of its unknowns, in standard normal numbers, and its effects' coordinates.
struct Objective<'a, 'p, S> {
    problem: &'a SideProblem<'p, S>,
    start: &'a Hypothesis,
    counts: &'a [bool],
    coordinates: Vec<Coordinate>,
    priors: Vec<(f64, f64)>,
    /// For the model error at the last accepted point.
    whitenings: Vec<WhiteningFilter>,
}

struct Point {
    hypothesis: Hypothesis,
    predicted: Columns,
    residual: Columns,
}

impl<S: SideModel> Objective<'_, '_, S> {
    fn prior_deviations(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let count = unknowns.len() - self.priors.len();
        let of_effects = unknowns.iter().skip(count).zip(&self.priors);
        let of_effects = of_effects.map(|(at, (mean, precision))| (at - mean, *precision));
        unknowns.iter().take(count).map(|z| (*z, 1.0)).chain(of_effects).collect()
    }

    fn prior_cost(&self, unknowns: &DVector<f64>) -> f64 {
        self.prior_deviations(unknowns).iter().map(|(off, precision)| precision * off * off).sum()
    }
}

impl<S: SideModel> Model for Objective<'_, '_, S> {
    type Point = Point;

    fn at(&self, unknowns: &DVector<f64>) -> Option<Point> {
        let hypothesis = hypothesis_at(self.start, &self.coordinates, unknowns);
        let predicted = self.problem.predict(&hypothesis)?;
        let residual = self.problem.residual(&predicted);
        Some(Point { hypothesis, predicted, residual })
    }

    fn cost(&self, unknowns: &DVector<f64>, point: &Point) -> f64 {
        let white = whitened(&self.whitenings, &point.residual);
        dot(&white, &white) + self.prior_cost(unknowns)
    }

    fn normal(&mut self, unknowns: &DVector<f64>, point: &Point, reach: DifferenceStep) -> Normal {
        let slopes =
            self.problem.slopes(&point.hypothesis, &point.predicted, &self.coordinates, reach.distance());
        normal(&self.whitenings, &slopes, &point.residual, &self.prior_deviations(unknowns))
    }

    fn step_bounds(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let count = unknowns.len() - self.coordinates.len();
        let of_unknowns =
            unknowns.iter().take(count).map(|z| step_bounds_within(-MAX_SIGMAS, MAX_SIGMAS, *z));
        let of_effects = self.coordinates.iter().zip(unknowns.iter().skip(count));
        of_unknowns.chain(of_effects.map(|(coordinate, at)| coordinate.step_bounds(*at))).collect()
    }

    fn accept(&mut self, point: &Point) {
        let model_error_sigma_k = self.problem.model_error_sigma_k(self.counts, &point.residual);
        self.whitenings = self.problem.whitenings(self.counts, &model_error_sigma_k);
    }
}

/// The normal equations of slopes and a residual; `prior_deviations` as in [`Objective::prior_deviations`].
fn normal(
    whitenings: &[WhiteningFilter],
    slopes: &[Columns],
    residual: &Columns,
    prior_deviations: &[(f64, f64)],
) -> Normal {
    let columns: Vec<Columns> = slopes.iter().map(|slope| whitened(whitenings, slope)).collect();
    let residual = whitened(whitenings, residual);
    let matrix = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        dot(&columns[i], &columns[j]) + if i == j { prior_deviations[i].1 } else { 0.0 }
    });
    let gradient = DVector::from_fn(columns.len(), |i, _| {
        dot(&columns[i], &residual) - prior_deviations[i].1 * prior_deviations[i].0
    });
    Normal { matrix, gradient }
}
