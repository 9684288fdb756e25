//! The contribution of noise in the model's inputs to the sum of squares, as a function of the probe's lag.
//!
//! T1, Tc, flow and pressures drive the predicted gas temperature, including their noise, which the real gas does not see. A lagging probe
//! smooths the prediction and so removes some of that noise from the residual. Least squares would therefore find a slow probe on every rig.
//! The fit subtracts the expected sum of squares of this noise (corrected least squares, e.g. Carroll et al., Measurement Error in Nonlinear
//! Models, ch. 7). It comes from noise with the declared statistics that passes through the same smoothing, model, probe and whitening.

use crate::IdentifyConfig;
use crate::joint::fit::input_noise_spline::InputNoiseSpline;
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::step_model::model::Setting;
use crate::joint::step_model::parameters::{PROBE_MM2, SharedVector};
use crate::joint::step_model::rows::{Row, StepRows};
use crate::joint::step_model::smoothing::Smoother;
use crate::single_step::probe::follow;
use crate::step_data::samples;
use mapper_core::Channel;
use mapper_numerics::coloured_noise::memory;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Diameters at which it is computed, mm; the spline between them uses the square. Bound: the error of the spline is below that of the
/// draws.
const DIAMETERS_MM: [f64; 10] = [0.0, 0.25, 0.5, 0.8, 1.2, 1.7, 2.3, 3.2, 4.5, 7.0];
/// Noise samples per step. Bound: the scatter of their mean adds a sixteenth to that of the recording's own noise.
const DRAWS: usize = 16;

/// Computes it at the current parameters; `None` without a fitted probe or declared noise.
pub(crate) fn input_noise(
    problem: &Problem<'_>,
    steps: &[StepRows],
    config: &IdentifyConfig,
) -> InputNoiseSpline {
    let noisy: Vec<(usize, f64)> = samples::Row::CHANNELS
        .iter()
        .enumerate()
        .filter(|(_, channel)| **channel != Channel::T2)
        .filter_map(|(index, channel)| Some((index, config.declared.get(channel)?.noise_sigma)))
        .filter(|(_, sigma)| *sigma > 0.0)
        .collect();
    if !problem.probe_fitted || noisy.is_empty() {
        return InputNoiseSpline::default();
    }
    let squares_mm2: Vec<f64> = DIAMETERS_MM.iter().map(|diameter| diameter * diameter).collect();
    let mut draws = vec![vec![0.0; squares_mm2.len()]; DRAWS];
    // Fixed seed: the same recording gives the same result.
    let mut rng = Pcg64::seed_from_u64(1);
    for (member, step) in problem.members.iter().zip(steps).filter(|(member, _)| member.contributes) {
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
                // The first reading is a parameter of the step.
                let mut readings = follow(lags, noise.first().copied().unwrap_or(0.0), &noise);
                member.whitening.apply(&mut readings);
                *sum += readings.iter().map(|r| r * r).sum::<f64>();
            }
        }
    }
    InputNoiseSpline::new(squares_mm2, &draws)
}

fn ideal_gas(setting: &Setting, member: &Member<'_>, shared: &SharedVector) -> Vec<f64> {
    let mut ideal = *shared;
    ideal[PROBE_MM2] = 0.0;
    setting.predict_t2_k(&member.history, &ideal, &member.local)
}

/// One noise sequence, as block means.
fn draw(t_s: &[f64], rows: &[Row], config: &IdentifyConfig, sigma: f64, rng: &mut Pcg64) -> Vec<f64> {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let mut last_s = f64::NEG_INFINITY;
    let mut coloured = 0.0;
    t_s.iter()
        .zip(rows)
        .map(|(t_s, row)| {
            let memory = memory(t_s - last_s, config.noise_colour.time_constant_s);
            coloured = memory * coloured + (1.0 - memory * memory).max(0.0).sqrt() * normal();
            last_s = *t_s;
            sigma * (row.noise.first_order.sqrt() * coloured + row.noise.white.sqrt() * normal())
        })
        .collect()
}
