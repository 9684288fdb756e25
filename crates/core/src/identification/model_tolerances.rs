//! Declared tolerances of the nominal model.

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
        }
    }
}
