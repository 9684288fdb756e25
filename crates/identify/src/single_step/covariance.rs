//! Covariance of the fit of one step, and the errors that noise does not show.
//!
//! The residual is modelled as the sum of a white and a first-order process. Two quadratic forms of the residual give their variances,
//! corrected for the degrees of freedom of the fit (Rao's MINQUE, which is unbiased). The parameters' covariance is `(J'J)^-1 J' Omega J
//! (J'J)^-1`: ordinary least squares with the actual noise. The noise of the regressors (T1, Tc, flow, pressures) is in the residual and thus
//! in the result.

use crate::single_step::fit::{Fit, Geometry, dot, products, t2_k};
use crate::step_data::samples::{Row, Samples};
use crate::{IdentifyConfig, NoiseColour};
use mapper_core::Channel;
use mapper_numerics::coloured_noise::{ColouredNoise, correlate};
use mapper_physics::gas::air::Air;
use nalgebra::Matrix2;

/// Variances of the two parts of the residual, K2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoiseVariances {
    pub(crate) white_k2: f64,
    pub(crate) first_order_k2: f64,
}

impl NoiseVariances {
    /// Splits a total variance, K2, as declared.
    pub(crate) fn split(total_k2: f64, noise: ColouredNoise) -> Self {
        NoiseVariances {
            white_k2: noise.white_variance_ratio() * total_k2,
            first_order_k2: noise.first_order_variance_ratio() * total_k2,
        }
    }
}

/// Products of the first-order part's correlation matrix with the columns of the fit.
pub(crate) struct Correlation {
    /// `J' R J`.
    jrj: Matrix2<f64>,
    inverse_normal: Matrix2<f64>,
    variances: NoiseVariances,
}

impl Correlation {
    /// Prepares the noise estimate of a fit with samples at `t_s`.
    pub(crate) fn of(fit: &Fit, t_s: &[f64], colour: NoiseColour) -> Self {
        let (g, jacobian) = (&fit.inverse_normal, &fit.jacobian);
        let smoothed = [0, 1].map(|i| correlate(t_s, &jacobian[i], colour.time_constant_s));
        let jrj = products(jacobian, &smoothed);
        let jrrj = products(&smoothed, &smoothed);
        let n = t_s.len() as f64;
        let g_jrj = g * jrj;
        // Sum of squared correlations: the square of a first-order correlation has half the time constant.
        let ones = vec![1.0; t_s.len()];
        let squares: f64 = correlate(t_s, &ones, 0.5 * colour.time_constant_s).iter().sum();
        // Traces of M, M R and M R M R with M = 1 - J (J'J)^-1 J'.
        let trace_m = n - 2.0;
        let trace_mr = n - g_jrj.trace();
        let trace_mrmr = squares - 2.0 * (g * jrrj).trace() + (g_jrj * g_jrj).trace();
        let residual = &fit.residual_k;
        let white_form = dot(residual, residual);
        let smoothed_residual = correlate(t_s, residual, colour.time_constant_s);
        let correlated_form = dot(residual, &smoothed_residual);
        let determinant = trace_m * trace_mrmr - trace_mr * trace_mr;
        let white_k2 = (white_form * trace_mrmr - correlated_form * trace_mr) / determinant;
        let first_order_k2 = (trace_m * correlated_form - trace_mr * white_form) / determinant;
        let alone = |form: f64, trace: f64| if trace > 0.0 { form / trace } else { 0.0 };
        let variances = if determinant <= 0.0 || !first_order_k2.is_finite() || first_order_k2 <= 0.0 {
            NoiseVariances { white_k2: alone(white_form, trace_m), first_order_k2: 0.0 }
        } else if white_k2 <= 0.0 {
            NoiseVariances { white_k2: 0.0, first_order_k2: alone(correlated_form, trace_mrmr) }
        } else {
            NoiseVariances { white_k2, first_order_k2 }
        };
        Correlation { jrj, inverse_normal: *g, variances }
    }

    /// Standard errors of eta and h from the residual.
    pub(crate) fn standard_errors(&self) -> [f64; 2] {
        self.standard_errors_for(self.variances)
    }

    /// Standard errors of eta and h under given noise of T2.
    pub(crate) fn standard_errors_for(&self, variances: NoiseVariances) -> [f64; 2] {
        let g = &self.inverse_normal;
        let covariance = variances.white_k2 * g + variances.first_order_k2 * (g * self.jrj * g);
        covariance.diagonal().map(|variance| variance.max(0.0).sqrt()).into()
    }
}

// Effect of each sensor's declared uncertainty on T2 and on the fitted parameters.
// Linearised: a sensor offset changes the fitted T2 by its sensitivity. The parameters respond as to the same change of the measured T2, with
// opposite sign. Sensors are independent, so squares add.

/// Step of a derivative by a reading, relative. Bound: between rounding and curvature.
pub(crate) const READING_STEP_RATIO: f64 = 1e-5;

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct DeclaredEffect {
    /// Standard errors of eta and h from fixed offsets and gains.
    pub(crate) bias_standard_errors: [f64; 2],
    /// Signed effect of one standard deviation of each offset, each gain, the barometer, the humidity, the internal area and the assumed alpha_A,
    /// which all points share. The order depends on the declaration alone.
    pub(crate) common: [Vec<f64>; 2],
    /// Effect of the assumed alpha_A on eta and h, one standard deviation.
    pub(crate) assumed_alpha: [f64; 2],
    /// Variance of (measured minus fitted T2) from sample noise, K2. It is an upper bound for a probe with inertia, which smooths the
    /// gas-temperature noise from the other channels.
    pub(crate) noise_k2: f64,
}

/// Sums over all declared sensors.
pub(crate) fn declared_effect(
    fit: &Fit,
    samples: &Samples,
    geometry: Geometry,
    config: &IdentifyConfig,
) -> DeclaredEffect {
    let mut effect = DeclaredEffect::default();
    let mut squares = [0.0; 2];
    for channel in Row::CHANNELS {
        let Some(declared) = config.declared.get(&channel) else { continue };
        let sensitivity = sensitivity(fit, samples, geometry, channel);
        let rows = || sensitivity.iter().zip(&samples.rows);
        let by_offset_k = rows().map(|(s, _)| s * declared.offset_sigma).collect();
        let gain =
            |row: &Row| declared.gain_sigma_ratio * config.exact_at.gain_error(channel, row.read(channel));
        let by_gain_k = rows().map(|(s, row)| s * gain(row)).collect();
        for (change_k, sigma) in
            [(by_offset_k, declared.offset_sigma), (by_gain_k, declared.gain_sigma_ratio)]
        {
            // The probe's lag does not act on its own offset.
            let change_k: Vec<f64> = if channel == Channel::T2 { change_k } else { fit.read(change_k) };
            let response = fit.response(&change_k);
            squares[0] += response[0] * response[0];
            squares[1] += response[1] * response[1];
            if sigma > 0.0 {
                effect.push(response);
            }
        }
        let mean_square = sensitivity.iter().map(|s| s * s).sum::<f64>() / samples.len().max(1) as f64;
        effect.noise_k2 += mean_square * declared.noise_sigma * declared.noise_sigma;
    }
    let mut shared = Vec::new();
    if config.barometer_sigma_pa > 0.0 {
        let [p1, p2] = [Channel::P1, Channel::P2].map(|channel| sensitivity(fit, samples, geometry, channel));
        shared.push(p1.iter().zip(p2).map(|(p1, p2)| (p1 + p2) * config.barometer_sigma_pa).collect());
    }
    if config.housing_contact_sigma_ratio > 0.0 {
        // The inlet air comes from the cell: T1 is close enough for the distance of the housing.
        let by_tc = sensitivity(fit, samples, geometry, Channel::Tc);
        let rows = by_tc.iter().zip(&samples.rows);
        let changes = rows.map(|(by_tc, row)| {
            by_tc * config.housing_contact_sigma_ratio * (row.read(Channel::Tc) - row.t1_k)
        });
        shared.push(changes.collect());
    }
    if config.thermometer_sigma_k > 0.0 {
        let channels = [Channel::T1, Channel::T2, Channel::Tc];
        let [t1, t2, tc] = channels.map(|channel| sensitivity(fit, samples, geometry, channel));
        let all = t1.iter().zip(t2).zip(tc).map(|((t1, t2), tc)| (t1 + t2 + tc) * config.thermometer_sigma_k);
        shared.push(all.collect());
    }
    if config.humidity_sigma_kg_kg > 0.0 {
        let air = geometry.air.with_humidity(geometry.air.humidity_kg_kg() + config.humidity_sigma_kg_kg);
        let fitted_k = |row: &Row, air: Air| {
            t2_k(Geometry { air, ..geometry }, &row.compressing(air), fit.eta, fit.h_w_m2k)
        };
        let moved = |row| fitted_k(row, geometry.air) - fitted_k(row, air);
        shared.push(samples.rows.iter().map(moved).collect());
    }
    for change_k in shared {
        let response = fit.response(&fit.read(change_k));
        squares[0] += response[0] * response[0];
        squares[1] += response[1] * response[1];
        effect.push(response);
    }
    if config.internal_area_sigma_ratio > 0.0 {
        // A recording determines only h times the area.
        let by_area = -config.internal_area_sigma_ratio * fit.h_w_m2k;
        squares[1] += by_area * by_area;
        effect.push([0.0, by_area]);
    }
    effect.bias_standard_errors = squares.map(f64::sqrt);
    if config.alpha_area_sigma_ratio > 0.0 {
        // The effect of another alpha_A equals that of the same error of the measured T2.
        let fitted_k = |row: &Row, by: f64| {
            let geometry = Geometry { alpha_area_ratio: geometry.alpha_area_ratio + by, ..geometry };
            t2_k(geometry, row, fit.eta, fit.h_w_m2k)
        };
        // Step towards the middle, so that the share stays valid.
        let away = if geometry.alpha_area_ratio > 0.5 { -1.0 } else { 1.0 };
        let sigma = away * config.alpha_area_sigma_ratio;
        let moved_k = samples.rows.iter().map(|row| fitted_k(row, sigma) - fitted_k(row, 0.0)).collect();
        effect.assumed_alpha = fit.response(&fit.read(moved_k));
        effect.push(effect.assumed_alpha);
    }
    effect
}

impl DeclaredEffect {
    fn push(&mut self, response: [f64; 2]) {
        for (common, change) in self.common.iter_mut().zip(response) {
            common.push(change);
        }
    }
}

/// Derivative of (measured minus fitted T2) by the reading of a channel, per row.
fn sensitivity(fit: &Fit, samples: &Samples, geometry: Geometry, channel: Channel) -> Vec<f64> {
    if channel == Channel::T2 {
        return vec![1.0; samples.len()];
    }
    let of = |row: &Row| {
        let step = READING_STEP_RATIO * row.read(channel);
        let moved = |by: f64| t2_k(geometry, &row.moved(channel, by, geometry.air), fit.eta, fit.h_w_m2k);
        -(moved(step) - moved(-step)) / (2.0 * step)
    };
    samples.rows.iter().map(of).collect()
}
