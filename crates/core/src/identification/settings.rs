//! Settings of an identification: criteria of acceptance, shared parameters, tolerances of the model, settle bands, windows.

use crate::Channel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Criteria of acceptance, with their source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcceptanceCriteria {
    /// Name of the code.
    pub name: String,
    /// Source of the values.
    pub source: String,
    /// Time at the end of a step over which the criteria are judged, s.
    pub window_s: f64,
    /// Permitted fluctuation of each channel: highest minus lowest reading, relative to the mean; temperatures and pressures absolute.
    pub fluctuation_ratio: BTreeMap<Channel, f64>,
    /// Permitted losses in the energy balance, relative to the turbine power.
    pub heat_balance_ratio: Option<f64>,
}

/// Window of criteria that do not define one, s. Bound: the gas has settled by then, and a step of 40 s is long enough.
pub const ACCEPTANCE_WINDOW_S: f64 = 20.0;

impl AcceptanceCriteria {
    /// ASME PTC 10-1997: the rows of table 3.4 that apply to a turbocharger.
    pub fn ptc_10() -> Self {
        /// Permissible fluctuations, as ratios. Source: ASME PTC 10-1997, table 3.4.
        const FLUCTUATIONS: [(Channel, f64); 6] = [
            (Channel::ShaftSpeed, 0.005),
            (Channel::P1, 0.02),
            (Channel::T1, 0.005),
            (Channel::P2, 0.02),
            (Channel::TWater, 0.005),
            (Channel::WaterFlow, 0.02),
        ];
        AcceptanceCriteria {
            name: "ASME PTC 10".to_owned(),
            source: "ASME PTC 10-1997, table 3.4, permissible fluctuations of test readings; the code is not public".to_owned(),
            window_s: ACCEPTANCE_WINDOW_S,
            fluctuation_ratio: FLUCTUATIONS.into(),
            heat_balance_ratio: None,
        }
    }
}

/// Whether a shared parameter keeps its declared value or is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::enums::flatten_to_names)]
pub enum Choice {
    /// As declared.
    Fixed,
    /// Estimated together with the points.
    #[default]
    Fitted,
}

/// The shared parameters of the joint method.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-removed" = { "direction": "write `heating_cooling_ratio: fixed` or `heating_cooling_ratio: fitted`" }))]
pub struct JointSettings {
    /// Share of the internal area before compression.
    pub alpha_area: Choice,
    /// Diameter of the T2 probe; `fixed` takes that of `sensors.T2.probe_diameter`.
    pub probe: Choice,
    /// Factor on the heat-transfer coefficient if the metal is hotter than the gas; 1 if `fixed`.
    pub heating_cooling_ratio: Choice,
    /// Whether the heat-transfer coefficient upstream of the wheel equals that downstream or follows the inlet's own diameter; as in
    /// `machine.geometry` if `fixed`.
    pub inlet_h: Choice,
    /// Offsets of the sensors, with their declared uncertainty as prior.
    pub offsets: Choice,
    /// Heat balance of the compressor housing as a second observation; only T2 is one if `fixed`.
    pub balance: Choice,
}

impl JointSettings {
    /// Keys of the parameters that are taken as declared.
    pub fn held_fixed(&self) -> Vec<String> {
        let parameters = [
            ("alpha_area", self.alpha_area),
            ("probe", self.probe),
            ("heating_cooling_ratio", self.heating_cooling_ratio),
            ("inlet_h", self.inlet_h),
            ("offsets", self.offsets),
            ("balance", self.balance),
        ];
        let fixed = parameters.into_iter().filter(|(_, choice)| *choice == Choice::Fixed);
        fixed.map(|(key, _)| key.to_owned()).collect()
    }
}

/// Default uncertainty of the assumed alpha_A, one standard deviation. Bound: if it has not been
/// measured, a tenth to a quarter of the area may lie before the wheel.
pub const ALPHA_AREA_SIGMA_RATIO: f64 = 0.15;

/// One-sigma tolerances of the nominal model (ratios to the nominal value) and of the rig's boundary conditions. A deviation within these
/// tolerances is not an effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelTolerances {
    /// Gain of the compressor's flow meter.
    pub flow_meter_gain_ratio: f64,
    /// Flow of the compressor map.
    pub flow_map_ratio: f64,
    /// Efficiency of the compressor map, the same everywhere.
    pub compressor_efficiency_ratio: f64,
    /// Error of the efficiency map that varies smoothly over the map.
    pub efficiency_shape_ratio: f64,
    /// Efficiency of the turbine.
    pub turbine_efficiency_ratio: f64,
    /// Area of the back-pressure valve.
    pub valve_area_ratio: f64,
    /// Convection between gas and compressor housing.
    pub convection_ratio: f64,
    /// Convection of both housings to the cell.
    pub external_convection_ratio: f64,
    /// Conductance to the oil.
    pub oil_conductance_ratio: f64,
    /// Compressor inlet pressure, Pa.
    pub inlet_pressure_pa: f64,
    /// Compressor inlet temperature, K.
    pub inlet_temperature_k: f64,
    /// Turbine inlet temperature, K.
    pub turbine_inlet_temperature_k: f64,
    /// Oil inlet temperature, K.
    pub oil_temperature_k: f64,
    /// Temperature around the housings, K.
    pub ambient_temperature_k: f64,
    /// Declared lag of P3 behind its command, s: a value, not a tolerance.
    pub actuator_lag_s: f64,
    /// Share of the delivered flow that returns from the wheel's outlet to its inlet.
    pub recirculation_ratio: f64,
    /// Share of the dynamic temperature that the T2 probe may miss.
    pub t2_recovery_ratio: f64,
    /// Conductance from the bearing housing to the gas behind the wheel, W/K.
    pub heat_behind_wheel_w_k: f64,
    /// Error of the model's equations.
    pub structure: StructureTolerances,
}

/// Share of each output's variation over a recording that the model's equations may miss, one sigma; 0 if they are those of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StructureTolerances {
    /// Shaft speed.
    pub shaft_speed_ratio: f64,
    /// Compressor mass flow.
    pub compressor_flow_ratio: f64,
    /// P2.
    pub p2_ratio: f64,
    /// T2.
    pub t2_ratio: f64,
    /// Tc.
    pub tc_ratio: f64,
    /// Turbine mass flow.
    pub turbine_flow_ratio: f64,
    /// T4.
    pub t4_ratio: f64,
    /// Tt.
    pub tt_ratio: f64,
}

impl StructureTolerances {
    /// The share of a channel; 0 for a channel that the model does not predict.
    pub fn of(mut self, channel: Channel) -> f64 {
        self.of_mut(channel).map_or(0.0, |ratio| *ratio)
    }

    /// The share of a channel; none for a channel that the model does not predict.
    pub fn of_mut(&mut self, channel: Channel) -> Option<&mut f64> {
        match channel {
            Channel::ShaftSpeed => Some(&mut self.shaft_speed_ratio),
            Channel::CompressorFlow => Some(&mut self.compressor_flow_ratio),
            Channel::P2 => Some(&mut self.p2_ratio),
            Channel::T2 => Some(&mut self.t2_ratio),
            Channel::Tc => Some(&mut self.tc_ratio),
            Channel::TurbineFlow => Some(&mut self.turbine_flow_ratio),
            Channel::T4 => Some(&mut self.t4_ratio),
            Channel::Tt => Some(&mut self.tt_ratio),
            _ => None,
        }
    }
}

impl Default for ModelTolerances {
    /// Typical values of a careful gas stand: half a percent for calibrated quantities, more for heat.
    fn default() -> Self {
        ModelTolerances {
            // Source: class 0.5 of flow meters.
            flow_meter_gain_ratio: 0.005,
            // Bound: the flow meter with which a map is measured.
            flow_map_ratio: 0.005,
            // Bound: the temperatures and pressures with which a map is measured.
            compressor_efficiency_ratio: 0.005,
            // Bound: their repeatability.
            efficiency_shape_ratio: 0.003,
            // Bound: unmixed gas at the probe for T4.
            turbine_efficiency_ratio: 0.01,
            // Bound: the flow meter with which a valve is calibrated.
            valve_area_ratio: 0.005,
            // Bound: a correlation that is calibrated on the machine; others scatter by 20 %.
            convection_ratio: 0.03,
            // Bound: draughts of a cell.
            external_convection_ratio: 0.10,
            // Bound: the viscosity of warm oil.
            oil_conductance_ratio: 0.05,
            // Bound: the weather within a shift.
            inlet_pressure_pa: 200.0,
            // Bound: the conditioning of a cell.
            inlet_temperature_k: 2.0,
            // Bound: the control of a burner.
            turbine_inlet_temperature_k: 10.0,
            // Bound: the control of an oil conditioner.
            oil_temperature_k: 5.0,
            // Bound: layers of air in a cell.
            ambient_temperature_k: 5.0,
            // Bound: fast pressure controllers.
            actuator_lag_s: 0.3,
            // Bound: a casing of unknown kind; plain ones leak 0.5 % over tips and seal, ported ones return 2 %, the end of the 95 % range.
            recirculation_ratio: 0.01,
            // Source: recovery of a shielded probe, 0.94 +/- 0.05 at Mach 0.2 (ASME J. Turbomach. 147, 051006); a bare one has 0.6 to 0.8.
            t2_recovery_ratio: 0.05,
            // Bound: a tenth of the film on a rotating disc of 60 mm at 50 krpm (Nu = 0.33 Re^0.5): the plate and its gap pass less.
            heat_behind_wheel_w_k: 0.04,
            structure: StructureTolerances::default(),
        }
    }
}

/// Maximum variation (maximum minus minimum) of each quantity, as a ratio of its mean: an operating point has settled at a time if the
/// variation from then to the end of the step is within these bands. The criterion is implemented only in the
/// `settled` module of `mapper-physics`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SettleBands {
    /// Shaft speed, ratio.
    pub speed_ratio: f64,
    /// Compressor flow, ratio.
    pub flow_ratio: f64,
    /// Pressure ratio, ratio.
    pub pressure_ratio_ratio: f64,
}

impl SettleBands {
    /// Source: the typical variations in section 3 of Burke et al.: 0.8 % in flow, 2 % in pressure ratio, 1.5 % in speed.
    pub const PAPER: SettleBands =
        SettleBands { speed_ratio: 0.015, flow_ratio: 0.008, pressure_ratio_ratio: 0.02 };
}

impl Default for SettleBands {
    fn default() -> Self {
        SettleBands::PAPER
    }
}

/// Part of each step that is evaluated by the methods that use the transient.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowRule {
    /// From the time when speed, flow and pressure ratio have settled to the end of the step.
    #[default]
    Auto,
    /// From `start_s` to `end_s` after the jump; cut at the step's end.
    Fixed {
        /// Start after the jump, s.
        start_s: f64,
        /// End after the jump, s; after the start, within the dwell.
        end_s: f64,
    },
}

impl WindowRule {
    /// Earliest start of an automatic window after the last change of a command, s. Source: the typical time in Burke et al.,
    /// and the time that probes of 1.5 mm need to follow.
    pub const EARLIEST_S: f64 = 10.0;
    /// Shortest useful window, s. Bound: a housing moves by a few of its uncertainties. A step that settles later uses a window of this length at its end, and is doubtful.
    pub const SHORTEST_S: f64 = 30.0;

    /// Fraction at the end of a step in which its operating point must have settled, for methods that evaluate the step from
    /// its jump on. The point's state is the mean of the last seconds, but an oscillating step may be steady for a moment only.
    /// Bound: several periods of a hunting controller.
    const SETTLED_END_RATIO: f64 = 0.25;

    /// Length of this part for a step of `dwell_s`, s: at most [`Self::SHORTEST_S`].
    pub fn settled_end_s(dwell_s: f64) -> f64 {
        (Self::SETTLED_END_RATIO * dwell_s).min(Self::SHORTEST_S)
    }

    /// Start and end of the window of a step that lasts `dwell_s`, s after its jump, if the operating point settles
    /// `settle_s` after the jump (`None`: never within the step).
    pub fn of_step_s(&self, settle_s: Option<f64>, dwell_s: f64) -> (f64, f64) {
        match *self {
            WindowRule::Fixed { start_s, end_s } => (start_s, end_s.min(dwell_s)),
            WindowRule::Auto => {
                let latest_s = (dwell_s - Self::SHORTEST_S).max(Self::EARLIEST_S);
                (settle_s.unwrap_or(latest_s).clamp(Self::EARLIEST_S, latest_s), dwell_s)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_steps() {
        let fixed = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
        // (rule, settles after, dwell, window): early, late and never settled; a short step; a cut one.
        let table = [
            (WindowRule::Auto, Some(4.0), 120.0, (10.0, 120.0)),
            (WindowRule::Auto, Some(25.0), 120.0, (25.0, 120.0)),
            (WindowRule::Auto, Some(110.0), 120.0, (90.0, 120.0)),
            (WindowRule::Auto, None, 120.0, (90.0, 120.0)),
            (WindowRule::Auto, None, 25.0, (10.0, 25.0)),
            (fixed, Some(25.0), 120.0, (10.0, 110.0)),
            (fixed, None, 90.0, (10.0, 90.0)),
        ];
        for (rule, settle_s, dwell_s, window_s) in table {
            assert_eq!(rule.of_step_s(settle_s, dwell_s), window_s, "{rule:?} {settle_s:?} {dwell_s}");
        }
    }
}
