//! Converts the reading of a pressure tap to total pressure.

use crate::PressureTap;
use mapper_physics::gas::pressure_tap::static_to_total_pa;

/// Total pressure at a tap.
pub(crate) fn total_pa(tap: PressureTap, read_pa: f64, flow_kg_s: f64, total_temperature_k: f64) -> f64 {
    match tap {
        PressureTap::Total => read_pa,
        PressureTap::Static { pipe_diameter_m } => {
            static_to_total_pa(read_pa, flow_kg_s, total_temperature_k, pipe_diameter_m)
        }
    }
}
