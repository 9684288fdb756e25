//! The dynamic method (Burke et al., section 3): efficiency and heat-transfer coefficient from the transient.

use crate::single_step::bias::{DeclaredEffect, declared_effect};
use crate::single_step::covariance::{Correlation, NoiseVariances};
use crate::single_step::fit::{Fit, Geometry, fit};
use crate::single_step::flow_drift::{FlowDrift, flow_drift};
use crate::step_data::cleaning::{SPIKE_SIGMAS, without_spikes};
use crate::step_data::samples::Samples;
use crate::step_data::window;
use crate::step_outcome::findings::{Findings, code};
use crate::{IdentifyConfig, step_data::commands, step_outcome::interval_width};
use mapper_core::{BudgetRow, EstimateUncertainty, Recording, Window};
use mapper_numerics::parallel;
use mapper_numerics::statistics::{mean, median, robust_sigma};

/// Ratio of isentropic temperature rise to inlet temperature below which the machine does not compress.
const SMALLEST_RISE_RATIO: f64 = 1e-3;
/// Number of neighbours of an outlier on either side: a lag of the probe moves them all, a spike only a few.
const OUTLIER_NEIGHBOURS: usize = 10;
/// Distance below which a sample is never taken for an outlier, K.
const OUTLIER_K: f64 = 1.0;
/// Block length over which the residual is averaged to detect a trend, s.
const STRUCTURE_BLOCK_S: f64 = 10.0;

/// Maximum share of the noise that remains in block means (first-order part, 2 s): four tenths of 0.6, twice.
const STRUCTURE_OVER_NOISE_RATIO: f64 = 0.75;

/// Advice if the model does not fit.
const POOR_FIT_REMEDY: &str = "declare the noise and the probe that T2 really has; `joint` finds probe and alpha_A, `mapper gap` looks for other causes";

/// Result of a method for one step.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Estimate {
    pub(crate) eta: Option<(f64, Option<EstimateUncertainty>)>,
    pub(crate) h_w_m2k: Option<(f64, Option<EstimateUncertainty>)>,
    /// 95 % intervals of eta and h if they are not normally distributed.
    pub(crate) intervals: Option<[(f64, f64); 2]>,
    /// Effect of the points' common errors on eta and h: see [`CommonErrors`](mapper_core::CommonErrors).
    pub(crate) common: [Vec<f64>; 2],
    /// Sources of the uncertainty of eta and h; empty if the method does not separate them.
    pub(crate) budgets: [Vec<BudgetRow>; 2],
    pub(crate) window: Option<Window>,
    pub(crate) residual_rms_k: Option<f64>,
    pub(crate) dt2_k: Option<f64>,
    pub(crate) dtc_k: Option<f64>,
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

/// Identifies the step at `position`.
pub(crate) fn estimate(
    recording: &Recording,
    position: usize,
    config: &IdentifyConfig,
    findings: &mut Findings,
) -> Estimate {
    let mut estimate = Estimate::default();
    let Some(step) = recording.steps.get(position) else { return estimate };
    let limits = &config.thresholds;
    if !commands::begins_with_jump(&recording.steps, position) {
        findings.refuse(
            code::NO_TRANSIENT,
            "no jump leads to this step, so it has no transient; the dynamic method needs one",
        );
        return estimate;
    }
    let Some(window) = window::choose(recording, step, config.window, &config.settle_bands, findings) else {
        let seconds = step.end_s - step.start_s;
        let message =
            format!("the step lasts {seconds:.1} s, which leaves no room for a window after its jump");
        findings.refuse(code::TOO_FEW_SAMPLES, message);
        return estimate;
    };
    estimate.window = Some(window);
    let samples = without_spikes(Samples::of(recording, window, config, true), findings);
    if !enough(&samples, config, findings) {
        return estimate;
    }
    estimate.dt2_k = samples.change(&samples.t2_k, limits.end_mean_s);
    estimate.dtc_k = samples.change(&samples.tc_k, limits.end_mean_s);
    let rise_ratio = mean(&samples.rise_ratio).unwrap_or(0.0);
    if rise_ratio < SMALLEST_RISE_RATIO {
        findings.refuse(
            code::NO_COMPRESSION,
            "the pressure ratio is 1 or less: nothing is compressed, efficiency has no meaning",
        );
        return estimate;
    }
    let geometry = Geometry::of(config);
    let Some((samples, fit)) = fit_without_outliers(samples, geometry, findings) else {
        findings.refuse(
            code::FIT_FAILED,
            "least squares for efficiency and heat-transfer coefficient did not converge",
        );
        return estimate;
    };
    estimate.residual_rms_k = Some(fit.residual_rms_k());
    if let Some(which) = fit.at_bound() {
        findings.refuse(
            code::AT_BOUND,
            format!("the best fit puts {which}, a bound of the search; no number is given"),
        );
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
    let (kept, lost) = (samples.len(), samples.lost);
    if kept < limits.fewest_samples.max(3) {
        let message = format!(
            "{kept} complete samples in the window ({lost} lost); at least {} are needed",
            limits.fewest_samples.max(3)
        );
        findings.refuse(code::TOO_FEW_SAMPLES, message);
        return false;
    }
    if lost > 0 {
        let message = format!("{lost} of {} samples in the window were lost and are left out", kept + lost);
        if lost as f64 > limits.lost_samples_ratio * (kept + lost) as f64 {
            findings.doubt(code::LOST_SAMPLES, message);
        } else {
            findings.remark(code::LOST_SAMPLES, message);
        }
    }
    true
}

/// Fits, removes outliers if they are few, and fits again.
fn fit_without_outliers(
    samples: Samples,
    geometry: Geometry,
    findings: &mut Findings,
) -> Option<(Samples, Fit)> {
    let first = fit(&samples, geometry)?;
    let limit_k = (SPIKE_SIGMAS * robust_sigma(&first.residual_k)?).max(OUTLIER_K);
    let last = samples.len().saturating_sub(1);
    let kept: Vec<bool> = (0..samples.len())
        .map(|i| {
            let residual_k = first.residual_k[i];
            if residual_k.abs() <= limit_k {
                return true;
            }
            let nearby = i.saturating_sub(OUTLIER_NEIGHBOURS)..=(i + OUTLIER_NEIGHBOURS).min(last);
            median(&first.residual_k[nearby]).is_some_and(|middle_k| (residual_k - middle_k).abs() <= limit_k)
        })
        .collect();
    let inlier = |i: usize| kept.get(i).copied().unwrap_or(false);
    let outliers = (0..samples.len()).filter(|i| !inlier(*i)).count();
    // Many outliers are not accidental: the fit is then poor and gets a finding.
    if outliers == 0 || outliers * 20 > samples.len() {
        return Some((samples, first));
    }
    let samples = samples.filtered(inlier);
    let second = fit(&samples, geometry)?;
    let message = format!(
        "{outliers} samples more than {limit_k:.1} K from the fit and from their neighbours are left out"
    );
    findings.remark(code::OUTLIERS, message);
    Some((samples, second))
}

fn uncertainties(
    fit: &Fit,
    samples: &Samples,
    config: &IdentifyConfig,
    declared: &DeclaredEffect,
    drift: Option<FlowDrift>,
) -> [EstimateUncertainty; 2] {
    let correlation = Correlation::of(fit, &samples.t_s, config.noise_colour);
    let found = correlation.standard_errors();
    // A short residual may have less noise than the sensors.
    let expected =
        correlation.standard_errors_for(NoiseVariances::split(declared.noise_k2, config.noise_colour));
    let moving = drift.map_or([0.0; 2], |drift| [drift.eta, drift.h_w_m2k]);
    let assumed = [0, 1].map(|i| moving[i].hypot(declared.assumed_alpha[i]));
    [0, 1].map(|i| EstimateUncertainty {
        noise_standard_error: found[i].max(expected[i]),
        bias_standard_error: declared.bias_standard_errors[i].hypot(assumed[i]),
    })
}

/// A fit with its data.
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
    interval_width::judge(eta, dt2_k, "", view.config, findings);
}

/// Checks that the assumed alpha_A is known well enough. `off_eta`: its error of eta, one standard deviation.
pub(crate) fn judge_assumption(off_eta: f64, config: &IdentifyConfig, findings: &mut Findings) {
    if off_eta.abs() <= config.thresholds.sigma_eta {
        return;
    }
    let message = format!(
        "alpha_A is assumed to be {} within {} (1 sigma), which leaves eta uncertain by {:.1} points; `joint` finds it",
        config.alpha_area_ratio,
        config.alpha_area_sigma_ratio,
        100.0 * off_eta.abs()
    );
    findings.doubt(code::ASSUMED_ALPHA, message);
}

/// Checks that the flow was constant enough for a constant h.
fn judge_flow(drift: Option<FlowDrift>, config: &IdentifyConfig, findings: &mut Findings) {
    let Some(drift) = drift.filter(|drift| drift.eta.abs() > config.thresholds.flow_drift_eta) else {
        return;
    };
    let message = format!(
        "the flow moved by {:+.1} % in the window and h with it, which the method assumes to be constant: eta is about {:+.1} points off, h about {:+.0} W/(m2 K)",
        100.0 * drift.flow_ratio,
        100.0 * drift.eta,
        drift.h_w_m2k
    );
    findings.doubt(code::FLOW_MOVED, message);
}

/// Checks that the residual is only noise.
fn judge_residual(view: &View<'_>, dt2_k: Option<f64>, findings: &mut Findings) {
    let (fit, noise_k) = (view.fit, view.noise_k);
    let limits = &view.config.thresholds;
    let dt2_k = dt2_k.unwrap_or(0.0);
    if fit.eta > 1.0 {
        let message = format!(
            "the fitted efficiency is {:.3}, above 1: something outside the method has an influence",
            fit.eta
        );
        findings.refuse(code::POOR_FIT, message);
    }
    let (rms_k, slow_k) = (fit.residual_rms_k(), slow_rms_k(fit, view.samples));
    if noise_k > 0.0 && rms_k > limits.residual_over_noise_ratio * noise_k {
        let message = format!(
            "the residual of T2 is {rms_k:.3} K rms; the declared noise explains {noise_k:.3} K: {POOR_FIT_REMEDY}"
        );
        findings.doubt(code::POOR_FIT, message);
    } else if slow_k > (limits.structure_ratio * dt2_k.abs()).max(STRUCTURE_OVER_NOISE_RATIO * noise_k) {
        let message = format!(
            "the residual of T2 has a shape: {slow_k:.3} K rms in {STRUCTURE_BLOCK_S:.0} s means, while T2 moves by {dt2_k:.1} K: {POOR_FIT_REMEDY}"
        );
        findings.doubt(code::POOR_FIT, message);
    }
    findings.remark_undeclared(view.config);
}

/// Root mean square of the residual's means over blocks, K.
fn slow_rms_k(fit: &Fit, samples: &Samples) -> f64 {
    let (mut start, mut sum, mut blocks) = (0, 0.0, 0.0);
    while start < samples.len() {
        let end_s = samples.t_s[start] + STRUCTURE_BLOCK_S;
        // At least one sample, so that the loop ends for any times.
        let end = samples.t_s.partition_point(|t| *t < end_s).max(start + 1);
        let block = mean(&fit.residual_k[start..end]).unwrap_or(0.0);
        (start, sum, blocks) = (end, sum + block * block, blocks + 1.0);
    }
    if blocks > 0.0 { (sum / blocks).sqrt() } else { 0.0 }
}
