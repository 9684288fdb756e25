//! Residuals scaled by the noise and the uncertainty of the inputs.

use crate::gap::residuals::nuisance::{JUMP_S, NuisanceKind, OUTPUTS};
use crate::gap::residuals::study::{Hypothesis, PredictError, Prediction, Study};
use crate::gap::residuals::true_inputs::LinearisedMachine;
use crate::gap::structure::{repeating_part, step_errors};
use mapper_core::Channel;
use mapper_numerics::coloured_noise::{ColouredNoise, WhiteningFactor, covariance_of_means};
use mapper_numerics::parallel;
use mapper_observe::averages::INPUT_CHANNELS;
use mapper_observe::model_inputs::smoothed_inputs::InputNoise;
use mapper_observe::perturbation::UNINFORMATIVE;
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The study linearised at a hypothesis: prediction, whitening, derivatives of nuisances, and changes due to effects.
#[derive(Debug)]
pub(crate) struct Linearised {
    hypothesis: Hypothesis,
    /// Prediction there.
    pub base: Prediction,
    /// Its run, from which derivatives follow.
    pub(crate) machine: LinearisedMachine,
    noise: Noise,
    /// Whitened change for one sigma of each nuisance.
    pub columns: Vec<Vec<f64>>,
    /// Products of the columns, for each step.
    pub products: Vec<DMatrix<f64>>,
    /// Whitened changes due to further effects, as far as they were requested: by effect and bits of its values.
    further: Mutex<BTreeMap<(usize, Vec<u64>), Change>>,
}

/// A whitened change; `None` if the model cannot follow.
type Change = Option<Arc<Vec<f64>>>;

#[derive(Debug, Clone)]
struct Noise {
    covariances: Arc<Vec<DMatrix<f64>>>,
    factors: Arc<Vec<WhiteningFactor>>,
}

impl Noise {
    fn new(covariances: Vec<DMatrix<f64>>) -> Noise {
        // Positive definite by construction; if rounding breaks this, independent values of the same spread replace it.
        let factor = |covariance: &DMatrix<f64>| {
            WhiteningFactor::new(covariance.clone()).unwrap_or_else(|| {
                let (n, variance) = (covariance.nrows(), covariance.diagonal().mean());
                WhiteningFactor::independent(n, variance.max(f64::MIN_POSITIVE).sqrt())
            })
        };
        let factors = covariances.iter().map(factor).collect();
        Noise { covariances: Arc::new(covariances), factors: Arc::new(factors) }
    }
}

impl Linearised {
    pub(crate) fn new(study: &Study) -> Result<Linearised, PredictError> {
        let nothing = study.nothing();
        let base = study.predict(&nothing)?;
        let machine = LinearisedMachine::of(&base.run);
        let changes = nuisance_changes(study, &nothing, &base, &machine);
        let noise = Noise::new(covariances(study, &nothing, &base, &changes));
        Ok(Linearised { machine, ..Linearised::with(study, nothing, base, changes, noise) })
    }

    /// Whitening by the noise of the outputs alone, without derivatives.
    pub(crate) fn of_noise_alone(study: &Study) -> Result<Linearised, PredictError> {
        let nothing = study.nothing();
        let base = study.predict(&nothing)?;
        let noise = Noise::new(covariances(study, &nothing, &base, &[]));
        Ok(Linearised::without_columns(nothing, base, noise))
    }

    pub(crate) fn at(&self, study: &Study, hypothesis: &Hypothesis) -> Result<Linearised, PredictError> {
        let base = study.predict(hypothesis)?;
        let machine = LinearisedMachine::of(&base.run);
        let changes = nuisance_changes(study, hypothesis, &base, &machine);
        let there = Linearised::with(study, hypothesis.clone(), base, changes, self.noise.clone());
        Ok(Linearised { machine, ..there })
    }

    fn without_columns(hypothesis: Hypothesis, base: Prediction, noise: Noise) -> Linearised {
        let (columns, products) = (Vec::new(), Vec::new());
        let (machine, further) = (LinearisedMachine::of(&base.run), Mutex::default());
        Linearised { hypothesis, base, machine, noise, columns, products, further }
    }

    fn with(
        study: &Study,
        hypothesis: Hypothesis,
        base: Prediction,
        mut columns: Vec<Vec<f64>>,
        noise: Noise,
    ) -> Linearised {
        let mut linearised = Linearised::without_columns(hypothesis, base, noise);
        for column in &mut columns {
            linearised.whiten(study, column);
        }
        linearised.products =
            (0..study.steps.len()).map(|step| products_of_step(study, &columns, step)).collect();
        linearised.columns = columns;
        linearised
    }

    /// Whitened change due to one effect more, instead of one of its family; computed once, because effects change each other by little.
    pub(crate) fn change(&self, study: &Study, effect: usize, values: Vec<f64>) -> Change {
        let key = (effect, values.iter().map(|value| value.to_bits()).collect());
        let known = || self.further.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(change) = known().get(&key) {
            return change.clone();
        }
        let mut base = self.hypothesis.clone();
        base.effects.retain(|(index, _)| study.family(*index) != effect);
        let mut with = base.clone();
        with.effects.push((effect, values));
        let change = || {
            let (base, with) = if base == self.hypothesis {
                (self.base.clone(), study.predict_linearly(&with, &self.machine).ok()?)
            } else {
                let base = study.predict(&base).ok()?;
                let with = study.predict_near(&with, &base).ok()?;
                (base, with)
            };
            let mut change: Vec<f64> = with.values.iter().zip(&base.values).map(|(w, b)| w - b).collect();
            self.whiten(study, &mut change);
            Some(Arc::new(change))
        };
        let change = change();
        known().insert(key, change.clone());
        change
    }

    pub(crate) fn whiten(&self, study: &Study, values: &mut [f64]) {
        for (group, factor) in study.groups.iter().zip(self.noise.factors.iter()) {
            factor.whiten(&mut values[group.rows.clone()]);
        }
    }

    /// Covariance of the values of one group due to noise and uncertain inputs, unit squared.
    pub(crate) fn covariance(&self, group: usize) -> &DMatrix<f64> {
        &self.noise.covariances[group]
    }

    pub(crate) fn whiten_group(&self, group: usize, values: &mut [f64]) {
        self.noise.factors[group].whiten(values);
    }

    pub(crate) fn residual(&self, study: &Study, prediction: &Prediction) -> Vec<f64> {
        let mut residual: Vec<f64> =
            study.measured.iter().zip(&prediction.values).map(|(seen, predicted)| seen - predicted).collect();
        self.whiten(study, &mut residual);
        residual
    }

    pub(crate) fn residual_of(
        &self,
        study: &Study,
        hypothesis: &Hypothesis,
    ) -> Result<Vec<f64>, PredictError> {
        Ok(self.residual(study, &study.predict(hypothesis)?))
    }
}

/// Change per sigma of each nuisance at a hypothesis, computed in parallel.
pub(crate) fn nuisance_changes(
    study: &Study,
    here: &Hypothesis,
    base: &Prediction,
    machine: &LinearisedMachine,
) -> Vec<Vec<f64>> {
    let indices: Vec<usize> = (0..study.nuisances.len()).collect();
    parallel::map(&indices, |index| {
        let nuisance = study.nuisances[*index];
        if let NuisanceKind::Delay(output) = nuisance.kind {
            let mut change = vec![0.0; base.values.len()];
            for group in study.groups.iter().filter(|group| group.output == output) {
                for row in group.rows.clone() {
                    change[row] = -nuisance.sigma * base.slopes[row];
                }
            }
            return change;
        }
        if let NuisanceKind::Structure(output, part) = nuisance.kind {
            let mut change = vec![0.0; base.values.len()];
            for (row, whole) in repeating_part(study, output, part) {
                change[row] = nuisance.sigma * whole;
            }
            return change;
        }
        let mut moved = here.clone();
        // Step towards the centre, so that a nuisance at its limit stays within it.
        let step = if here.nuisances[*index] > 0.0 { -1.0 } else { 1.0 };
        moved.nuisances[*index] += step;
        match study.predict_linearly(&moved, machine) {
            Ok(there) => {
                there.values.iter().zip(&base.values).map(|(there, here)| (there - here) / step).collect()
            }
            // A tolerance that stops the model gives no derivative and stays at its value.
            Err(_) => vec![0.0; base.values.len()],
        }
    })
}

/// Rows of a step; its groups are contiguous.
pub(crate) fn rows_of_step(study: &Study, step: usize) -> std::ops::Range<usize> {
    let mut of_step = study.groups.iter().filter(|group| group.step == step);
    let first = of_step.next().map_or(0..0, |group| group.rows.clone());
    of_step.fold(first, |all, group| all.start..group.rows.end)
}

fn products_of_step(study: &Study, columns: &[Vec<f64>], step: usize) -> DMatrix<f64> {
    let rows = rows_of_step(study, step);
    let n = columns.len();
    let mut products = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let product = dot(&columns[i][rows.clone()], &columns[j][rows.clone()]);
            products[(i, j)] = product;
            products[(j, i)] = product;
        }
    }
    products
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Position on the speed line beyond which a jump runs along or across the surge line: flow and outlet pressure are then too sensitive to be
/// used in it. Bound: the last fortieth, in which the slope of a speed line vanishes.
pub(crate) const NEAR_SURGE: f64 = 0.975;
/// Time after the last surge cycle in which no reading counts, s. Bound: its end is chaotic, and the shaft takes some seconds to recover.
const AFTER_SURGE_S: f64 = 15.0;
/// Shortest time constant of noise, s. Bound: shorter than any sample interval, as white as none.
const MIN_NOISE_S: f64 = 1e-3;
/// Standard deviation of a time that is anywhere in an interval of one. Source: 1/sqrt(12).
const UNIFORM_SIGMA: f64 = 0.288_675_134_594_812_9;
/// Tenths of a millisecond in a second, to which times of blocks are compared. Source: a definition.
const PER_TENTH_MS: f64 = 1e4;
/// Squared length of a whitened signature that counts as none. Bound: a thousandth of a sigma over the whole recording.
pub(crate) const NO_ENERGY: f64 = 1e-6;

/// For each step, the time after its jump, s, in which flow and outlet pressure are uninformative, and that in which all readings are.
fn lost_to_surge(study: &Study, nothing: &Hypothesis) -> Vec<(f64, f64)> {
    let Ok(positions) = study.surge_positions(nothing) else {
        return vec![(JUMP_S, 0.0); study.steps.len()];
    };
    let last = |step: usize| positions.get(step).and_then(|of_step| of_step.last());
    let near = |step: usize| last(step).is_none_or(|(_, position)| *position > NEAR_SURGE);
    let lost = |step: usize| {
        let jump_s = if near(step) || (step > 0 && near(step - 1)) { JUMP_S } else { 0.0 };
        let in_surge = positions[step].iter().filter(|(_, position)| *position > 1.0);
        let ends_s = in_surge.map(|(since_s, _)| since_s + AFTER_SURGE_S).fold(0.0, f64::max);
        (jump_s, ends_s)
    };
    (0..study.steps.len())
        .map(|step| if study.steps[step].jumped { lost(step) } else { (0.0, 0.0) })
        .collect()
}

fn covariances(
    study: &Study,
    nothing: &Hypothesis,
    base: &Prediction,
    changes: &[Vec<f64>],
) -> Vec<DMatrix<f64>> {
    let lost_to_surge = lost_to_surge(study, nothing);
    let structural = step_errors(study, &base.slopes);
    // Response of every value to a unit of each input, from the response to its offset.
    let responses: Vec<(InputNoise, &Vec<f64>, f64)> = INPUT_CHANNELS
        .iter()
        .zip(study.inputs.noise())
        .filter_map(|(channel, noise)| {
            let place = study.nuisances.iter().position(|n| n.kind == NuisanceKind::Offset(*channel))?;
            let noise = noise.filter(|noise| noise.sigma > 0.0)?;
            Some((noise, changes.get(place)?, study.nuisances[place].sigma))
        })
        .collect();
    let colour = study.declared.noise_colour;
    let noise = ColouredNoise::new(colour.first_order_share_ratio, colour.time_constant_s.max(MIN_NOISE_S));
    let mut cache: BTreeMap<Vec<(usize, i64)>, DMatrix<f64>> = BTreeMap::new();
    study
        .groups
        .iter()
        .enumerate()
        .map(|(place, group)| {
            let blocks: Vec<_> =
                group.blocks.iter().map(|i| study.steps[group.step].blocks[*i].clone()).collect();
            let times: Vec<&[f64]> =
                blocks.iter().map(|block| &study.table.t_s[block.samples.clone()]).collect();
            // Blocks with times equal to a tenth of a millisecond share one covariance.
            let key = blocks
                .iter()
                .map(|b| (b.samples.len(), ((b.mean_s - blocks[0].mean_s) * PER_TENTH_MS).round() as i64))
                .collect::<Vec<_>>();
            let unit = cache.entry(key).or_insert_with(|| covariance_of_means(&times, noise));
            let sigma = study.declared.noise_sigma(OUTPUTS[group.output]);
            let mut covariance = unit.clone() * (sigma * sigma);
            if OUTPUTS[group.output] != Channel::P3 {
                for (input, change, offset_sigma) in &responses {
                    let gain: Vec<f64> =
                        change[group.rows.clone()].iter().map(|c| c / offset_sigma * input.sigma).collect();
                    for i in 0..gain.len() {
                        for j in 0..gain.len() {
                            let apart_s = (blocks[i].mean_s - blocks[j].mean_s).abs();
                            covariance[(i, j)] += gain[i] * gain[j] * (-apart_s / input.correlation_s).exp();
                        }
                    }
                }
            }
            // Scatter of the sample times adds uncertainty to moving quantities.
            for (i, (block, row)) in blocks.iter().zip(group.rows.clone()).enumerate() {
                let samples = block.samples.len().max(1) as f64;
                covariance[(i, i)] += (base.slopes[row] * study.scatter_s).powi(2) / samples;
            }
            // A sample shows the time of a command to within its interval, and all of a ramp is as late. A jump is timed by P3.
            if study.steps[group.step].ramped {
                let late_s = study.table.interval_s * UNIFORM_SIGMA;
                let late: Vec<f64> = group.rows.clone().map(|row| base.slopes[row] * late_s).collect();
                for i in 0..late.len() {
                    for j in 0..late.len() {
                        covariance[(i, j)] += late[i] * late[j];
                    }
                }
            }
            let (jump_s, surge_s) = lost_to_surge[group.step];
            let moves = matches!(OUTPUTS[group.output], Channel::CompressorFlow | Channel::P2);
            let lost_s = if moves { jump_s.max(surge_s) } else { surge_s };
            for (i, _) in blocks.iter().enumerate().filter(|(_, block)| block.since_jump_s < lost_s) {
                covariance[(i, i)] += (UNINFORMATIVE * sigma).powi(2);
            }
            for more in [&study.other_noise, &structural].into_iter().filter_map(|errors| errors.get(place)) {
                covariance += more;
            }
            covariance
        })
        .collect()
}
