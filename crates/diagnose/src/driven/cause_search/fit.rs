//! A hypothesis at its best under the rows that count, and how well it is supported (Laplace's approximation).
//!
//! Gauss-Newton on whitened residuals, as in `mapper-diagnose`; but the model error in addition to the noise is fitted with
//! everything else, because it is not declared for a machine on an engine.

use crate::driven::cause_search::noise::Whitening;
use crate::driven::cause_search::sides::side::{Side, Smooth};
use crate::gap::best_fit::coordinate::{Coordinate, coordinates, parameters, set_parameter};
use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::PRIOR_STEPS;
use crate::gap::residuals::study::Hypothesis;
use mapper_inference::descent::{End, FINE, Model, Normal, Reach, Until, descend, room_within};
use mapper_numerics::minimise::minimise;
use mapper_physics::rig::effect::{Effect, Rig, add};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// The data that every hypothesis is compared with.
pub(crate) struct Question<'a, S> {
    /// The side under its rows.
    pub(crate) side: &'a S,
    /// The nominal rig.
    pub(crate) nominal: &'a Rig,
    /// Candidate effects.
    pub(crate) effects: &'a [Arc<dyn Effect>],
    /// White noise of each judged channel, K: the sensor's, and what noise of the drives makes of it.
    pub(crate) white_k: Vec<f64>,
}

/// A hypothesis at its best.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    /// Unknowns in standard normal numbers, effects in their units.
    pub(crate) hypothesis: Hypothesis,
    /// Logarithm of the evidence, with the prior of the model error for such a model.
    pub(crate) score: f64,
    /// The same, with a model error as large as an unmodelled cause would make it.
    pub(crate) score_outside: f64,
    /// Model error in addition to the noise, one standard deviation for each judged channel, K.
    pub(crate) left_k: Vec<f64>,
    /// What the sensors would have read in all rows, K.
    pub(crate) predicted: Vec<Vec<f64>>,
    /// Precision of unknowns and coordinates, what is known beforehand included.
    pub(crate) precision: DMatrix<f64>,
}

/// A cause outside the catalogue leaves so many times more than the model.
const OUTSIDE_RATIO: f64 = 12.0;
/// No model of this kind leaves less than so many widths below the median, however well it happens to fit; nor does what is
/// called a cause outside the catalogue.
const MIN_LEFT: f64 = -2.0;

impl<S: Side> Question<'_, S> {
    /// Nothing but what is not known.
    pub(crate) fn nothing(&self) -> Hypothesis {
        Hypothesis { nuisances: vec![0.0; S::unknowns().len()], effects: Vec::new() }
    }

    /// What is known of the effects' coordinates beforehand: middle, and one over the width squared; no wider than their range.
    fn known(&self, hypothesis: &Hypothesis) -> Vec<(f64, f64)> {
        let infos = hypothesis.effects.iter().map(|(index, _)| self.effects[*index].info());
        infos
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

    /// What the sensors would have read; `None` where a value is out of its range or the model has no answer.
    pub(crate) fn predict(&self, hypothesis: &Hypothesis) -> Option<Vec<Vec<f64>>> {
        let mut rig = self.nominal.clone();
        for (index, values) in &hypothesis.effects {
            add(&mut rig, self.effects[*index].as_ref(), values).ok()?;
        }
        let unknowns: Vec<f64> =
            S::unknowns().iter().zip(&hypothesis.nuisances).map(|(unknown, z)| unknown.at(*z)).collect();
        let predicted = self.side.predict(&rig, &unknowns);
        predicted.iter().flatten().all(|k| k.is_finite()).then_some(predicted)
    }

    /// Readings less predictions in rows that count, and 0 elsewhere.
    fn residual(&self, predicted: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let judged = &self.side.rows().judged;
        let off = |((_, read), expected): (&(_, Vec<f64>), &Vec<f64>)| {
            read.iter().zip(expected).map(|(r, s)| if r.is_nan() { 0.0 } else { r - s }).collect()
        };
        judged.iter().zip(predicted).map(off).collect()
    }

    /// Whitening of each channel; `left` in standard normal numbers of its logarithm.
    pub(crate) fn whitenings(&self, counts: &[bool], left_k: &[f64]) -> Vec<Whitening> {
        (0..left_k.len()).map(|channel| self.whitening(counts, channel, left_k[channel])).collect()
    }

    fn whitening(&self, counts: &[bool], channel: usize, left_k: f64) -> Whitening {
        let rows = self.side.rows();
        let looked: Vec<bool> = rows.judged[channel]
            .1
            .iter()
            .zip(counts)
            .map(|(read, counts)| *counts && read.is_finite())
            .collect();
        Whitening::new(&rows.t_s, &looked, self.white_k[channel], left_k, S::smooth()[channel].alike_s)
    }

    /// Misfit of one channel, with a prior of this median and width on its model error.
    fn misfit(&self, counts: &[bool], channel: usize, residual: &[f64], z: f64, prior: (f64, f64)) -> f64 {
        let (median_k, width) = prior;
        let whitening = self.whitening(counts, channel, median_k * (width * z).exp());
        let mut white = residual.to_vec();
        whitening.whiten(&mut white);
        0.5 * white.iter().map(|w| w * w).sum::<f64>() + whitening.ln_spreads + 0.5 * z * z
    }

    /// Likeliest model error of one channel, K; the misfit there, and the logarithm of the evidence's width.
    fn left(&self, counts: &[bool], channel: usize, residual: &[f64], prior: (f64, f64)) -> (f64, f64, f64) {
        let (median_k, width) = prior;
        if width == 0.0 {
            return (median_k, self.misfit(counts, channel, residual, 0.0, prior), 0.0);
        }
        let at = |z: f64| self.misfit(counts, channel, residual, z, prior);
        let best = minimise(MIN_LEFT, 9.0, 1e-3, at);
        let (step, here) = (0.1, best.value);
        let curvature = (at(best.at + step) + at(best.at - step) - 2.0 * here) / (step * step);
        (median_k * (width * best.at).exp(), here, -0.5 * curvature.max(0.1).ln())
    }

    /// The best fit to the rows selected by `counts`, starting at `start`; `None` if the model has no answer there.
    pub(crate) fn fit(&self, start: &Hypothesis, counts: &[bool]) -> Option<Fit> {
        let coordinates = coordinates(self.effects, start);
        let at = coordinates.iter().zip(parameters(start)).map(|(coordinate, value)| coordinate.of(value));
        let unknowns = DVector::from_iterator(
            start.nuisances.len() + coordinates.len(),
            start.nuisances.iter().copied().chain(at),
        );
        let known = self.known(start);
        let mut fitted = Fitted { question: self, start, counts, coordinates, known, whitenings: Vec::new() };
        let point = fitted.at(&unknowns)?;
        let End { unknowns, point, normal, .. } = descend(&mut fitted, unknowns, point, Until::default());
        let half_ln_determinant = normal.half_ln_determinant()?;
        let outside = |smooth: &Smooth| match smooth.width {
            0.0 => (smooth.median_k, 0.0),
            // By a factor of e, one standard deviation.
            _ => (OUTSIDE_RATIO * smooth.median_k, 1.0),
        };
        let evidence = |prior: &dyn Fn(&Smooth) -> (f64, f64)| {
            let left = self.all_left(counts, &point.residual, prior);
            let misfit: f64 = left.into_iter().map(|(_, misfit, width)| width - misfit).sum();
            let of_effects: f64 = fitted.known.iter().map(|(_, over)| 0.5 * over.ln()).sum();
            misfit - 0.5 * fitted.off_priors(&unknowns) - half_ln_determinant + of_effects
        };
        let (score, score_outside) = (evidence(&inside), evidence(&outside));
        let left_k = self.left_k(counts, &point.residual);
        let Point { hypothesis, predicted, .. } = point;
        Some(Fit { score, score_outside, left_k, predicted, precision: normal.matrix, hypothesis })
    }

    /// The linearisation of a fit, for the gain of further effects.
    pub(crate) fn beside(&self, fit: &Fit, counts: &[bool]) -> Option<LinearisedFit<'_, '_, S>> {
        let whitenings = self.whitenings(counts, &fit.left_k);
        let coordinates = coordinates(self.effects, &fit.hypothesis);
        let slopes = self.slopes(&fit.hypothesis, &fit.predicted, &coordinates, FINE);
        let columns = slopes.iter().map(|slope| whitened(&whitenings, slope)).collect();
        let residual = whitened(&whitenings, &self.residual(&fit.predicted));
        let precision = fit.precision.clone().cholesky()?;
        Some(LinearisedFit {
            question: self,
            predicted: fit.predicted.clone(),
            whitenings,
            columns,
            residual,
            precision,
        })
    }

    /// What is left of each channel, its misfit, and the logarithm of the evidence's width.
    fn all_left(
        &self,
        counts: &[bool],
        residual: &[Vec<f64>],
        prior: &dyn Fn(&Smooth) -> (f64, f64),
    ) -> Vec<(f64, f64, f64)> {
        let each = residual.iter().zip(S::smooth()).enumerate();
        each.map(|(channel, (residual, smooth))| self.left(counts, channel, residual, prior(smooth)))
            .collect()
    }

    fn left_k(&self, counts: &[bool], residual: &[Vec<f64>]) -> Vec<f64> {
        self.all_left(counts, residual, &inside).into_iter().map(|(k, ..)| k).collect()
    }

    /// Changes for a unit of each unknown and each coordinate, by runs next to the hypothesis.
    pub(crate) fn slopes(
        &self,
        hypothesis: &Hypothesis,
        here: &[Vec<f64>],
        coordinates: &[Coordinate],
        step: f64,
    ) -> Vec<Vec<Vec<f64>>> {
        let of = |moved: &Hypothesis, by: f64| -> Vec<Vec<f64>> {
            let Some(there) = self.predict(moved).filter(|_| by != 0.0) else {
                return here.iter().map(|h| vec![0.0; h.len()]).collect();
            };
            there
                .iter()
                .zip(here)
                .map(|(t, h)| t.iter().zip(h).map(|(t, h)| (t - h) / by).collect())
                .collect()
        };
        let mut slopes = Vec::with_capacity(hypothesis.nuisances.len() + coordinates.len());
        for place in 0..hypothesis.nuisances.len() {
            let mut moved = hypothesis.clone();
            moved.nuisances[place] += step;
            slopes.push(of(&moved, step));
        }
        for (place, (coordinate, value)) in coordinates.iter().zip(parameters(hypothesis)).enumerate() {
            let (next, by) = coordinate.next_to(value, step);
            let mut moved = hypothesis.clone();
            set_parameter(&mut moved, place, next);
            slopes.push(of(&moved, by));
        }
        slopes
    }
}

/// Columns of all channels, whitened.
pub(crate) fn whitened(whitenings: &[Whitening], columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let white = |(whitening, column): (&Whitening, &Vec<f64>)| {
        let mut column = column.clone();
        whitening.whiten(&mut column);
        column
    };
    whitenings.iter().zip(columns).map(white).collect()
}

fn dot(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
}

/// A fit at its best, with the slopes of all that is free in it.
pub(crate) struct LinearisedFit<'a, 'q, S> {
    question: &'a Question<'q, S>,
    predicted: Vec<Vec<f64>>,
    whitenings: Vec<Whitening>,
    columns: Vec<Vec<Vec<f64>>>,
    residual: Vec<Vec<f64>>,
    precision: Cholesky<f64, Dyn>,
}

impl<S: Side> LinearisedFit<'_, '_, S> {
    /// What the change from the fit to a hypothesis would take off the cost in any strength, all else free. At its best a fit has no slope
    /// along what is free, so that the residual needs no projection.
    pub(crate) fn gain(&self, there: &Hypothesis) -> Option<f64> {
        let there = self.question.predict(there)?;
        let change: Vec<Vec<f64>> = there
            .iter()
            .zip(&self.predicted)
            .map(|(t, h)| t.iter().zip(h).map(|(t, h)| t - h).collect())
            .collect();
        let change = whitened(&self.whitenings, &change);
        let right = DVector::from_fn(self.columns.len(), |i, _| dot(&self.columns[i], &change));
        let own = dot(&change, &change) - right.dot(&self.precision.solve(&right));
        let seen = dot(&change, &self.residual);
        Some(if own > 0.0 && seen > 0.0 { seen * seen / own } else { 0.0 })
    }
}

/// What a model of this kind leaves: median, and width of its logarithm.
fn inside(smooth: &Smooth) -> (f64, f64) {
    (smooth.median_k, smooth.width)
}

/// A hypothesis' unknowns, in standard normal numbers, and behind them its effects' coordinates.
struct Fitted<'a, 'q, S> {
    question: &'a Question<'q, S>,
    start: &'a Hypothesis,
    counts: &'a [bool],
    coordinates: Vec<Coordinate>,
    known: Vec<(f64, f64)>,
    /// For the model error at the last point that was accepted.
    whitenings: Vec<Whitening>,
}

struct Point {
    hypothesis: Hypothesis,
    predicted: Vec<Vec<f64>>,
    residual: Vec<Vec<f64>>,
}

impl<S: Side> Fitted<'_, '_, S> {
    /// Distance of each unknown from the middle of what is known of it, and the precision of that.
    fn pulls(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let n = unknowns.len() - self.known.len();
        let of_effects =
            unknowns.iter().skip(n).zip(&self.known).map(|(at, (middle, over))| (at - middle, *over));
        unknowns.iter().take(n).map(|z| (*z, 1.0)).chain(of_effects).collect()
    }

    fn off_priors(&self, unknowns: &DVector<f64>) -> f64 {
        self.pulls(unknowns).iter().map(|(off, over)| over * off * off).sum()
    }
}

impl<S: Side> Model for Fitted<'_, '_, S> {
    type Point = Point;

    fn at(&self, unknowns: &DVector<f64>) -> Option<Point> {
        let mut hypothesis = self.start.clone();
        let n = hypothesis.nuisances.len();
        hypothesis.nuisances.copy_from_slice(&unknowns.as_slice()[..n]);
        for (place, coordinate) in self.coordinates.iter().enumerate() {
            set_parameter(&mut hypothesis, place, coordinate.value(unknowns[n + place]));
        }
        let predicted = self.question.predict(&hypothesis)?;
        let residual = self.question.residual(&predicted);
        Some(Point { hypothesis, predicted, residual })
    }

    fn cost(&self, unknowns: &DVector<f64>, point: &Point) -> f64 {
        let white = whitened(&self.whitenings, &point.residual);
        dot(&white, &white) + self.off_priors(unknowns)
    }

    fn normal(&mut self, unknowns: &DVector<f64>, point: &Point, reach: Reach) -> Normal {
        let slopes =
            self.question.slopes(&point.hypothesis, &point.predicted, &self.coordinates, reach.distance());
        normal(&self.whitenings, &slopes, &point.residual, &self.pulls(unknowns)).0
    }

    fn room(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let n = unknowns.len() - self.coordinates.len();
        let of_unknowns = unknowns.iter().take(n).map(|z| room_within(-MAX_SIGMAS, MAX_SIGMAS, *z));
        let of_effects = self.coordinates.iter().zip(unknowns.iter().skip(n)).map(|(coordinate, at)| {
            let (low, high) = coordinate.ends();
            room_within(low, high, *at)
        });
        of_unknowns.chain(of_effects).collect()
    }

    fn accept(&mut self, point: &Point) {
        let left_k = self.question.left_k(self.counts, &point.residual);
        self.whitenings = self.question.whitenings(self.counts, &left_k);
    }
}

/// The normal equations of whitened slopes, unknowns first, with the distance of each from what is known of it and the precision of that;
/// and the whitened slopes.
pub(crate) fn normal(
    whitenings: &[Whitening],
    slopes: &[Vec<Vec<f64>>],
    residual: &[Vec<f64>],
    pulls: &[(f64, f64)],
) -> (Normal, Vec<Vec<Vec<f64>>>) {
    let columns: Vec<_> = slopes.iter().map(|slope| whitened(whitenings, slope)).collect();
    let residual = whitened(whitenings, residual);
    let matrix = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        dot(&columns[i], &columns[j]) + if i == j { pulls[i].1 } else { 0.0 }
    });
    let pull = DVector::from_fn(columns.len(), |i, _| dot(&columns[i], &residual) - pulls[i].1 * pulls[i].0);
    (Normal { matrix, pull }, columns)
}
