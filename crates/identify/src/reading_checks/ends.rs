//! The readings at the end of each step, when everything but the housing has settled; and the failed check of them.

use crate::IdentifyConfig;
use mapper_core::{Channel, Recording, Warning, is_reading};
use mapper_numerics::statistics::median;
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::compression::isentropic_rise_ratio;

/// Medians over the last seconds of a step, total pressures, SI (speed in rpm).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ends {
    pub(crate) position: usize,
    pub(crate) end_s: f64,
    pub(crate) valve_opening_ratio: f64,
    pub(crate) speed_rpm: f64,
    pub(crate) flow_kg_s: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) t1_k: f64,
    pub(crate) t2_k: f64,
    /// Housing; `None` if it was not recorded.
    pub(crate) tc_k: Option<f64>,
    /// Turbine side; `None` if it was not recorded.
    pub(crate) turbine_flow_kg_s: Option<f64>,
    pub(crate) t3_k: Option<f64>,
    pub(crate) t4_k: Option<f64>,
    /// The compressed air.
    pub(crate) air: Air,
    pub(crate) turbine_gas: Gas,
}

impl Ends {
    pub(crate) fn isentropic_rise_k(&self) -> f64 {
        self.t1_k * isentropic_rise_ratio(self.p2_pa / self.p1_pa, self.t1_k, self.air)
    }
}

/// One for each step; `None` if one of its compressor readings is missing.
pub(crate) fn ends(recording: &Recording, config: &IdentifyConfig) -> Vec<Option<Ends>> {
    let last_s = config.thresholds.steady_mean_s;
    recording
        .steps
        .iter()
        .enumerate()
        .map(|(position, step)| {
            let at = |channel: Channel| {
                let series = recording.series.get(&channel)?;
                let values = series.slice((step.end_s - last_s).max(step.start_s), step.end_s).1;
                median(values.iter().filter(|value| is_reading(channel, **value)))
            };
            let (flow_kg_s, t1_k, t2_k) = (at(Channel::CompressorFlow)?, at(Channel::T1)?, at(Channel::T2)?);
            let p1_pa = config.inlet_tap.total_pa(at(Channel::P1)?, flow_kg_s, t1_k);
            let p2_pa = config.outlet_tap.total_pa(at(Channel::P2)?, flow_kg_s, t2_k);
            let end = Ends {
                position,
                end_s: step.end_s,
                valve_opening_ratio: step.valve_opening_ratio,
                speed_rpm: at(Channel::ShaftSpeed)?,
                flow_kg_s,
                p1_pa,
                p2_pa,
                t1_k,
                t2_k,
                tc_k: at(Channel::Tc),
                turbine_flow_kg_s: at(Channel::TurbineFlow),
                t3_k: at(Channel::T3),
                t4_k: at(Channel::T4),
                air: config.air.between(p1_pa, p2_pa),
                turbine_gas: config.turbine_gas,
            };
            (end.p1_pa > 0.0 && end.p2_pa > 0.0 && end.isentropic_rise_k().is_finite()).then_some(end)
        })
        .collect()
}

/// A failed check of the readings, and the steps that depend on them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FailedCheck {
    /// Channel and values.
    pub(crate) warning: Warning,
    pub(crate) steps: Vec<usize>,
    /// Whether identification omits the samples concerned, so that the rest of the step can be used.
    pub(crate) samples_left_out: bool,
}

impl FailedCheck {
    pub(crate) fn new(warning: Warning, steps: Vec<usize>) -> Self {
        FailedCheck { warning, steps, samples_left_out: false }
    }

    /// A failed check that concerns all steps of a recording.
    pub(crate) fn of_all_steps(warning: Warning, recording: &Recording) -> Self {
        FailedCheck::new(warning, (0..recording.steps.len()).collect())
    }
}
