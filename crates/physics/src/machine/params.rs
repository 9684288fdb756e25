//! The machine: its parameters, boundary conditions and state.

use crate::gas::air::Air;
use crate::gas::mixture::Gas;
use mapper_core::{EfficiencyDefinition, InletConvection, ReferenceState, with_unit};
use serde::{Deserialize, Serialize};

/// Conditions around the machine that rig or cell set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundaryConditions {
    /// Compressor inlet total temperature (station 1), K.
    pub t1_k: f64,
    /// Compressor inlet total pressure (station 1), Pa.
    pub p1_pa: f64,
    /// Turbine inlet total pressure (station 3), Pa.
    pub p3_pa: f64,
    /// Turbine inlet total temperature (station 3), K.
    pub t3_k: f64,
    /// Turbine outlet pressure (station 4), Pa.
    pub p4_pa: f64,
    /// Oil temperature, K.
    pub oil_temperature_k: f64,
    /// Ambient temperature around the housings, K.
    pub ambient_temperature_k: f64,
    /// Back-pressure valve opening relative to the nominal area, 0..2.5.
    pub valve_opening_ratio: f64,
}

impl Default for BoundaryConditions {
    /// The nominal boundary conditions, with the turbine at its outlet pressure (no flow) and the valve at 1.
    fn default() -> Self {
        BoundaryConditions {
            t1_k: 298.15,
            p1_pa: 100_000.0,
            p3_pa: 110_000.0,
            t3_k: 773.15,
            p4_pa: 110_000.0,
            oil_temperature_k: 323.15,
            ambient_temperature_k: 298.15,
            valve_opening_ratio: 1.0,
        }
    }
}

/// Boundary conditions under which the model is not valid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BoundaryError {
    #[error(
        "P3 = {p3_pa:.0} Pa is not above P4 = {p4_pa:.0} Pa: the running model needs flow through the turbine; use standstill instead"
    )]
    NoTurbineFlow { p3_pa: f64, p4_pa: f64 },
    #[error(
        "{name} = {} has no physical meaning here; it must be finite and above {}",
        with_unit(value, unit),
        with_unit(0, unit)
    )]
    NotPhysical { name: &'static str, value: f64, unit: &'static str },
}

impl BoundaryConditions {
    /// Checks that the running model is valid here.
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

/// The machine: geometry, masses, conductances, probe. Effects and fits change these parameters, never the equations.
///
/// Defaults are those of Burke et al., Appendix A, as completed in the model's description (`docs/reference/model.md`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Compressor side.
    pub compressor: CompressorParams,
    /// Turbine side.
    pub turbine: TurbineParams,
    /// Bearing housing and oil.
    pub bearing: BearingParams,
    /// Shaft inertia, kg m2, > 0.
    pub shaft_inertia_kgm2: f64,
    /// Back-pressure valve and the volume before it.
    pub outlet: OutletParams,
    /// Diameter of the T2 probe's tip, m; 0 is an ideal probe (eqs. 11-12).
    pub t2_probe_diameter_m: f64,
    /// Stem conduction chi of the T2 probe: its tip tends to T2 + chi (Tc - T2); 0.
    pub t2_probe_stem_ratio: f64,
    /// Recovery r of the T2 probe: its tip tends to T2 - (1 - r) v^2/(2 cp), v in the outlet pipe; 1.
    pub t2_probe_recovery_ratio: f64,
    /// Bearing friction c: c omega^2 is taken from the shaft, W s^2/rad^2, >= 0; Appendix A has none.
    pub bearing_friction_w_s2: f64,
    /// Multiplies the convection of both housings to the cell, >= 0; 1.
    pub external_convection_ratio: f64,
    /// View factor times area of the radiation from turbine to compressor housing, m2, >= 0; Appendix A has none.
    pub radiation_area_m2: f64,
}

/// Compressor housing and wheel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompressorParams {
    /// Internal area that exchanges heat with the gas, A_c, m2.
    pub internal_area_m2: f64,
    /// Share of `internal_area_m2` before compression, alpha_A, 0..1 (eqs. 1 and 3).
    pub alpha_area_ratio: f64,
    /// Inlet pipe diameter, m: characteristic length of the Nusselt correlation before the wheel if `inlet_convection` is
    /// `own`.
    pub inlet_diameter_m: f64,
    /// Model of h before the wheel; not used if `alpha_area_ratio` is 0.
    pub inlet_convection: InletConvection,
    /// Multiplies h before the wheel, > 0; 1.
    pub inlet_h_ratio: f64,
    /// Outlet pipe diameter: characteristic length of the Nusselt correlation, m.
    pub outlet_diameter_m: f64,
    /// Wheel diameter at the exit, m; tip speed of the map.
    pub wheel_diameter_m: f64,
    /// Nusselt correlation `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`: a.
    pub nusselt_coefficient: f64,
    /// Nusselt correlation: b.
    pub nusselt_exponent: f64,
    /// Mass of the housing, kg.
    pub housing_mass_kg: f64,
    /// External area, m2.
    pub external_area_m2: f64,
    /// External emissivity, 0..1, ratio to a black body.
    pub emissivity_ratio: f64,
    /// Multiplies h if the metal is hotter than the gas it touches (T1 before, T2' after compression), > 0; 1.
    pub hot_metal_h_ratio: f64,
    /// Conductance from the housing to the gas between the T1 probe and the wheel, in addition to `alpha_area_ratio`, W/K; 0.
    pub inlet_conductance_w_k: f64,
    /// Multiplies the map's efficiency, > 0; 1.
    pub efficiency_scale_ratio: f64,
    /// Multiplies the map's flow, > 0; 1. The efficiency is the map's at the multiplied flow.
    pub flow_scale_ratio: f64,
    /// Recirculation r: hot flow from the exit of the wheel to its inlet, over the flow that leaves the compressor. The wheel, and therefore
    /// the map, has (1 + r) times that flow; 0.
    pub recirculation_ratio: f64,
    /// The dry gas of the compressor side.
    #[serde(default = "closed_form_air")]
    pub gas: Gas,
    /// Water in that gas, kg per kg of dry gas, >= 0; 0.
    pub humidity_kg_kg: f64,
    /// Definition of the map's efficiency and of every efficiency of this model; by default that of the paper.
    #[serde(default = "paper")]
    pub efficiency: EfficiencyDefinition,
    /// Fraction phi of the housing's heat capacity that touches the gas and has its own temperature, 0..1; 0 is one node.
    pub inner_capacity_ratio: f64,
    /// Conductance G between that inner wall and the rest, W/K, > 0; not used if the housing is one node.
    pub inner_conductance_w_k: f64,
}

/// Turbine housing and wheel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TurbineParams {
    /// Internal area that exchanges heat with the gas, A_t, m2.
    pub internal_area_m2: f64,
    /// Inlet pipe diameter: characteristic length of the Nusselt correlation, m.
    pub inlet_diameter_m: f64,
    /// Radius of the wheel's inlet, m; blade speed of the blade-speed ratio.
    pub wheel_radius_m: f64,
    /// Nusselt correlation `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`: a.
    pub nusselt_coefficient: f64,
    /// Nusselt correlation: b.
    pub nusselt_exponent: f64,
    /// Mass of the housing, kg.
    pub housing_mass_kg: f64,
    /// External area, m2.
    pub external_area_m2: f64,
    /// External emissivity, 0..1, ratio to a black body.
    pub emissivity_ratio: f64,
    /// Swallowing capacity of the turbine at a large expansion ratio, corrected to 288.15 K and 101.325 kPa, kg/s.
    pub choked_flow_kg_s: f64,
    /// The gas that drives the turbine.
    #[serde(default = "closed_form_air")]
    pub gas: Gas,
    /// Best efficiency of the turbine, 0..1.
    pub peak_efficiency: f64,
    /// Blade-speed ratio of the best efficiency.
    pub peak_blade_speed_ratio: f64,
}

/// Bearing housing between the two.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BearingParams {
    /// Thermal conductivity of the bearing housing, W/(m K).
    pub conductivity_w_mk: f64,
    /// Section area of the bearing housing, m2.
    pub section_area_m2: f64,
    /// Length of the bearing housing, m; half of it lies on each side of the oil.
    pub length_m: f64,
    /// Conductance from the bearing housing to the oil, W/K.
    pub oil_conductance_w_k: f64,
    /// Heat of bearing friction to the bearing housing at [`FRICTION_SPEED_RPM`], W, >= 0; it rises with the square of the speed. The power
    /// it takes from the shaft is part of the turbine's efficiency. Appendix A has none.
    #[serde(default)]
    pub friction_heat_w: f64,
}

/// Shaft speed to which the friction heat of a bearing refers, rpm. Source: definition.
pub const FRICTION_SPEED_RPM: f64 = 100e3;

/// Back-pressure valve and the volume between compressor and valve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutletParams {
    /// Volume between compressor outlet and valve, m3.
    pub volume_m3: f64,
    /// Valve area at opening 1, m2.
    pub valve_area_m2: f64,
    /// Discharge coefficient of the valve.
    pub discharge_coefficient: f64,
}

fn closed_form_air() -> Gas {
    Gas::CLOSED_FORM_AIR
}

/// Eq. 2 of the paper.
fn paper() -> EfficiencyDefinition {
    EfficiencyDefinition::KappaOfT1
}

impl CompressorParams {
    /// The gas that is compressed.
    pub fn air(&self) -> Air {
        Air::new(self.gas, self.humidity_kg_kg).with_efficiency(self.efficiency)
    }
}

impl Default for Params {
    fn default() -> Self {
        Params {
            compressor: CompressorParams {
                internal_area_m2: 29e-3,
                alpha_area_ratio: 0.0,
                inlet_diameter_m: 40e-3,
                inlet_convection: InletConvection::Shared,
                inlet_h_ratio: 1.0,
                outlet_diameter_m: 35e-3,
                wheel_diameter_m: 52e-3,
                nusselt_coefficient: 0.004,
                nusselt_exponent: 1.13,
                housing_mass_kg: 0.93,
                external_area_m2: 79e-3,
                emissivity_ratio: 0.1,
                hot_metal_h_ratio: 1.0,
                inlet_conductance_w_k: 0.0,
                efficiency_scale_ratio: 1.0,
                flow_scale_ratio: 1.0,
                recirculation_ratio: 0.0,
                gas: Gas::CLOSED_FORM_AIR,
                humidity_kg_kg: 0.0,
                efficiency: paper(),
                inner_capacity_ratio: 0.0,
                inner_conductance_w_k: 20.0,
            },
            turbine: TurbineParams {
                internal_area_m2: 24e-3,
                inlet_diameter_m: 40e-3,
                wheel_radius_m: 0.0235,
                nusselt_coefficient: 0.038,
                nusselt_exponent: 0.662,
                housing_mass_kg: 3.15,
                external_area_m2: 80e-3,
                emissivity_ratio: 0.6,
                choked_flow_kg_s: 0.078,
                gas: Gas::CLOSED_FORM_AIR,
                peak_efficiency: 0.75,
                peak_blade_speed_ratio: 0.65,
            },
            bearing: BearingParams {
                conductivity_w_mk: 47.5,
                section_area_m2: 7e-4,
                length_m: 45e-3,
                oil_conductance_w_k: 8.0,
                friction_heat_w: 0.0,
            },
            shaft_inertia_kgm2: 16e-6,
            outlet: OutletParams { volume_m3: 0.78e-3, valve_area_m2: 0.4e-3, discharge_coefficient: 0.6 },
            t2_probe_diameter_m: 0.0,
            t2_probe_stem_ratio: 0.0,
            t2_probe_recovery_ratio: 1.0,
            bearing_friction_w_s2: 0.0,
            external_convection_ratio: 1.0,
            radiation_area_m2: 0.0,
        }
    }
}

/// The model's own reference state (SAE J922).
pub const MODEL_REFERENCE: ReferenceState = ReferenceState::SAE;

/// Maximum number of hidden states that all [hooks](crate::machine::hooks::Hooks) of a model may add together.
pub const MAX_EXTRA: usize = 2;

/// Maximum number of states of a model.
pub(crate) const MAX_STATES: usize = 6 + MAX_EXTRA;

/// The states: five are always integrated, the inner wall and the extra ones only if a model has them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Shaft speed, rad/s, > 0.
    pub shaft_speed_rad_s: f64,
    /// Compressor outlet total pressure (station 2), Pa.
    pub p2_pa: f64,
    /// Compressor housing temperature, K; of its outer part if the inner wall has its own.
    pub tc_k: f64,
    /// Turbine housing temperature, K.
    pub tt_k: f64,
    /// Temperature of the T2 probe's tip, K; unused with an ideal probe.
    pub t2_tip_k: f64,
    /// Inner wall of the compressor housing, K; unused if the housing is one node.
    pub inner_k: f64,
    /// Temperatures that hooks add, K; unused without them.
    pub extra_k: [f64; MAX_EXTRA],
}

impl State {
    /// A state in which the probe has the temperature of the gas, `gas_k`, and the inner wall that of the housing, `tc_k`.
    pub fn new(shaft_speed_rad_s: f64, p2_pa: f64, tc_k: f64, tt_k: f64, gas_k: f64) -> Self {
        State {
            shaft_speed_rad_s,
            p2_pa,
            tc_k,
            tt_k,
            t2_tip_k: gas_k,
            inner_k: tc_k,
            extra_k: [gas_k; MAX_EXTRA],
        }
    }

    /// Shaft speed, rpm.
    pub fn shaft_speed_rpm(&self) -> f64 {
        self.shaft_speed_rad_s * 30.0 / std::f64::consts::PI
    }

    /// The first `N` components, in the order of the fields.
    #[inline]
    pub(crate) fn to_array<const N: usize>(self) -> [f64; N] {
        let all = [
            self.shaft_speed_rad_s,
            self.p2_pa,
            self.tc_k,
            self.tt_k,
            self.t2_tip_k,
            self.inner_k,
            self.extra_k[0],
            self.extra_k[1],
        ];
        std::array::from_fn(|i| all[i])
    }

    /// Creates a state from its first `N` >= 5 components; the others are in equilibrium with the housing.
    #[inline]
    pub(crate) fn from_array<const N: usize>(y: &[f64; N]) -> Self {
        let at = |i: usize| if i < N { y[i] } else { y[2] };
        State {
            shaft_speed_rad_s: y[0],
            p2_pa: y[1],
            tc_k: y[2],
            tt_k: y[3],
            t2_tip_k: y[4],
            inner_k: at(5),
            extra_k: [at(6), at(7)],
        }
    }
}

/// Converts a shaft speed from rpm to rad/s.
pub fn rad_s_of_rpm(speed_rpm: f64) -> f64 {
    speed_rpm * std::f64::consts::PI / 30.0
}
