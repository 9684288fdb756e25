//! Conventional mapping: the apparent efficiency from the temperature rise at the end of the step.
//!
//! Heat between gas and housing counts as work here. The dynamic method avoids the resulting error of the adiabatic efficiency (fig. 5 of the
//! paper).

use crate::config::coloured;
use crate::single_step::dynamic::{Estimate, enough};
use crate::step_data::cleaning::without_spikes;
use crate::step_data::samples::{Samples, slope_per_s};
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, step_outcome::interval_width};
use mapper_core::{Channel, EstimateUncertainty, EtaSignal, NoCompression, Recording, Warning, Window};
use mapper_numerics::statistics::{mean, standard_deviation};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_physics::laws::thermocouple::time_constant_s;

/// Segment at the end of a step in which temperatures must not drift, s: with noise of 0.1 K its slope is then known to better than 0.1 K/min.
const DRIFT_SPAN_S: f64 = 60.0;

/// Means over the end of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Means {
    pub(crate) t1_k: f64,
    pub(crate) t2_k: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) air: Air,
}

impl Means {
    pub(crate) fn apparent_eta(&self) -> f64 {
        let air = self.air.between(self.p1_pa, self.p2_pa);
        apparent_efficiency(self.p2_pa / self.p1_pa, self.t1_k, self.t2_k, air)
    }

    fn moved(self, channel: Channel, by: f64) -> Self {
        let mut moved = self;
        match channel {
            Channel::T1 => moved.t1_k += by,
            Channel::T2 => moved.t2_k += by,
            Channel::P1 => moved.p1_pa += by,
            _ => moved.p2_pa += by,
        }
        moved
    }

    fn value(&self, channel: Channel) -> f64 {
        match channel {
            Channel::T1 => self.t1_k,
            Channel::T2 => self.t2_k,
            Channel::P1 => self.p1_pa,
            _ => self.p2_pa,
        }
    }
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
    let start_s = (step.end_s - limits.steady_mean_s).max(step.start_s);
    let window = Window { start_s, end_s: step.end_s };
    estimate.window = Some(window);
    let samples = without_spikes(Samples::of(recording, window, config, false), findings);
    if !enough(&samples, config, findings) {
        return estimate;
    }
    estimate.dt2_k = samples.change(&samples.t2_k, limits.end_mean_s);
    estimate.dtc_k = samples.change(&samples.tc_k, limits.end_mean_s);
    let of = |column: &[f64]| mean(column).unwrap_or(f64::NAN);
    let trend_window = Window { start_s: (step.end_s - DRIFT_SPAN_S).max(step.start_s), end_s: step.end_s };
    let trend = Samples::of(recording, trend_window, config, false);
    let lag_k = lag_k(&samples, &trend, config);
    let means = Means {
        air: config.air,
        t1_k: of(&samples.t1_k),
        t2_k: of(&samples.t2_k) + lag_k,
        p1_pa: of(&samples.p1_pa),
        p2_pa: of(&samples.p2_pa),
    };
    let eta = means.apparent_eta();
    if !(eta.is_finite() && eta > 0.0) {
        findings.refuse(Warning::NoCompression(NoCompression::NoRise {
            rise_k: means.t2_k - means.t1_k,
            pressure_ratio: means.p2_pa / means.p1_pa,
        }));
        return estimate;
    }
    let (mut uncertainty, common) = uncertainty(&means, &samples, config);
    // The drift is not linear, so the correction may be wrong by its own size.
    let lag_eta = eta * lag_k / (means.t2_k - means.t1_k);
    uncertainty.bias_standard_error = uncertainty.bias_standard_error.hypot(lag_eta);
    for (channel, column) in [(Channel::T2, &trend.t2_k), (Channel::Tc, &trend.tc_k)] {
        let Some(drift_k_min) = slope_per_s(&trend.t_s, column).map(|slope| 60.0 * slope) else { continue };
        if drift_k_min.abs() > limits.steady_drift_k_min {
            let limit_k_min = limits.steady_drift_k_min;
            findings.doubt(Warning::NotSettled { channel, drift_k_min, limit_k_min });
        }
    }
    if uncertainty.combined_standard_error() > limits.sigma_eta {
        let signal = EtaSignal::Settled { rise_k: means.t2_k - means.t1_k };
        findings.doubt(interval_width::wide(uncertainty, signal));
    }
    findings.remark(Warning::Apparent);
    findings.remark_undeclared(config);
    estimate.eta = Some((eta, Some(uncertainty)));
    estimate.common[0] = common;
    estimate
}

/// Remaining lag of the declared probe behind the gas, K: its time constant times the drift of its reading.
fn lag_k(samples: &Samples, trend: &Samples, config: &IdentifyConfig) -> f64 {
    let (Some(flow_kg_s), Some(t2_k)) = (mean(&samples.flow_kg_s), mean(&samples.t2_k)) else { return 0.0 };
    let tau_s = time_constant_s(config.probe_diameter_m, config.outlet_diameter_m, flow_kg_s, t2_k);
    slope_per_s(&trend.t_s, &trend.t2_k).map_or(0.0, |slope_k_s| tau_s * slope_k_s)
}

/// Noise from the scatter of the samples' own efficiencies (or the declared noise if larger), and offsets and gains one sensor at a time, barometer
/// and humidity. Also returns the change due to each, since all points share it.
pub(crate) fn uncertainty(
    means: &Means,
    samples: &Samples,
    config: &IdentifyConfig,
) -> (EstimateUncertainty, Vec<f64>) {
    let (mut common, mut declared_square) = (Vec::new(), 0.0);
    for channel in [Channel::T1, Channel::T2, Channel::P1, Channel::P2] {
        let Some(declared) = config.declared.get(&channel) else { continue };
        let value = means.value(channel);
        let step = 1e-5 * value;
        let slope = (means.moved(channel, step).apparent_eta() - means.moved(channel, -step).apparent_eta())
            / (2.0 * step);
        let spreads = [declared.offset_sigma, value * declared.gain_sigma_ratio];
        common.extend(spreads.iter().filter(|sigma| **sigma > 0.0).map(|sigma| slope * sigma));
        declared_square += (slope * declared.noise_sigma).powi(2);
    }
    let by_barometer = |by: f64| means.moved(Channel::P1, by).moved(Channel::P2, by).apparent_eta();
    let humid = |by: f64| {
        Means { air: means.air.with_humidity(means.air.humidity_kg_kg() + by), ..*means }.apparent_eta()
    };
    let mut share = |sigma: f64, eta: &dyn Fn(f64) -> f64| {
        common.extend((sigma > 0.0).then(|| eta(sigma) - means.apparent_eta()));
    };
    share(config.barometer_sigma_pa, &by_barometer);
    share(config.humidity_sigma_kg_kg, &humid);
    let etas: Vec<f64> = (0..samples.len())
        .map(|i| samples.t1_k[i] * samples.rise_ratio[i] / (samples.t2_k[i] - samples.t1_k[i]))
        .filter(|eta| eta.is_finite())
        .collect();
    let scatter = standard_deviation(&etas).unwrap_or(0.0).powi(2);
    let span_s = samples.t_s.last().copied().unwrap_or(0.0) - samples.t_s.first().copied().unwrap_or(0.0);
    let averaging = coloured(config.noise_colour).variance_of_mean(etas.len(), span_s);
    let noise_square = scatter.max(declared_square) * averaging;
    let bias_square: f64 = common.iter().map(|change: &f64| change * change).sum();
    let uncertainty = EstimateUncertainty {
        noise_standard_error: noise_square.sqrt(),
        bias_standard_error: bias_square.sqrt(),
    };
    (uncertainty, common)
}
