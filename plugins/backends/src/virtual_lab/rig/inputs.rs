//! The lab's boundary conditions: from the test cell, and from the actuators that follow the commands.

use crate::virtual_lab::rig::actuator::{Actuator, ActuatorDynamics};
use crate::virtual_lab::rig::boundary_wander::Weather;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::inputs::Inputs;

/// Minimum ratio of air supply to P4 while the model runs: the model divides by the turbine's flow.
pub const MIN_EXPANSION_RATIO: f64 = 1.0005;

/// The conditions of the cell, and the actuators.
#[derive(Debug, Clone)]
pub struct LabInputs {
    /// T1, P1, P4 and the ambient temperature.
    pub cell: BoundaryConditions,
    /// Slow fluctuations of the boundary conditions.
    pub weather: Weather,
    /// Turbine inlet pressure, Pa.
    pub p3: Actuator,
    /// Turbine inlet temperature, K.
    pub t3: Actuator,
    /// Valve opening.
    pub valve: Actuator,
    /// Oil temperature, K.
    pub oil: Actuator,
}

impl LabInputs {
    /// Constant inputs at `boundary`.
    pub fn constant(boundary: &BoundaryConditions) -> Self {
        let at_rest = |value: f64| Actuator::at_rest(ActuatorDynamics::AT_ONCE, value);
        LabInputs {
            cell: *boundary,
            weather: Weather::default(),
            p3: at_rest(boundary.p3_pa),
            t3: at_rest(boundary.t3_k),
            valve: at_rest(boundary.valve_opening_ratio),
            oil: at_rest(boundary.oil_temperature_k),
        }
    }

    fn actuators(&self) -> [&Actuator; 4] {
        [&self.p3, &self.t3, &self.valve, &self.oil]
    }
}

impl Inputs for LabInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = BoundaryConditions {
            p3_pa: self.p3.value(t_s),
            t3_k: self.t3.value(t_s),
            valve_opening_ratio: self.valve.value(t_s),
            oil_temperature_k: self.oil.value(t_s),
            ..self.cell
        };
        if !self.weather.is_calm() {
            boundary = self.weather.add_to(boundary, t_s);
        }
        boundary.p3_pa = boundary.p3_pa.max(boundary.p4_pa * MIN_EXPANSION_RATIO);
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.actuators().map(|actuator| actuator.next_kink_s(t_s)).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.weather.is_calm() && self.actuators().iter().all(|actuator| actuator.has_arrived(t_s))
    }
}
