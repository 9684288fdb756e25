//! Declared tolerances of the nominal model.

use crate::Channel;
use serde::{Deserialize, Serialize};

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
            flow_meter_gain_ratio: 0.005,
            flow_map_ratio: 0.005,
            compressor_efficiency_ratio: 0.005,
            efficiency_shape_ratio: 0.003,
            turbine_efficiency_ratio: 0.01,
            valve_area_ratio: 0.005,
            convection_ratio: 0.03,
            external_convection_ratio: 0.10,
            oil_conductance_ratio: 0.05,
            inlet_pressure_pa: 200.0,
            inlet_temperature_k: 2.0,
            turbine_inlet_temperature_k: 10.0,
            oil_temperature_k: 5.0,
            ambient_temperature_k: 5.0,
            actuator_lag_s: 0.3,
            structure: StructureTolerances::default(),
        }
    }
}
