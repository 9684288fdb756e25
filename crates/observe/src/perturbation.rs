//! Possible differences between a recording and the model: one quantity of machine, inputs or initial state, and its adjustment.

use crate::averages::boundary_condition;
use mapper_core::{Channel, ModelTolerances};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::State;

/// Factor on the standard deviation of an uninformative prior. Bound: such a prior does not enter the result.
pub const UNINFORMATIVE: f64 = 1e4;

/// A quantity of model, inputs or initial state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Perturbation {
    /// A boundary condition, by the channel that measures it; in its unit.
    Input(Channel),
    /// Ambient temperature, K.
    Ambient,
    /// Efficiency of the compressor map, ratio.
    Efficiency,
    /// Flow of the compressor map, ratio.
    Flow,
    /// Efficiency of the turbine, ratio.
    TurbineEfficiency,
    /// Choked flow of the turbine, ratio.
    TurbineFlow,
    /// Area of the back-pressure valve, ratio.
    ValveArea,
    /// Convection between gas and compressor housing, ratio.
    CompressorConvection,
    /// Convection between gas and turbine housing, ratio.
    TurbineConvection,
    /// Convection of both housings to the cell, ratio.
    ExternalConvection,
    /// Conductance to the oil, ratio.
    OilConductance,
    /// Friction of the bearing, W s^2/rad^2.
    Friction,
    /// Compressor housing at the start, K.
    StartTc,
    /// Turbine housing at the start, K.
    StartTt,
}

/// Ambient temperature is measured at one place in the cell, not at each wall, K. Bound: temperatures in a test cell differ by some
/// kelvin.
const AMBIENT_SIGMA_K: f64 = 1.0;
/// The rig may not have been at steady state before the recording, K. Bound: housings after a usual warm-up.
const START_SIGMA_K: f64 = 5.0;

impl Perturbation {
    /// Declared standard deviation of its error, in its unit. 0 for quantities without a tolerance: inputs, which have declared sensors,
    /// and friction, which the nominal model omits.
    ///
    /// A campaign declares no tolerance of the turbine's flow and convection; those of the compressor apply.
    pub fn tolerance(self, declared: &ModelTolerances) -> f64 {
        match self {
            Perturbation::Input(_) | Perturbation::Friction => 0.0,
            Perturbation::Ambient => AMBIENT_SIGMA_K,
            Perturbation::Efficiency => declared.compressor_efficiency_ratio,
            Perturbation::Flow | Perturbation::TurbineFlow => declared.flow_map_ratio,
            Perturbation::TurbineEfficiency => declared.turbine_efficiency_ratio,
            Perturbation::ValveArea => declared.valve_area_ratio,
            Perturbation::CompressorConvection | Perturbation::TurbineConvection => declared.convection_ratio,
            Perturbation::ExternalConvection => declared.external_convection_ratio,
            Perturbation::OilConductance => declared.oil_conductance_ratio,
            Perturbation::StartTc | Perturbation::StartTt => START_SIGMA_K,
        }
    }

    /// Adjusts the machine.
    pub fn adjust_machine(self, params: &mut Params, by: f64) {
        match self {
            Perturbation::Efficiency => params.compressor.efficiency_scale_ratio *= 1.0 + by,
            Perturbation::Flow => params.compressor.flow_scale_ratio *= 1.0 + by,
            Perturbation::TurbineEfficiency => params.turbine.peak_efficiency *= 1.0 + by,
            Perturbation::TurbineFlow => params.turbine.choked_flow_kg_s *= 1.0 + by,
            Perturbation::ValveArea => params.outlet.valve_area_m2 *= 1.0 + by,
            Perturbation::CompressorConvection => params.compressor.nusselt_coefficient *= 1.0 + by,
            Perturbation::TurbineConvection => params.turbine.nusselt_coefficient *= 1.0 + by,
            Perturbation::ExternalConvection => params.external_convection_ratio *= 1.0 + by,
            Perturbation::OilConductance => params.bearing.oil_conductance_w_k *= 1.0 + by,
            Perturbation::Friction => params.bearing_friction_w_s2 += by,
            Perturbation::Input(_)
            | Perturbation::Ambient
            | Perturbation::StartTc
            | Perturbation::StartTt => {}
        }
    }

    /// Adjusts the boundary conditions.
    pub fn adjust_boundary(self, boundary: &mut BoundaryConditions, by: f64) {
        let channel = match self {
            Perturbation::Input(channel) => channel,
            Perturbation::Ambient => Channel::TAmb,
            _ => return,
        };
        if let Some(value) = boundary_condition(boundary, channel) {
            *value += by;
        }
    }

    /// Adjusts the initial state.
    pub fn adjust_initial_state(self, state: &mut State, by_k: f64) {
        match self {
            Perturbation::StartTc => {
                state.tc_k += by_k;
                state.inner_k += by_k;
            }
            Perturbation::StartTt => state.tt_k += by_k,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: [Perturbation; 10] = [
        Perturbation::Efficiency,
        Perturbation::Flow,
        Perturbation::TurbineEfficiency,
        Perturbation::TurbineFlow,
        Perturbation::ValveArea,
        Perturbation::CompressorConvection,
        Perturbation::TurbineConvection,
        Perturbation::ExternalConvection,
        Perturbation::OilConductance,
        Perturbation::Friction,
    ];

    /// A perturbation without an effect would go unnoticed and fit nothing.
    #[test]
    fn each_knob_turns_one_thing_of_its_own() {
        let mut seen = Vec::new();
        for perturbation in MACHINE {
            let mut params = Params::default();
            perturbation.adjust_machine(&mut params, 0.25);
            assert_ne!(params, Params::default(), "{perturbation:?}");
            assert!(!seen.contains(&params), "{perturbation:?}");
            seen.push(params);
        }
        let mut boundary = BoundaryConditions::default();
        for channel in crate::averages::INPUT_CHANNELS {
            let before = boundary;
            Perturbation::Input(channel).adjust_boundary(&mut boundary, 1.0);
            assert_ne!(boundary, before, "{channel}");
        }
        let before = boundary;
        Perturbation::Ambient.adjust_boundary(&mut boundary, 2.0);
        assert_eq!(boundary.ambient_temperature_k, before.ambient_temperature_k + 2.0);
        assert_eq!(boundary.t1_k, before.t1_k);
    }
}
