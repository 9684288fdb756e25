//! What noise in the model's inputs adds to the sum of squares, as a function of the probe's lag.
//!
//! T1, Tc, flow and pressures drive the predicted gas temperature, their noise included; the real gas knows nothing of
//! it. A probe that lags smooths the prediction and so removes some of that noise from the residual: least squares would
//! take every rig for one with a slow probe. The expected sum of squares of this noise is therefore taken off (corrected
//! least squares, e.g. Carroll et al., Measurement Error in Nonlinear Models, ch. 7). It is found by sending noise of the
//! declared kind the same way: smoothing, model, probe, whitening.

use crate::IdentifyConfig;
use crate::joint::model::Setting;
use crate::joint::parameters::{PROBE_MM2, SHARED, SharedVector};
use crate::joint::rows::StepRows;
use crate::joint::smoothing::Smoother;
use crate::joint::solve::Problem;
use mapper_core::Channel;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Diameters at which it is worked out, mm; between them the square counts.
const DIAMETERS_MM: [f64; 10] = [0.0, 0.25, 0.5, 0.8, 1.2, 1.7, 2.3, 3.2, 4.5, 7.0];
/// Draws of noise for each step: the scatter of their mean adds a sixteenth to that of the recording's own noise.
const DRAWS: usize = 16;

/// Expected sum of squares over the squares of diameters.
#[derive(Debug, Clone, Default)]
pub(crate) struct Explained {
    /// Second derivatives of a natural cubic spline, with its knots.
    squares_mm2: Vec<f64>,
    sums: Vec<f64>,
    curvatures: Vec<f64>,
    /// Variance of the slope between knots from one course of noise to another.
    slope_variances: Vec<f64>,
}

impl Explained {
    fn new(squares_mm2: Vec<f64>, draws: &[Vec<f64>]) -> Self {
        let count = (draws.len() as f64).max(1.0);
        let sums: Vec<f64> =
            (0..squares_mm2.len()).map(|i| draws.iter().map(|draw| draw[i]).sum::<f64>() / count).collect();
        let slope_variances = (1..squares_mm2.len())
            .map(|i| {
                let width = squares_mm2[i] - squares_mm2[i - 1];
                let mean = (sums[i] - sums[i - 1]) / width;
                let off = |draw: &Vec<f64>| ((draw[i] - draw[i - 1]) / width - mean).powi(2);
                draws.iter().map(off).sum::<f64>() / (count - 1.0).max(1.0) * (1.0 + 1.0 / count)
            })
            .collect();
        let n = squares_mm2.len();
        let mut curvatures = vec![0.0; n];
        let mut carried = vec![0.0; n];
        for i in 1..n.saturating_sub(1) {
            let (before, after) = (squares_mm2[i] - squares_mm2[i - 1], squares_mm2[i + 1] - squares_mm2[i]);
            let share = before / (before + after);
            let p = share * curvatures[i - 1] + 2.0;
            curvatures[i] = (share - 1.0) / p;
            let bend = (sums[i + 1] - sums[i]) / after - (sums[i] - sums[i - 1]) / before;
            carried[i] = (6.0 * bend / (before + after) - share * carried[i - 1]) / p;
        }
        for i in (0..n.saturating_sub(1)).rev() {
            curvatures[i] = curvatures[i] * curvatures[i + 1] + carried[i];
        }
        Explained { squares_mm2, sums, curvatures, slope_variances }
    }

    /// Variance of half the slope: how far the recording's own noise pulls the probe on top of what least squares sees.
    pub(crate) fn pull_variance(&self, square_mm2: f64) -> f64 {
        let after = self.squares_mm2.partition_point(|knot| *knot <= square_mm2);
        let segment = after.saturating_sub(1).min(self.slope_variances.len().saturating_sub(1));
        0.25 * self.slope_variances.get(segment).copied().unwrap_or(0.0)
    }

    /// Value and slope at the square of a diameter, mm2.
    pub(crate) fn at(&self, square_mm2: f64) -> (f64, f64) {
        let (Some(first), Some(last)) = (self.squares_mm2.first(), self.squares_mm2.last()) else {
            return (0.0, 0.0);
        };
        let x = square_mm2.clamp(*first, *last);
        let i = self.squares_mm2.partition_point(|knot| *knot <= x).clamp(1, self.squares_mm2.len() - 1);
        let width = self.squares_mm2[i] - self.squares_mm2[i - 1];
        let (a, b) = ((self.squares_mm2[i] - x) / width, (x - self.squares_mm2[i - 1]) / width);
        let (low, high) = (self.curvatures[i - 1], self.curvatures[i]);
        let value = a * self.sums[i - 1]
            + b * self.sums[i]
            + ((a * a * a - a) * low + (b * b * b - b) * high) * width * width / 6.0;
        let slope = (self.sums[i] - self.sums[i - 1]) / width
            + ((3.0 * b * b - 1.0) * high - (3.0 * a * a - 1.0) * low) * width / 6.0;
        if square_mm2 > *last { (value, 0.0) } else { (value, slope) }
    }
}

/// Works it out where the fit stands; nothing without a fitted probe or declared noise.
pub(crate) fn explained(problem: &Problem<'_>, steps: &[StepRows], config: &IdentifyConfig) -> Explained {
    let noisy: Vec<(usize, f64)> =
        [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2, Channel::CompressorFlow]
            .iter()
            .enumerate()
            .filter(|(_, channel)| **channel != Channel::T2)
            .filter_map(|(index, channel)| Some((index, config.declared.get(channel)?.noise_sigma)))
            .filter(|(_, sigma)| *sigma > 0.0)
            .collect();
    if !problem.probe_fitted || noisy.is_empty() {
        return Explained::default();
    }
    let squares_mm2: Vec<f64> = DIAMETERS_MM.iter().map(|diameter| diameter * diameter).collect();
    let mut draws = vec![vec![0.0; squares_mm2.len()]; DRAWS];
    // Always the same noise: the same recording gives the same result.
    let mut rng = Pcg64::seed_from_u64(1);
    for (member, step) in problem.members.iter().zip(steps).filter(|(member, _)| member.shares) {
        let rows = &step.rows;
        let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
        let smoother = Smoother::new(&t_s);
        let slopes = problem.setting.sensitivities(&step.end, &problem.shared, &member.local);
        let sigma_k = noisy.iter().map(|(index, sigma)| (slopes[*index] * sigma).powi(2)).sum::<f64>().sqrt();
        let gas_k: Vec<f64> = ideal_gas(&problem.setting, member, &problem.shared);
        let lags: Vec<_> =
            squares_mm2.iter().map(|square| problem.setting.lags(rows, &gas_k, *square)).collect();
        for sums in &mut draws {
            let noise = smoother.apply(&draw(&t_s, rows, config, sigma_k, &mut rng));
            for (sum, lags) in sums.iter_mut().zip(&lags) {
                // What the first row holds is the step's own parameter.
                let mut reading = noise.first().copied().unwrap_or(0.0);
                let mut readings = vec![reading];
                for (lag, pair) in lags.iter().zip(noise.windows(2)) {
                    reading = lag.next(reading, pair[0], pair[1]);
                    readings.push(reading);
                }
                member.whitening.apply(&mut readings);
                *sum += readings.iter().map(|r| r * r).sum::<f64>();
            }
        }
    }
    Explained::new(squares_mm2, &draws)
}

fn ideal_gas(setting: &Setting, member: &crate::joint::solve::Member<'_>, shared: &SharedVector) -> Vec<f64> {
    let mut ideal = *shared;
    ideal[PROBE_MM2] = 0.0;
    setting.predict(&member.course, &ideal, &member.local, &[false; SHARED], false).t2_k
}

/// One course of noise, block means.
fn draw(
    t_s: &[f64],
    rows: &[crate::joint::rows::Row],
    config: &IdentifyConfig,
    sigma: f64,
    rng: &mut Pcg64,
) -> Vec<f64> {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let mut last_s = f64::NEG_INFINITY;
    let mut coloured = 0.0;
    t_s.iter()
        .zip(rows)
        .map(|(t_s, row)| {
            let memory = ((last_s - t_s) / config.noise_colour.time_constant_s).exp();
            coloured = memory * coloured + (1.0 - memory * memory).max(0.0).sqrt() * normal();
            last_s = *t_s;
            sigma * (row.noise.first_order.sqrt() * coloured + row.noise.white.sqrt() * normal())
        })
        .collect()
}
