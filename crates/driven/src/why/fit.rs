//! A hypothesis at its best under the rows that count, and how well it is supported (Laplace's approximation).
//!
//! Gauss and Newton on whitened residuals, as in `mapper-gap`; but what the model leaves beside the noise is found with
//! everything else, for nobody declares it of a machine on an engine.

use super::noise::Whitening;
use super::side::{Side, Smooth};
use mapper_gap::coordinate::{Coordinate, parameters, set_parameter};
use mapper_gap::normal::PRIOR_STEPS;
use mapper_gap::study::Hypothesis;
use mapper_numerics::minimise::minimise;
use mapper_physics::effect::{Effect, Rig, add};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// What every hypothesis is held against.
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
    /// Logarithm of the evidence, what is left being what such a model leaves.
    pub(crate) score: f64,
    /// The same, what is left being as large as a cause beside it makes it.
    pub(crate) score_outside: f64,
    /// What is left beside the noise, one standard deviation for each judged channel, K.
    pub(crate) left_k: Vec<f64>,
    /// What the sensors would have read in all rows, K.
    pub(crate) predicted: Vec<Vec<f64>>,
    /// Precision of unknowns and coordinates, what is known beforehand included.
    pub(crate) precision: DMatrix<f64>,
}

/// A cause outside the catalogue leaves so many times more than the model.
const OUTSIDE_RATIO: f64 = 12.0;
/// Width of the logarithm of that.
const OUTSIDE_WIDTH: f64 = 1.0;
/// No model of this kind leaves less than so many widths below the median, however well it happens to fit; nor does what is
/// called a cause outside the catalogue.
const LEAST_LEFT: f64 = -2.0;
/// An unknown so many standard deviations off is beyond what is known of any machine.
const MOST_SIGMAS: f64 = 5.0;
/// Most that an unknown, or an effect in typical steps, moves at once.
const MOST_MOVED: (f64, f64) = (2.0, 2.0);
/// Iterations, and what one has to promise in the cost.
const ITERATIONS: usize = 14;
const ENOUGH: f64 = 0.02;
/// Distance of the runs beside a hypothesis from which slopes are taken, in the coordinates' units.
const BESIDE: f64 = 0.02;

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

    /// Coordinates of the effects' parameters, in order.
    pub(crate) fn coordinates(&self, hypothesis: &Hypothesis) -> Vec<Coordinate> {
        let infos = hypothesis.effects.iter().map(|(index, _)| self.effects[*index].info());
        infos.flat_map(|info| &info.parameters).map(Coordinate::new).collect()
    }

    /// Readings less predictions in rows that count, and 0 elsewhere.
    fn residual(&self, predicted: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let judged = &self.side.rows().judged;
        let off = |((_, read), said): (&(_, Vec<f64>), &Vec<f64>)| {
            read.iter().zip(said).map(|(r, s)| if r.is_nan() { 0.0 } else { r - s }).collect()
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

    /// Misfit of one channel, with what is known of what is left by a prior of this median and width.
    fn misfit(&self, counts: &[bool], channel: usize, residual: &[f64], z: f64, prior: (f64, f64)) -> f64 {
        let (median_k, width) = prior;
        let whitening = self.whitening(counts, channel, median_k * (width * z).exp());
        let mut white = residual.to_vec();
        whitening.whiten(&mut white);
        0.5 * white.iter().map(|w| w * w).sum::<f64>() + whitening.ln_spreads + 0.5 * z * z
    }

    /// What is left of one channel at its likeliest, K; the misfit there, and the logarithm of the evidence's width.
    fn left(&self, counts: &[bool], channel: usize, residual: &[f64], prior: (f64, f64)) -> (f64, f64, f64) {
        let (median_k, width) = prior;
        if width == 0.0 {
            return (median_k, self.misfit(counts, channel, residual, 0.0, prior), 0.0);
        }
        let at = |z: f64| self.misfit(counts, channel, residual, z, prior);
        let best = minimise(LEAST_LEFT, 9.0, 1e-3, at);
        let (beside, here) = (0.1, best.value);
        let curvature = (at(best.at + beside) + at(best.at - beside) - 2.0 * here) / (beside * beside);
        (median_k * (width * best.at).exp(), here, -0.5 * curvature.max(0.1).ln())
    }

    /// The best fit from where `start` stands to the rows that `counts` says; `None` where the model has no answer there.
    pub(crate) fn fit(&self, start: &Hypothesis, counts: &[bool]) -> Option<Fit> {
        let mut hypothesis = start.clone();
        let mut predicted = self.predict(&hypothesis)?;
        let coordinates = self.coordinates(start);
        let known = self.known(start);
        let pulls = |hypothesis: &Hypothesis| -> Vec<(f64, f64)> {
            let values = parameters(hypothesis).into_iter().zip(coordinates.iter().zip(&known));
            values
                .map(|(value, (coordinate, (middle, over)))| (coordinate.of(value) - middle, *over))
                .collect()
        };
        let of_effects = |hypothesis: &Hypothesis| {
            pulls(hypothesis).iter().map(|(off, over)| over * off * off).sum::<f64>()
        };
        let all_left =
            |residual: &[Vec<f64>], prior: &dyn Fn(&Smooth) -> (f64, f64)| -> Vec<(f64, f64, f64)> {
                let each = residual.iter().zip(S::smooth()).enumerate();
                each.map(|(channel, (residual, smooth))| self.left(counts, channel, residual, prior(smooth)))
                    .collect()
            };
        let inside = |smooth: &Smooth| (smooth.median_k, smooth.width);
        let mut residual = self.residual(&predicted);
        let mut left_k: Vec<f64> = all_left(&residual, &inside).into_iter().map(|(k, ..)| k).collect();
        let mut slopes = self.slopes(&hypothesis, &predicted, &coordinates);
        for _ in 0..ITERATIONS {
            let whitenings = self.whitenings(counts, &left_k);
            let cost = |residual: &[Vec<f64>], hypothesis: &Hypothesis| {
                let squares = |column: Vec<f64>| column.iter().map(|w| w * w).sum::<f64>();
                whitened(&whitenings, residual).into_iter().map(squares).sum::<f64>()
                    + hypothesis.nuisances.iter().map(|z| z * z).sum::<f64>()
                    + of_effects(hypothesis)
            };
            let before = cost(&residual, &hypothesis);
            let normal =
                Normal::new(&whitenings, &slopes, &residual, &hypothesis.nuisances, &pulls(&hypothesis));
            let Some((step, promised)) = normal.bounded_step(&hypothesis, &coordinates) else { break };
            if promised < ENOUGH {
                break;
            }
            let mut accepted = false;
            let mut share = 1.0;
            for _ in 0..5 {
                let there = moved(&hypothesis, &step, share, &coordinates);
                if let Some(said) = self.predict(&there) {
                    let off = self.residual(&said);
                    if cost(&off, &there) < before {
                        (hypothesis, predicted, residual) = (there, said, off);
                        accepted = true;
                        break;
                    }
                }
                share *= 0.35;
            }
            if !accepted {
                break;
            }
            left_k = all_left(&residual, &inside).into_iter().map(|(k, ..)| k).collect();
            slopes = self.slopes(&hypothesis, &predicted, &coordinates);
        }
        let normal = Normal::new(
            &self.whitenings(counts, &left_k),
            &slopes,
            &residual,
            &hypothesis.nuisances,
            &pulls(&hypothesis),
        );
        let half_ln_determinant = normal.half_ln_determinant()?;
        let outside = |smooth: &Smooth| match smooth.width {
            0.0 => (smooth.median_k, 0.0),
            _ => (OUTSIDE_RATIO * smooth.median_k, OUTSIDE_WIDTH),
        };
        let evidence = |prior: &dyn Fn(&Smooth) -> (f64, f64)| {
            let misfit: f64 =
                all_left(&residual, prior).into_iter().map(|(_, misfit, width)| width - misfit).sum();
            let off =
                0.5 * (hypothesis.nuisances.iter().map(|z| z * z).sum::<f64>() + of_effects(&hypothesis));
            misfit - off - half_ln_determinant + known.iter().map(|(_, over)| 0.5 * over.ln()).sum::<f64>()
        };
        let (score, score_outside) = (evidence(&inside), evidence(&outside));
        Some(Fit { score, score_outside, left_k, predicted, precision: normal.matrix, hypothesis })
    }

    /// Changes for a unit of each unknown and each coordinate, by runs beside the hypothesis.
    pub(crate) fn slopes(
        &self,
        hypothesis: &Hypothesis,
        here: &[Vec<f64>],
        coordinates: &[Coordinate],
    ) -> Vec<Vec<Vec<f64>>> {
        let of = |moved: &Hypothesis, by: f64| -> Vec<Vec<f64>> {
            let Some(there) = self.predict(moved) else {
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
            moved.nuisances[place] += BESIDE;
            slopes.push(of(&moved, BESIDE));
        }
        for (place, (coordinate, value)) in coordinates.iter().zip(parameters(hypothesis)).enumerate() {
            let at = coordinate.of(value);
            // To the side where there is room.
            let room = |x: &f64| (coordinate.of(coordinate.value(*x)) - x).abs() < 1e-9;
            let away = [at + BESIDE, at - BESIDE].into_iter().find(room).unwrap_or(at - BESIDE);
            let mut moved = hypothesis.clone();
            set_parameter(&mut moved, place, coordinate.value(away));
            slopes.push(of(&moved, away - at));
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

/// Products of whitened slopes, unknowns first, with what is known beforehand of each.
pub(crate) struct Normal {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) columns: Vec<Vec<Vec<f64>>>,
    right: DVector<f64>,
}

impl Normal {
    pub(crate) fn new(
        whitenings: &[Whitening],
        slopes: &[Vec<Vec<f64>>],
        residual: &[Vec<f64>],
        unknowns: &[f64],
        pulls: &[(f64, f64)],
    ) -> Self {
        let columns: Vec<_> = slopes.iter().map(|slope| whitened(whitenings, slope)).collect();
        let residual = whitened(whitenings, residual);
        // How far each stands from the middle of what is known, and its precision.
        let known: Vec<(f64, f64)> =
            unknowns.iter().map(|z| (*z, 1.0)).chain(pulls.iter().copied()).collect();
        let matrix = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            dot(&columns[i], &columns[j]) + if i == j { known[i].1 } else { 0.0 }
        });
        let right =
            DVector::from_fn(columns.len(), |i, _| dot(&columns[i], &residual) - known[i].1 * known[i].0);
        Normal { matrix, columns, right }
    }

    fn half_ln_determinant(&self) -> Option<f64> {
        let cholesky = self.matrix.clone().cholesky()?;
        Some(cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum())
    }

    /// The step to the least cost within all bounds, and what it promises: what would leave its range is held at its end and the
    /// others are solved for again.
    fn bounded_step(
        &self,
        hypothesis: &Hypothesis,
        coordinates: &[Coordinate],
    ) -> Option<(DVector<f64>, f64)> {
        let within = |low: f64, high: f64, most: f64| (low.clamp(-most, 0.0), high.clamp(0.0, most));
        let mut room: Vec<(f64, f64)> = hypothesis
            .nuisances
            .iter()
            .map(|z| within(-MOST_SIGMAS - z, MOST_SIGMAS - z, MOST_MOVED.0))
            .collect();
        room.extend(coordinates.iter().zip(parameters(hypothesis)).map(|(coordinate, value)| {
            let (low, high) = coordinate.ends();
            let at = coordinate.of(value);
            within(low - at, high - at, MOST_MOVED.1)
        }));
        let mut held: Vec<Option<f64>> = vec![None; room.len()];
        for _ in 0..room.len() {
            let free: Vec<usize> = (0..held.len()).filter(|i| held[*i].is_none()).collect();
            let mut step = DVector::from_fn(held.len(), |i, _| held[i].unwrap_or(0.0));
            let pushed = &self.matrix * &step;
            let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| self.matrix[(free[i], free[j])]);
            let right = DVector::from_fn(free.len(), |i, _| self.right[free[i]] - pushed[free[i]]);
            let part = matrix.cholesky()?.solve(&right);
            for (place, index) in free.iter().enumerate() {
                step[*index] = part[place];
            }
            let outside = |i: &usize| step[*i] < room[*i].0 - 1e-9 || step[*i] > room[*i].1 + 1e-9;
            let leaving: Vec<usize> = free.into_iter().filter(outside).collect();
            if leaving.is_empty() {
                let promised = 2.0 * step.dot(&self.right) - step.dot(&(&self.matrix * &step));
                return Some((step, promised));
            }
            for i in leaving {
                held[i] = Some(step[i].clamp(room[i].0, room[i].1));
            }
        }
        None
    }
}

fn moved(hypothesis: &Hypothesis, step: &DVector<f64>, share: f64, coordinates: &[Coordinate]) -> Hypothesis {
    let unknowns = hypothesis.nuisances.len();
    let mut moved = hypothesis.clone();
    for (z, by) in moved.nuisances.iter_mut().zip(step.iter()) {
        *z += share * by;
    }
    for (place, (coordinate, value)) in coordinates.iter().zip(parameters(hypothesis)).enumerate() {
        let to = coordinate.value(coordinate.of(value) + share * step[unknowns + place]);
        set_parameter(&mut moved, place, to);
    }
    moved
}
