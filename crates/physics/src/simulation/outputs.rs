//! Outputs of the model at one instant.

use crate::laws::turbine::TurbineState;
use crate::machine::state::MAX_EXTRA;

/// All outputs of the model at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// Compressor mass flow, kg/s.
    pub flow_kg_s: f64,
    /// Corrected compressor mass flow in the map's reference state, without the floor of the physical one, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, total to total, fraction.
    pub efficiency: f64,
    /// Position on the speed line: <= 0 choked, 1 on the surge line, > 1 beyond it.
    pub surge_position_ratio: f64,
    /// Heat-transfer coefficient between gas and compressor housing, W/(m2 K).
    pub h_w_m2k: f64,
    /// Gas before the compressor wheel (station 1'), K.
    pub t1_prime_k: f64,
    /// Gas after the compressor wheel (station 2'), K.
    pub t2_prime_k: f64,
    /// Gas at the compressor outlet (station 2), K.
    pub t2_k: f64,
    /// Reading of the T2 probe, K.
    pub t2_probe_k: f64,
    /// Steady reading of the T2 probe: the gas temperature with stem conduction and recovery, K.
    pub t2_probe_target_k: f64,
    /// Time constant of the T2 probe, s; 0 for an ideal one.
    pub t2_probe_time_constant_s: f64,
    /// Heat from gas to compressor housing, before and after the wheel, W.
    pub compressor_heat_w: f64,
    /// Temperature of the metal that touches the compressor's gas, K.
    pub wall_k: f64,
    /// Power the compressor takes from the shaft, W.
    pub compressor_power_w: f64,
    /// Power that bearing friction takes from the shaft, W.
    pub friction_power_w: f64,
    /// Heat from turbine to compressor housing by radiation, W.
    pub radiation_w: f64,
    /// Heat from the inner wall to the rest of the compressor housing, W; 0 if the housing is one node.
    pub inner_heat_w: f64,
    /// Additions of hooks.
    pub added: HookTerms,
    /// Heat from the compressor housing to the cell, W.
    pub compressor_external_heat_w: f64,
    /// Heat from the turbine housing to the cell, W.
    pub turbine_external_heat_w: f64,
    /// Flow through the back-pressure valve, kg/s.
    pub valve_flow_kg_s: f64,
    /// Temperature of the bearing housing, K.
    pub bearing_k: f64,
    /// Turbine mass flow, kg/s.
    pub turbine_flow_kg_s: f64,
    /// Turbine gas path.
    pub turbine: TurbineState,
}

/// Heats and power that hooks add; 0 without them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HookTerms {
    /// Heat to the compressor housing (its outer part), W.
    pub compressor_heat_w: f64,
    /// Heat to the inner wall of the compressor housing, W.
    pub inner_heat_w: f64,
    /// Heat to the turbine housing, W.
    pub turbine_heat_w: f64,
    /// Power to the shaft, W.
    pub shaft_power_w: f64,
    /// Flow to the volume after the compressor, kg/s.
    pub outlet_flow_kg_s: f64,
    /// Rates of the hidden temperatures, K/s.
    pub extra_rates_k_s: [f64; MAX_EXTRA],
}
