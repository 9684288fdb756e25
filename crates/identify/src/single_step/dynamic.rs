//! Identifies each step by its transient, and the drift of the flow within it.

use crate::IdentifyConfig;
use crate::single_step::covariance::{Correlation, DeclaredEffect, NoiseVariances, declared_effect};
use crate::single_step::fit::{Fit, Geometry, fit};
use crate::step_data::samples::{Row, Samples, TREND_BLOCK_S, without_spikes};
use crate::step_data::{end_state, samples};
use crate::step_outcome::findings::{Findings, judge_interval};
use mapper_core::{
    BudgetRow, Channel, EstimateUncertainty, FitFailure, NoCompression, PoorFit, Recording, TooFew, Warning,
    Window,
};
use mapper_numerics::coloured_noise::variance_of_mean;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{DOUBT_SIGMAS, mean};
use mapper_physics::laws::compression::compressed_k;
use mapper_physics::laws::convection::coefficient_w_m2k;
use mapper_physics::machine::params::{CompressorParams, Params};

/// Result of a method for one step.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Estimate {
    pub(crate) eta: Option<(f64, Option<EstimateUncertainty>)>,
    pub(crate) h_w_m2k: Option<(f64, Option<EstimateUncertainty>)>,
    /// 95 % intervals of eta and h if they are not normally distributed.
    pub(crate) intervals: Option<[(f64, f64); 2]>,
    /// Effect of the points' common errors on eta and h: see [`CommonErrors`](mapper_core::CommonErrors).
    pub(crate) common: [Vec<f64>; 2],
    /// Change of eta by one standard deviation of the errors of readings that it depends on; empty if the method does not separate them.
    pub(crate) eta_errors: Vec<(ReadingError, f64)>,
    /// Sources of the uncertainty of eta and h; empty if the method does not separate them.
    pub(crate) budgets: [Vec<BudgetRow>; 2],
    pub(crate) window: Option<Window>,
    pub(crate) residual_rms_k: Option<f64>,
    pub(crate) dt2_k: Option<f64>,
    pub(crate) dtc_k: Option<f64>,
    /// Readings that the method predicts; empty if it predicts none.
    pub(crate) fitted: Vec<FittedReadings>,
}

/// An error of readings that may also move the identified efficiency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ReadingError {
    Offset(Channel),
    Gain(Channel),
    Barometer,
}

/// Readings of a channel over the window of a step, and the same by the fit that gave the point.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedReadings {
    /// T2, or Tc by the heat balance of the housing.
    pub channel: Channel,
    /// Run time, s; means over blocks if the method condenses the samples.
    pub t_s: Vec<f64>,
    /// Measured, K.
    pub read_k: Vec<f64>,
    /// By the fit, K.
    pub fitted_k: Vec<f64>,
}

/// Identifies each step that has an end state and adds findings; other steps get no result.
pub(crate) fn alone<S: Sync, E: Sync>(
    recording: &Recording,
    states: &[Result<S, E>],
    config: &IdentifyConfig,
) -> (Vec<Estimate>, Vec<Findings>) {
    let positions: Vec<usize> = (0..states.len()).collect();
    let of = |position: &usize| {
        let mut own = Findings::new();
        match &states[*position] {
            Ok(_) => (estimate(recording, *position, config, &mut own), own),
            Err(_) => (Estimate::default(), own),
        }
    };
    parallel::map(&positions, of).into_iter().unzip()
}

pub(crate) fn estimate(
    recording: &Recording,
    position: usize,
    config: &IdentifyConfig,
    findings: &mut Findings,
) -> Estimate {
    let mut estimate = Estimate::default();
    let Some(step) = recording.steps.get(position) else { return estimate };
    let limits = &config.thresholds;
    if !samples::begins_with_jump(&recording.steps, position) {
        findings.refuse(Warning::NoTransient);
        return estimate;
    }
    let Some(window) = end_state::choose(recording, step, config.window, &config.settle_bands, findings)
    else {
        let short = TooFew::ShortStep { step_s: step.end_s - step.start_s };
        findings.refuse(Warning::TooFewSamples(short));
        return estimate;
    };
    estimate.window = Some(window);
    let samples = without_spikes(Samples::of(recording, window, config, true), findings);
    if !enough(&samples, config, findings) {
        return estimate;
    }
    estimate.dt2_k = samples.change(|row| row.t2_k, limits.end_mean_s);
    estimate.dtc_k = samples.change(|row| row.tc_k, limits.end_mean_s);
    let rise_ratio = samples.mean(|row| row.rise_ratio).unwrap_or(0.0);
    if rise_ratio <= 0.0 {
        findings.refuse(Warning::NoCompression(NoCompression::NoPressureRise));
        return estimate;
    }
    let geometry = Geometry::of(config);
    let Some(fit) = fit(&samples, geometry) else {
        findings.refuse(Warning::FitFailed(FitFailure::Step));
        return estimate;
    };
    estimate.residual_rms_k = Some(fit.residual_rms_k());
    let read_k: Vec<f64> = samples.rows.iter().map(|row| row.t2_k).collect();
    let fitted_k = read_k.iter().zip(&fit.residual_k).map(|(read, residual)| read - residual).collect();
    estimate.fitted = vec![FittedReadings { channel: Channel::T2, t_s: samples.times_s(), read_k, fitted_k }];
    if let Some(bound) = fit.at_bound() {
        findings.refuse(Warning::AtBound(bound));
        return estimate;
    }
    let declared = declared_effect(&fit, &samples, geometry, config);
    let drift = flow_drift(&fit, &samples, limits.end_mean_s);
    let [eta, h] = uncertainties(&fit, &samples, config, &declared, drift);
    let sensors = EstimateUncertainty { bias_standard_error: declared.bias_standard_errors[0], ..eta };
    estimate.eta = Some((fit.eta, Some(eta)));
    estimate.h_w_m2k = Some((fit.h_w_m2k, Some(h)));
    let view = View { fit: &fit, samples: &samples, config, noise_k: declared.noise_k2.sqrt() };
    judge_width(&view, sensors, estimate.dt2_k, findings);
    judge_assumption(declared.assumed_alpha[0], config, findings);
    judge_flow(drift, config, findings);
    judge_residual(&view, estimate.dt2_k, findings);
    estimate.common = declared.common;
    estimate
}

/// Checks that the window holds enough complete samples, and adds a finding if not.
pub(crate) fn enough(samples: &Samples, config: &IdentifyConfig, findings: &mut Findings) -> bool {
    let limits = &config.thresholds;
    let (complete, lost, needed) = (samples.len(), samples.lost, limits.fewest_samples.max(3));
    if complete < needed {
        findings.refuse(Warning::TooFewSamples(TooFew::Samples { complete, lost, needed }));
        return false;
    }
    if lost > 0 {
        let samples = complete + lost;
        let warning = Warning::LostSamples { lost, samples };
        if lost as f64 > limits.lost_samples_ratio * samples as f64 {
            findings.doubt(warning);
        } else {
            findings.remark(warning);
        }
    }
    true
}

fn uncertainties(
    fit: &Fit,
    samples: &Samples,
    config: &IdentifyConfig,
    declared: &DeclaredEffect,
    drift: Option<FlowDrift>,
) -> [EstimateUncertainty; 2] {
    let correlation = Correlation::of(fit, &samples.times_s(), config.noise_colour);
    let found = correlation.standard_errors();
    // A short residual may have less noise than the sensors.
    let expected = correlation.standard_errors_for(NoiseVariances::split(declared.noise_k2, config.noise()));
    let moving = drift.map_or([0.0; 2], |drift| [drift.eta, drift.h_w_m2k]);
    let assumed = [0, 1].map(|i| moving[i].hypot(declared.assumed_alpha[i]));
    [0, 1].map(|i| EstimateUncertainty {
        noise_standard_error: found[i].max(expected[i]),
        bias_standard_error: declared.bias_standard_errors[i].hypot(assumed[i]),
    })
}

struct View<'a> {
    fit: &'a Fit,
    samples: &'a Samples,
    config: &'a IdentifyConfig,
    /// Standard deviation of (measured minus fitted T2) due to the declared noise, K.
    noise_k: f64,
}

/// Checks that the signal in the window is large enough. `eta`: uncertainty from noise and declared offsets.
fn judge_width(view: &View<'_>, eta: EstimateUncertainty, dt2_k: Option<f64>, findings: &mut Findings) {
    let limits = &view.config.thresholds;
    let (sigma_eta, dt2_k) = (eta.combined_standard_error(), dt2_k.unwrap_or(0.0));
    if sigma_eta <= limits.sigma_eta && dt2_k.abs() >= limits.dt2_k {
        return;
    }
    judge_interval(eta, dt2_k, false, view.config, findings);
}

/// Checks that the assumed alpha_A is known well enough. `off_eta`: its error of eta, one standard deviation.
pub(crate) fn judge_assumption(off_eta: f64, config: &IdentifyConfig, findings: &mut Findings) {
    if off_eta.abs() <= config.thresholds.sigma_eta {
        return;
    }
    findings.doubt(Warning::AssumedAlpha {
        alpha_area_ratio: config.alpha_area_ratio,
        alpha_area_sigma_ratio: config.alpha_area_sigma_ratio,
        eta_sigma: off_eta.abs(),
    });
}

/// Checks that the flow was constant enough for a constant h.
fn judge_flow(drift: Option<FlowDrift>, config: &IdentifyConfig, findings: &mut Findings) {
    let Some(drift) = drift.filter(|drift| drift.eta.abs() > config.thresholds.flow_drift_eta) else {
        return;
    };
    findings.doubt(Warning::FlowMoved {
        flow_change_ratio: drift.flow_ratio,
        eta_error: drift.eta,
        h_error_w_m2k: drift.h_w_m2k,
    });
}

/// Checks that the residual is only noise.
fn judge_residual(view: &View<'_>, dt2_k: Option<f64>, findings: &mut Findings) {
    let (fit, noise_k) = (view.fit, view.noise_k);
    let limits = &view.config.thresholds;
    let dt2_k = dt2_k.unwrap_or(0.0);
    findings.refuse_impossible(fit.eta);
    let (rms_k, slow_k) = (fit.residual_rms_k(), slow_rms_k(fit, view.samples));
    // Three standard deviations of the noise that remains in block means.
    let colour = view.config.noise();
    let remains =
        variance_of_mean(colour.first_order_variance_ratio(), TREND_BLOCK_S, colour.time_constant_s);
    let structure_k = DOUBT_SIGMAS * remains.sqrt() * noise_k;
    if noise_k > 0.0 && rms_k > limits.residual_over_noise_ratio * noise_k {
        findings.doubt(Warning::PoorFit(PoorFit::Noise { residual_k: rms_k, noise_k }));
    } else if slow_k > (limits.structure_ratio * dt2_k.abs()).max(structure_k) {
        let shape = PoorFit::Shape { residual_k: slow_k, block_s: TREND_BLOCK_S, dt2_k };
        findings.doubt(Warning::PoorFit(shape));
    }
    findings.remark_undeclared(view.config);
}

/// Root mean square of the residual's means over blocks, K.
fn slow_rms_k(fit: &Fit, samples: &Samples) -> f64 {
    let (mut start, mut sum, mut blocks) = (0, 0.0, 0.0);
    while start < samples.len() {
        let end_s = samples.rows[start].t_s + TREND_BLOCK_S;
        // At least one sample, so that the loop ends for any times.
        let end = samples.rows.partition_point(|row| row.t_s < end_s).max(start + 1);
        let block = mean(&fit.residual_k[start..end]).unwrap_or(0.0);
        (start, sum, blocks) = (end, sum + block * block, blocks + 1.0);
    }
    if blocks > 0.0 { (sum / blocks).sqrt() } else { 0.0 }
}

/// Changes of flow and h, and their effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FlowDrift {
    /// Ratio of the flow at the window's end to that at its start, minus 1.
    pub(crate) flow_ratio: f64,
    /// Estimated error of the fitted eta, fraction.
    pub(crate) eta: f64,
    /// Estimated error of the fitted h relative to h at the window's end, W/(m2 K).
    pub(crate) h_w_m2k: f64,
}

/// Estimates the error of a fit with constant h if h follows the correlation of Appendix A: the fit's response to the T2 change from
/// the variable h. Only the change of h matters, not the level of the correlation.
pub(crate) fn flow_drift(fit: &Fit, samples: &Samples, end_s: f64) -> Option<FlowDrift> {
    let rows = &samples.rows;
    let last_s = rows.last()?.t_s;
    let late = rows.partition_point(|row| row.t_s < last_s - end_s);
    let flow_end_kg_s = mean(rows[late..].iter().map(|row| row.flow_kg_s))?;
    let flow_change_kg_s = samples.change(|row| row.flow_kg_s, end_s)?;
    let compressor = Params::default().compressor;
    let relative: Vec<f64> = rows.iter().map(|row| relative_h(fit, row, &compressor)).collect();
    let end = mean(&relative[late..])?;
    let departure = relative.iter().map(|h| h / end - 1.0);
    let gas_k = departure.zip(&fit.gas_by_h).map(|(ratio, by_h)| by_h * fit.h_w_m2k * ratio).collect();
    let response = fit.response(&fit.read(gas_k));
    let drift = FlowDrift {
        flow_ratio: flow_change_kg_s / (flow_end_kg_s - flow_change_kg_s),
        eta: response[0],
        h_w_m2k: response[1],
    };
    (drift.flow_ratio.is_finite() && drift.eta.is_finite() && drift.h_w_m2k.is_finite()).then_some(drift)
}

/// The correlation's h of a sample: gas properties at the temperature after adiabatic compression, wall viscosity at the housing temperature.
fn relative_h(fit: &Fit, row: &Row, compressor: &CompressorParams) -> f64 {
    let bulk_k = compressed_k(row.t1_k, row.rise_ratio, fit.eta, compressor.air());
    coefficient_w_m2k(
        compressor.nusselt_coefficient,
        compressor.nusselt_exponent,
        compressor.outlet_diameter_m,
        row.flow_kg_s,
        bulk_k,
        row.tc_k,
    )
}
