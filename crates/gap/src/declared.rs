//! What a campaign declares of rig and model: noise, offsets, tolerances. Anything inside them is no effect.

use mapper_core::{Channel, DeclaredUncertainty, ModelTolerances, NoiseColour};
use mapper_physics::params::BoundaryConditions;
use std::collections::BTreeMap;

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
