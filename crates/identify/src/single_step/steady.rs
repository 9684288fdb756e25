//! Conventional mapping: the apparent efficiency from the temperature rise at the end of the step.
//!
//! Heat between gas and housing counts as work here. The dynamic method avoids the resulting error of the adiabatic efficiency (fig. 5 of the
//! paper).

use crate::IdentifyConfig;
use crate::single_step::covariance::READING_STEP_RATIO;
use crate::single_step::dynamic::{Estimate, enough};
use crate::step_data::samples::{Row, Samples, slope_per_s, without_spikes};
use crate::step_outcome::findings::{Findings, wide_interval};
use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, EstimateUncertainty, EtaSignal, NoCompression, Recording, Warning, Window};
use mapper_numerics::statistics::standard_deviation;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_physics::laws::thermocouple::time_constant_s;

/// Segment at the end of a step in which temperatures must not drift, s. Bound: with noise of 0.1 K its slope is then known to better
/// than 0.1 K/min.
const DRIFT_SPAN_S: f64 = 60.0;

/// The efficiency if heat between gas and housing counts as work.
pub(crate) fn apparent_eta(row: &Row, air: Air) -> f64 {
    let air = air.between(row.p1_pa, row.p2_pa);
    apparent_efficiency(row.p2_pa / row.p1_pa, row.t1_k, row.t2_k, air)
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
    let start_s = (step.end_s - limits.steady_mean_s).max(step.start_s);
    let window = Window { start_s, end_s: step.end_s };
    estimate.window = Some(window);
    let samples = without_spikes(Samples::of(recording, window, config, false), findings);
    if !enough(&samples, config, findings) {
        return estimate;
    }
    estimate.dt2_k = samples.change(|row| row.t2_k, limits.end_mean_s);
    estimate.dtc_k = samples.change(|row| row.tc_k, limits.end_mean_s);
    let of = |of: fn(&Row) -> f64| samples.mean(of).unwrap_or(f64::NAN);
    let trend_window = Window { start_s: (step.end_s - DRIFT_SPAN_S).max(step.start_s), end_s: step.end_s };
    let trend = Samples::of(recording, trend_window, config, false);
    let lag_k = lag_k(&samples, &trend, config);
    let means = Row {
        t_s: step.end_s,
        t1_k: of(|row| row.t1_k),
        t2_k: of(|row| row.t2_k) + lag_k,
        tc_k: of(|row| row.tc_k),
        p1_pa: of(|row| row.p1_pa),
        p2_pa: of(|row| row.p2_pa),
        flow_kg_s: of(|row| row.flow_kg_s),
        rise_ratio: of(|row| row.rise_ratio),
    };
    let eta = apparent_eta(&means, config.air);
    if !(eta.is_finite() && eta > 0.0) {
        findings.refuse(Warning::NoCompression(NoCompression::NoRise {
            rise_k: means.t2_k - means.t1_k,
            pressure_ratio: means.p2_pa / means.p1_pa,
        }));
        return estimate;
    }
    findings.refuse_impossible(eta);
    let (mut uncertainty, common) = uncertainty(&means, &samples, config);
    // The drift is not linear, so the correction may be wrong by its own size.
    let lag_eta = eta * lag_k / (means.t2_k - means.t1_k);
    uncertainty.bias_standard_error = uncertainty.bias_standard_error.hypot(lag_eta);
    for channel in [Channel::T2, Channel::Tc] {
        let readings = trend.rows.iter().map(|row| (row.t_s, row.read(channel)));
        let Some(drift_k_min) = slope_per_s(readings).map(|slope| S_PER_MIN * slope) else { continue };
        if drift_k_min.abs() > limits.steady_drift_k_min {
            let limit_k_min = limits.steady_drift_k_min;
            findings.doubt(Warning::NotSettled { channel, drift_k_min, limit_k_min });
        }
    }
    if uncertainty.combined_standard_error() > limits.sigma_eta {
        let signal = EtaSignal::Settled { rise_k: means.t2_k - means.t1_k };
        findings.doubt(wide_interval(uncertainty, signal));
    }
    findings.remark(Warning::Apparent);
    findings.remark_undeclared(config);
    estimate.eta = Some((eta, Some(uncertainty)));
    estimate.common[0] = common;
    estimate
}

/// Remaining lag of the declared probe behind the gas, K: its time constant times the drift of its reading.
fn lag_k(samples: &Samples, trend: &Samples, config: &IdentifyConfig) -> f64 {
    let means = samples.mean(|row| row.flow_kg_s).zip(samples.mean(|row| row.t2_k));
    let Some((flow_kg_s, t2_k)) = means else { return 0.0 };
    let tau_s = time_constant_s(config.probe_diameter_m, config.outlet_diameter_m, flow_kg_s, t2_k);
    slope_per_s(trend.rows.iter().map(|row| (row.t_s, row.t2_k))).map_or(0.0, |slope_k_s| tau_s * slope_k_s)
}

/// Noise from the scatter of the samples' own efficiencies (or the declared noise if larger), and offsets and gains one sensor at a time, barometer
/// and humidity. Also returns the change due to each, since all points share it.
pub(crate) fn uncertainty(
    means: &Row,
    samples: &Samples,
    config: &IdentifyConfig,
) -> (EstimateUncertainty, Vec<f64>) {
    let (mut common, mut declared_square) = (Vec::new(), 0.0);
    for channel in [Channel::T1, Channel::T2, Channel::P1, Channel::P2] {
        let Some(declared) = config.declared.get(&channel) else { continue };
        let value = means.read(channel);
        let step = READING_STEP_RATIO * value;
        let moved = |by: f64| apparent_eta(&means.moved(channel, by, config.air), config.air);
        let slope = (moved(step) - moved(-step)) / (2.0 * step);
        let by_gain = declared.gain_sigma_ratio * config.exact_at.gain_error(channel, value);
        let spreads = [declared.offset_sigma, by_gain];
        common.extend(spreads.iter().filter(|sigma| **sigma != 0.0).map(|sigma| slope * sigma));
        declared_square += (slope * declared.noise_sigma).powi(2);
    }
    let mut share = |sigma: f64, moved: &Row, air: Air| {
        let change = apparent_eta(moved, air) - apparent_eta(means, config.air);
        common.extend((sigma > 0.0).then_some(change));
    };
    let (by_pa, by_kg_kg) = (config.barometer_sigma_pa, config.humidity_sigma_kg_kg);
    let higher = means.moved(Channel::P1, by_pa, config.air).moved(Channel::P2, by_pa, config.air);
    share(by_pa, &higher, config.air);
    let by_k = config.thermometer_sigma_k;
    let warmer = means.moved(Channel::T1, by_k, config.air).moved(Channel::T2, by_k, config.air);
    share(by_k, &warmer, config.air);
    share(by_kg_kg, means, config.air.with_humidity(config.air.humidity_kg_kg() + by_kg_kg));
    let eta = |row: &Row| row.t1_k * row.rise_ratio / (row.t2_k - row.t1_k);
    let etas: Vec<f64> = samples.rows.iter().map(eta).filter(|eta| eta.is_finite()).collect();
    let scatter = standard_deviation(&etas).unwrap_or(0.0).powi(2);
    let ends = samples.rows.first().zip(samples.rows.last());
    let span_s = ends.map_or(0.0, |(first, last)| last.t_s - first.t_s);
    let averaging = config.noise().variance_of_mean(etas.len(), span_s);
    let noise_square = scatter.max(declared_square) * averaging;
    let bias_square: f64 = common.iter().map(|change: &f64| change * change).sum();
    let uncertainty = EstimateUncertainty {
        noise_standard_error: noise_square.sqrt(),
        bias_standard_error: bias_square.sqrt(),
    };
    (uncertainty, common)
}
