//! The lumped turbocharger: shaft, outlet volume, two housings, and the gas paths between them.

use crate::characteristic::CompressorCharacteristic;
use crate::compression::{self, CompressionInputs};
use crate::params::{BoundaryConditions, Params};
use crate::turbine::{TurbineInlet, TurbineState};
use crate::{air, housing, nusselt, orifice, thermocouple};
use std::sync::Arc;

/// Flow below which the gas path is not evaluated (it divides by the flow), kg/s.
const LOWEST_FLOW_KG_S: f64 = 1e-4;

/// A machine: its parameters and its compressor map.
#[derive(Debug, Clone)]
pub struct Model {
    /// Geometry, masses, conductances.
    pub params: Params,
    /// Flow and efficiency.
    pub map: Arc<dyn CompressorCharacteristic>,
}

/// What moves: the five states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Shaft speed, rad/s, > 0.
    pub shaft_speed_rad_s: f64,
    /// Compressor outlet total pressure (station 2), Pa.
    pub p2_pa: f64,
    /// Compressor housing temperature, K.
    pub tc_k: f64,
    /// Turbine housing temperature, K.
    pub tt_k: f64,
    /// Temperature of the T2 probe's tip, K; unused with an ideal probe.
    pub t2_tip_k: f64,
}

impl State {
    /// Shaft speed, rpm.
    pub fn shaft_speed_rpm(&self) -> f64 {
        self.shaft_speed_rad_s * 30.0 / std::f64::consts::PI
    }

    pub(crate) fn to_array(self) -> [f64; 5] {
        [self.shaft_speed_rad_s, self.p2_pa, self.tc_k, self.tt_k, self.t2_tip_k]
    }

    pub(crate) fn from_array(y: &[f64; 5]) -> Self {
        State { shaft_speed_rad_s: y[0], p2_pa: y[1], tc_k: y[2], tt_k: y[3], t2_tip_k: y[4] }
    }
}

/// Shaft speed in rad/s of one in rpm.
pub fn rad_s_of_rpm(speed_rpm: f64) -> f64 {
    speed_rpm * std::f64::consts::PI / 30.0
}

/// Everything the model knows at one instant.
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
    /// Place on the speed line: <= 0 choked, 1 on the surge line, > 1 beyond it.
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
    /// Time constant of the T2 probe, s; 0 for an ideal one.
    pub t2_probe_time_constant_s: f64,
    /// Heat from gas to compressor housing, both places, W.
    pub compressor_heat_w: f64,
    /// Power the compressor takes from the shaft, W.
    pub compressor_power_w: f64,
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

/// The model under boundary conditions that hold for a while; evaluating it repeats nothing that they fix.
#[derive(Debug)]
pub struct PreparedModel<'a> {
    model: &'a Model,
    boundary: BoundaryConditions,
    turbine: TurbineInlet,
    bearing_conductance_w_k: f64,
    /// Corrected over physical speed.
    speed_correction_ratio: f64,
    /// Physical over corrected flow.
    flow_correction_ratio: f64,
    kappa1: f64,
    cp1_j_kgk: f64,
}

/// Boundary conditions under which the model has no meaning.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// No gas goes through the turbine.
    #[error(
        "P3 = {p3_pa:.0} Pa is not above P4 = {p4_pa:.0} Pa: the running model needs flow through the turbine; use standstill instead"
    )]
    NoTurbineFlow {
        /// Turbine inlet total pressure, Pa.
        p3_pa: f64,
        /// Turbine outlet pressure, Pa.
        p4_pa: f64,
    },
    /// A value that no rig has.
    #[error("{name} = {value} {unit} has no physical meaning here; it must be finite and above 0 {unit}")]
    NotPhysical {
        /// Name of the boundary condition.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
}

impl BoundaryConditions {
    /// Checks that the running model has a meaning here.
    ///
    /// # Errors
    /// A pressure, temperature or opening that is not positive and finite, or P3 not above P4.
    pub fn check(&self) -> Result<(), BoundaryError> {
        for (name, value, unit) in [
            ("T1", self.t1_k, "K"),
            ("P1", self.p1_pa, "Pa"),
            ("P3", self.p3_pa, "Pa"),
            ("T3", self.t3_k, "K"),
            ("P4", self.p4_pa, "Pa"),
            ("T_oil", self.oil_temperature_k, "K"),
            ("T_amb", self.ambient_temperature_k, "K"),
            ("valve opening", self.valve_opening_ratio, "1"),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(BoundaryError::NotPhysical { name, value, unit });
            }
        }
        if self.p3_pa <= self.p4_pa {
            return Err(BoundaryError::NoTurbineFlow { p3_pa: self.p3_pa, p4_pa: self.p4_pa });
        }
        Ok(())
    }
}

impl Model {
    /// Appendix A's machine with the closed-form map.
    pub fn nominal() -> Self {
        let params = Params::default();
        let map =
            crate::closed_form_map::ClosedFormMap { wheel_diameter_m: params.compressor.wheel_diameter_m };
        Model { params, map: Arc::new(map) }
    }

    /// The model under fixed boundary conditions, which the caller has [checked](BoundaryConditions::check).
    #[inline]
    pub fn prepare(&self, boundary: &BoundaryConditions) -> PreparedModel<'_> {
        let reference = self.map.reference();
        PreparedModel {
            model: self,
            boundary: *boundary,
            turbine: TurbineInlet::new(&self.params.turbine, boundary),
            bearing_conductance_w_k: housing::bearing_conductance_w_k(&self.params.bearing),
            speed_correction_ratio: reference.corrected_speed_rpm(1.0, boundary.t1_k),
            flow_correction_ratio: reference.physical_flow_kg_s(1.0, boundary.t1_k, boundary.p1_pa),
            kappa1: air::isentropic_exponent(boundary.t1_k),
            cp1_j_kgk: air::heat_capacity_j_kgk(boundary.t1_k),
        }
    }
}

impl PreparedModel<'_> {
    /// The boundary conditions this was prepared for.
    pub fn boundary(&self) -> &BoundaryConditions {
        &self.boundary
    }

    /// Everything the model knows at `state`.
    #[inline]
    pub fn evaluate(&self, state: &State) -> Outputs {
        let (params, boundary) = (&self.model.params, &self.boundary);
        let compressor = &params.compressor;
        let pressure_ratio = state.p2_pa / boundary.p1_pa;
        let on_map =
            self.model.map.evaluate(state.shaft_speed_rpm() * self.speed_correction_ratio, pressure_ratio);
        let flow_kg_s = (on_map.flow_corrected_kg_s * self.flow_correction_ratio).max(LOWEST_FLOW_KG_S);

        let isentropic_rise_ratio = pressure_ratio.powf(self.kappa1) - 1.0;
        // Bulk temperature of the properties: compression from T1 without heat transfer.
        let bulk_k = compression::compressed_k(boundary.t1_k, isentropic_rise_ratio, on_map.efficiency);
        let h_w_m2k = nusselt::coefficient_w_m2k(
            compressor.nusselt_coefficient,
            compressor.nusselt_exponent,
            compressor.outlet_diameter_m,
            flow_kg_s,
            bulk_k,
            state.tc_k,
        );
        let gas = compression::compress(
            &CompressionInputs {
                t1_k: boundary.t1_k,
                tc_k: state.tc_k,
                flow_kg_s,
                isentropic_rise_ratio,
                efficiency: on_map.efficiency,
                h_w_m2k,
                alpha_area_ratio: compressor.alpha_area_ratio,
                internal_area_m2: compressor.internal_area_m2,
            },
            Some(bulk_k),
        );
        let t2_probe_time_constant_s = thermocouple::time_constant_s(
            params.t2_probe_diameter_m,
            compressor.outlet_diameter_m,
            flow_kg_s,
            gas.t2_k,
        );
        Outputs {
            flow_kg_s,
            flow_corrected_kg_s: on_map.flow_corrected_kg_s,
            pressure_ratio,
            efficiency: on_map.efficiency,
            surge_position_ratio: on_map.surge_position_ratio,
            h_w_m2k,
            t1_prime_k: gas.t1_prime_k,
            t2_prime_k: gas.t2_prime_k,
            t2_k: gas.t2_k,
            t2_probe_k: if t2_probe_time_constant_s > 0.0 { state.t2_tip_k } else { gas.t2_k },
            t2_probe_time_constant_s,
            compressor_heat_w: gas.q1_w + gas.q2_w,
            compressor_power_w: flow_kg_s * self.cp1_j_kgk * (gas.t2_prime_k - gas.t1_prime_k),
            compressor_external_heat_w: housing::external_heat_w(
                compressor.external_area_m2,
                compressor.emissivity_ratio,
                state.tc_k,
                boundary.ambient_temperature_k,
            ),
            turbine_external_heat_w: housing::external_heat_w(
                params.turbine.external_area_m2,
                params.turbine.emissivity_ratio,
                state.tt_k,
                boundary.ambient_temperature_k,
            ),
            valve_flow_kg_s: orifice::flow_kg_s(
                boundary.valve_opening_ratio
                    * params.outlet.discharge_coefficient
                    * params.outlet.valve_area_m2,
                state.p2_pa,
                gas.t2_k,
                boundary.p1_pa,
            ),
            bearing_k: housing::bearing_k(
                self.bearing_conductance_w_k,
                params.bearing.oil_conductance_w_k,
                state.tc_k,
                state.tt_k,
                boundary.oil_temperature_k,
            ),
            turbine_flow_kg_s: self.turbine.flow_kg_s,
            turbine: self.turbine.at(state.tt_k, state.shaft_speed_rad_s),
        }
    }

    /// Heat that stays in the compressor housing, W.
    #[inline]
    pub fn compressor_housing_balance_w(&self, state: &State, outputs: &Outputs) -> f64 {
        outputs.compressor_heat_w + self.bearing_conductance_w_k * (outputs.bearing_k - state.tc_k)
            - outputs.compressor_external_heat_w
    }

    /// Heat that stays in the turbine housing, W.
    #[inline]
    pub fn turbine_housing_balance_w(&self, state: &State, outputs: &Outputs) -> f64 {
        outputs.turbine.heat_w
            - self.bearing_conductance_w_k * (state.tt_k - outputs.bearing_k)
            - outputs.turbine_external_heat_w
    }

    /// Rates of the five states, in the order of [`State`]'s fields.
    #[inline]
    pub(crate) fn derivatives(&self, state: &State, outputs: &Outputs) -> [f64; 5] {
        let params = &self.model.params;
        let tau_s = outputs.t2_probe_time_constant_s;
        [
            (outputs.turbine.power_w - outputs.compressor_power_w)
                / (params.shaft_inertia_kgm2 * state.shaft_speed_rad_s),
            air::HEAT_CAPACITY_RATIO * air::GAS_CONSTANT_J_KGK * outputs.t2_k / params.outlet.volume_m3
                * (outputs.flow_kg_s - outputs.valve_flow_kg_s),
            self.compressor_housing_balance_w(state, outputs)
                / housing::compressor_capacity_j_k(params, state.tc_k),
            self.turbine_housing_balance_w(state, outputs)
                / housing::turbine_capacity_j_k(params, state.tt_k),
            if tau_s > 0.0 { (outputs.t2_k - state.t2_tip_k) / tau_s } else { 0.0 },
        ]
    }
}
