//! What a campaign declares of rig and model: noise, offsets, tolerances. Anything inside them is no effect.

use mapper_core::{Channel, DeclaredUncertainty, NoiseColour};
use mapper_physics::params::BoundaryConditions;
use std::collections::BTreeMap;

/// One-sigma tolerances of the model itself, as ratios to the nominal value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelTolerances {
    /// Gain of the compressor's flow meter.
    pub flow_meter_gain_ratio: f64,
    /// Flow of the compressor map.
    pub flow_map_ratio: f64,
    /// Efficiency of the compressor map, all of it alike.
    pub compressor_efficiency_ratio: f64,
    /// Efficiency of the turbine.
    pub turbine_efficiency_ratio: f64,
    /// Area of the back-pressure valve.
    pub valve_area_ratio: f64,
    /// Convection between gas and compressor housing.
    pub convection_ratio: f64,
    /// Convection to the cell.
    pub external_convection_ratio: f64,
    /// Conductance to the oil.
    pub oil_conductance_ratio: f64,
    /// Shape of the efficiency map: smooth deviations over speed and flow, root mean square.
    pub efficiency_shape_ratio: f64,
}

impl Default for ModelTolerances {
    /// 0.5 % of flows, efficiency and valve, 1 % of the turbine, 3 % of convection inside, 10 % outside, 5 % to the oil,
    /// 0.3 % for the shape of the efficiency map.
    fn default() -> Self {
        ModelTolerances {
            flow_meter_gain_ratio: 0.005,
            flow_map_ratio: 0.005,
            compressor_efficiency_ratio: 0.005,
            turbine_efficiency_ratio: 0.01,
            valve_area_ratio: 0.005,
            convection_ratio: 0.03,
            external_convection_ratio: 0.10,
            oil_conductance_ratio: 0.05,
            efficiency_shape_ratio: 0.003,
        }
    }
}

/// Everything that is declared.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// Noise and offset of each sensor.
    pub sensors: BTreeMap<Channel, DeclaredUncertainty>,
    /// The noise over time.
    pub noise_colour: NoiseColour,
    /// Tolerances of the model.
    pub tolerances: ModelTolerances,
    /// Nominal boundary conditions, for what is not recorded.
    pub nominal: BoundaryConditions,
}

impl Declared {
    /// Noise of one sample, in the channel's unit.
    pub fn noise_sigma(&self, channel: Channel) -> f64 {
        self.sensors.get(&channel).map_or(0.0, |sensor| sensor.noise_sigma)
    }

    /// Fixed offset left after calibration, in the channel's unit.
    pub fn offset_sigma(&self, channel: Channel) -> f64 {
        self.sensors.get(&channel).map_or(0.0, |sensor| sensor.offset_sigma)
    }
}
