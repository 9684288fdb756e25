//! Model state at one instant, in map coordinates.

use mapper_physics::simulation::model::{Outputs, State};

/// Model state at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PointState {
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Isentropic efficiency, fraction.
    pub efficiency: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: f64,
    /// Position on the speed line: 0 choke, 1 surge.
    pub surge_position_ratio: f64,
}

impl PointState {
    pub(crate) fn of(state: &State, outputs: &Outputs) -> PointState {
        PointState {
            speed_rpm: state.shaft_speed_rpm(),
            efficiency: outputs.efficiency,
            h_w_m2k: outputs.h_w_m2k,
            surge_position_ratio: outputs.surge_position_ratio,
        }
    }
}
