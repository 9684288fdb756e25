//! The lumped turbocharger: shaft, outlet volume, two housings, and the gas paths between them.

use crate::compressor_map::closed_form_map::{CharacteristicPoint, CompressorCharacteristic};
use crate::gas::air;
use crate::laws::turbine::{self, TurbineInlet, TurbineState, friction_power_w};
use crate::laws::{compression, convection, housing, thermocouple};
use crate::machine::hooks::{HookList, Hooks, Site};
use crate::machine::params::{BoundaryConditions, MAX_EXTRA, MAX_STATES, Params};
pub use crate::machine::params::{BoundaryError, State, rad_s_of_rpm};
use std::sync::Arc;

/// Flow below which the gas path is not evaluated (it divides by the flow), kg/s.
const MIN_FLOW_KG_S: f64 = 1e-4;

/// A machine: its parameters and its compressor map.
#[derive(Debug, Clone)]
pub struct Model {
    /// Geometry, masses, conductances.
    pub params: Params,
    /// Flow and efficiency.
    pub map: Arc<dyn CompressorCharacteristic>,
    /// Extensions beyond the parameters; usually none.
    pub hooks: HookList,
}

impl Model {
    /// Takes the machine's own characteristics from another one: flow and efficiency of the compressor, turbine, shaft and valve. What
    /// acts on gas, housings and readings stays.
    pub fn take_characteristics(&mut self, of: &Model) {
        let (own, of_params) = (&mut self.params, of.params);
        own.compressor.efficiency_scale_ratio = of_params.compressor.efficiency_scale_ratio;
        own.compressor.flow_scale_ratio = of_params.compressor.flow_scale_ratio;
        own.turbine = of_params.turbine;
        own.outlet = of_params.outlet;
        own.shaft_inertia_kgm2 = of_params.shaft_inertia_kgm2;
        own.bearing_friction_w_s2 = of_params.bearing_friction_w_s2;
        self.map = of.map.clone();
        self.hooks = of.hooks.characteristics();
    }
}

/// The model under constant boundary conditions; all terms that they determine are computed once.
#[derive(Debug)]
pub struct PreparedModel<'a> {
    model: &'a Model,
    t_s: f64,
    boundary: BoundaryConditions,
    turbine: TurbineInlet,
    bearing_conductance_w_k: f64,
    /// Corrected over physical speed.
    speed_correction_ratio: f64,
    /// Physical over corrected flow.
    flow_correction_ratio: f64,
    air: air::Air,
    cp1_j_kgk: f64,
    gas_constant_j_kgk: f64,
    /// Flow of the compressor's gas over that of dry air, through map and valve.
    flow_ratio: f64,
    /// h of the compressor's gas over that of dry air.
    h_ratio: f64,
}

impl Model {
    /// Appendix A's machine with the closed-form map.
    pub fn nominal() -> Self {
        let params = Params::default();
        let map = crate::compressor_map::closed_form_map::ClosedFormMap {
            wheel_diameter_m: params.compressor.wheel_diameter_m,
        };
        Model::new(params, Arc::new(map))
    }

    /// A machine without hooks.
    pub fn new(params: Params, map: Arc<dyn CompressorCharacteristic>) -> Self {
        Model { params, map, hooks: HookList::default() }
    }

    /// Whether the inner wall of the compressor housing has its own temperature.
    #[inline]
    pub fn has_inner_wall(&self) -> bool {
        self.params.compressor.inner_capacity_ratio > 0.0
    }

    /// The model under fixed boundary conditions, which the caller has [checked](BoundaryConditions::check).
    #[inline]
    pub fn prepare(&self, boundary: &BoundaryConditions) -> PreparedModel<'_> {
        self.prepare_at(f64::NAN, boundary)
    }

    /// The model under fixed boundary conditions at a time, s, which is passed to hooks.
    #[inline]
    pub fn prepare_at(&self, t_s: f64, boundary: &BoundaryConditions) -> PreparedModel<'_> {
        let reference = self.map.reference();
        let air = self.params.compressor.air();
        let flow_ratio = 1.0 / air.dry_flow_ratio();
        let cp1_j_kgk = air.heat_capacity_j_kgk(boundary.t1_k);
        PreparedModel {
            model: self,
            t_s,
            boundary: *boundary,
            turbine: TurbineInlet::new(&self.params.turbine, boundary),
            bearing_conductance_w_k: housing::bearing_conductance_w_k(&self.params.bearing),
            speed_correction_ratio: reference.corrected_speed_rpm(1.0, boundary.t1_k),
            flow_correction_ratio: reference.physical_flow_kg_s(1.0, boundary.t1_k, boundary.p1_pa)
                * flow_ratio
                / (1.0 + self.params.compressor.recirculation_ratio),
            air,
            cp1_j_kgk,
            gas_constant_j_kgk: air.gas_constant_j_kgk(),
            flow_ratio,
            h_ratio: air.h_ratio(boundary.t1_k),
        }
    }
}

impl PreparedModel<'_> {
    /// The boundary conditions of this prepared model.
    pub fn boundary(&self) -> &BoundaryConditions {
        &self.boundary
    }

    /// All outputs at `state`.
    #[inline]
    pub fn evaluate(&self, state: &State) -> Outputs {
        self.evaluate_on_map(state, self.on_map(state))
    }

    /// The map's value at `state`: it depends only on shaft speed and outlet pressure of the state.
    #[inline]
    pub(crate) fn on_map(&self, state: &State) -> CharacteristicPoint {
        self.model.map.evaluate_scaled(
            state.shaft_speed_rpm() * self.speed_correction_ratio,
            state.p2_pa / self.boundary.p1_pa,
            self.model.params.compressor.flow_scale_ratio,
        )
    }

    /// Like [`PreparedModel::evaluate`], with a known value of the map.
    #[inline]
    pub(crate) fn evaluate_on_map(&self, state: &State, on_map: CharacteristicPoint) -> Outputs {
        // Two compiled versions: a model without hooks must not spend time on checks for them.
        if self.model.hooks.is_empty() {
            self.evaluate_with::<false>(state, on_map)
        } else {
            self.evaluate_with::<true>(state, on_map)
        }
    }

    #[inline]
    fn evaluate_with<const HOOKED: bool>(&self, state: &State, on_map: CharacteristicPoint) -> Outputs {
        let (params, boundary, hooks) = (&self.model.params, &self.boundary, &self.model.hooks);
        let compressor = &params.compressor;
        let pressure_ratio = state.p2_pa / boundary.p1_pa;
        let flow_corrected_kg_s = on_map.flow_corrected_kg_s;
        let has_inner_wall = self.model.has_inner_wall();
        let wall_k = if has_inner_wall { state.inner_k } else { state.tc_k };
        let bearing_k = housing::bearing_k(
            self.bearing_conductance_w_k,
            params.bearing.oil_conductance_w_k,
            housing::friction_heat_w(&params.bearing, state.shaft_speed_rad_s),
            state.tc_k,
            state.tt_k,
            boundary.oil_temperature_k,
        );
        let mut site = Site::before_gas_path(self.t_s, boundary, state, wall_k, pressure_ratio, bearing_k);
        let mut flow_kg_s = flow_corrected_kg_s * self.flow_correction_ratio;
        let mut efficiency = on_map.efficiency * compressor.efficiency_scale_ratio;
        if HOOKED {
            flow_kg_s = hooks.fold(&site, flow_kg_s, |hook, site, value| hook.flow_kg_s(site, value));
        }
        flow_kg_s = flow_kg_s.max(MIN_FLOW_KG_S);
        if HOOKED {
            site.flow_kg_s = flow_kg_s;
            efficiency = hooks.fold(&site, efficiency, |hook, site, value| hook.efficiency(site, value));
            site.efficiency = efficiency;
        }

        let air = self.air.between(boundary.p1_pa, state.p2_pa);
        let isentropic_rise_ratio = compression::isentropic_rise_ratio(pressure_ratio, boundary.t1_k, air);
        // Bulk temperature of the properties: compression from T1 without heat transfer.
        let bulk_k = compression::compressed_k(boundary.t1_k, isentropic_rise_ratio, efficiency, air);
        let mut h_w_m2k = convection::coefficient_w_m2k(
            compressor.nusselt_coefficient,
            compressor.nusselt_exponent,
            compressor.outlet_diameter_m,
            flow_kg_s,
            bulk_k,
            wall_k,
        ) * self.h_ratio;
        if HOOKED {
            h_w_m2k = hooks.fold(&site, h_w_m2k, |hook, site, value| hook.h_w_m2k(site, value));
            site.h_w_m2k = h_w_m2k;
        }
        let conductance_w_k = h_w_m2k * compressor.internal_area_m2;
        let directed_w_k = |gas_k: f64| {
            if wall_k > gas_k { conductance_w_k * compressor.hot_metal_h_ratio } else { conductance_w_k }
        };
        let (q1_w, mut t1_prime_k) = compression::before_wheel(
            directed_w_k(boundary.t1_k)
                * convection::h_ratio(compressor, boundary.t1_k, bulk_k)
                * compressor.alpha_area_ratio
                + compressor.inlet_conductance_w_k,
            boundary.t1_k,
            wall_k,
            flow_kg_s,
            self.cp1_j_kgk,
        );
        if HOOKED {
            t1_prime_k = hooks.fold(&site, t1_prime_k, |hook, site, value| hook.gas_before_k(site, value));
            site.t1_prime_k = t1_prime_k;
        }
        let wheel = compression::Wheel {
            t1_k: boundary.t1_k,
            isentropic_rise_ratio,
            efficiency,
            recirculation_ratio: compressor.recirculation_ratio,
            air,
        };
        let (mut t2_prime_k, work_j_kg) = wheel.compress(t1_prime_k);
        let compressor_power_w = flow_kg_s * work_j_kg;
        if HOOKED {
            t2_prime_k = hooks.fold(&site, t2_prime_k, |hook, site, value| hook.gas_after_k(site, value));
            site.t2_prime_k = t2_prime_k;
        }
        let (q2_w, mut t2_k) = compression::after_wheel(
            directed_w_k(t2_prime_k) * (1.0 - compressor.alpha_area_ratio),
            t2_prime_k,
            wall_k,
            flow_kg_s,
            air.heat_capacity_j_kgk(bulk_k),
        );
        if HOOKED {
            site.t2_k = t2_k;
            t2_k = hooks.fold(&site, t2_k, |hook, site, value| hook.gas_outlet_k(site, value));
            site.t2_k = t2_k;
        }
        let t2_probe_time_constant_s = thermocouple::time_constant_s(
            params.t2_probe_diameter_m,
            compressor.outlet_diameter_m,
            flow_kg_s,
            t2_k,
        );
        let t2_probe_target_k = t2_k + params.t2_probe_stem_ratio * (state.tc_k - t2_k)
            - if params.t2_probe_recovery_ratio == 1.0 {
                0.0
            } else {
                (1.0 - params.t2_probe_recovery_ratio)
                    * thermocouple::dynamic_temperature_k(
                        compressor.outlet_diameter_m,
                        flow_kg_s,
                        state.p2_pa,
                        t2_k,
                        self.gas_constant_j_kgk,
                    )
            };
        let external_heat_w = |area_m2: f64, emissivity_ratio: f64, wall_k: f64| {
            let convection_ratio = params.external_convection_ratio;
            let ambient_k = boundary.ambient_temperature_k;
            housing::external_heat_w(area_m2, emissivity_ratio, convection_ratio, wall_k, ambient_k)
        };
        Outputs {
            flow_kg_s,
            flow_corrected_kg_s,
            pressure_ratio,
            efficiency,
            surge_position_ratio: on_map.surge_position_ratio,
            h_w_m2k,
            t1_prime_k,
            t2_prime_k,
            t2_k,
            t2_probe_k: if t2_probe_time_constant_s > 0.0 { state.t2_tip_k } else { t2_probe_target_k },
            t2_probe_target_k,
            t2_probe_time_constant_s,
            compressor_heat_w: q1_w + q2_w,
            wall_k,
            compressor_power_w,
            friction_power_w: friction_power_w(params.bearing_friction_w_s2, state.shaft_speed_rad_s),
            radiation_w: if params.radiation_area_m2 == 0.0 {
                0.0
            } else {
                housing::radiation_w(params.radiation_area_m2, state.tt_k, state.tc_k)
            },
            inner_heat_w: if has_inner_wall {
                compressor.inner_conductance_w_k * (wall_k - state.tc_k)
            } else {
                0.0
            },
            added: if HOOKED { self.sum_hook_terms(&site) } else { HookTerms::default() },
            compressor_external_heat_w: external_heat_w(
                compressor.external_area_m2,
                compressor.emissivity_ratio,
                state.tc_k,
            ),
            turbine_external_heat_w: external_heat_w(
                params.turbine.external_area_m2,
                params.turbine.emissivity_ratio,
                state.tt_k,
            ),
            valve_flow_kg_s: self.flow_ratio
                * turbine::flow_kg_s(
                    boundary.valve_opening_ratio
                        * params.outlet.discharge_coefficient
                        * params.outlet.valve_area_m2,
                    state.p2_pa,
                    t2_k,
                    boundary.p1_pa,
                ),
            bearing_k,
            turbine_flow_kg_s: self.turbine.flow_kg_s,
            turbine: self.turbine.at(state.tt_k, state.shaft_speed_rad_s),
        }
    }

    /// Sums the terms that hooks add, at a site whose gas path is known.
    #[cold]
    fn sum_hook_terms(&self, site: &Site<'_>) -> HookTerms {
        let hooks = &self.model.hooks;
        let sum = |term: fn(&dyn Hooks, &Site<'_>) -> f64| {
            hooks.fold(site, 0.0, |hook, site, sum| sum + term(hook, site))
        };
        HookTerms {
            compressor_heat_w: sum(|hook, site| hook.heat_to_compressor_w(site)),
            inner_heat_w: sum(|hook, site| hook.heat_to_inner_w(site)),
            turbine_heat_w: sum(|hook, site| hook.heat_to_turbine_w(site)),
            outlet_flow_kg_s: sum(|hook, site| hook.flow_to_outlet_kg_s(site)),
            shaft_power_w: sum(|hook, site| hook.shaft_torque_nm(site)) * site.state.shaft_speed_rad_s,
            extra_rates_k_s: hooks.extra_rates_k_s(site),
        }
    }

    /// The site for hooks on readings: everything is known.
    pub fn site<'b>(&'b self, state: &'b State, outputs: &Outputs) -> Site<'b> {
        Site {
            flow_kg_s: outputs.flow_kg_s,
            efficiency: outputs.efficiency,
            h_w_m2k: outputs.h_w_m2k,
            t1_prime_k: outputs.t1_prime_k,
            t2_prime_k: outputs.t2_prime_k,
            t2_k: outputs.t2_k,
            ..Site::before_gas_path(
                self.t_s,
                &self.boundary,
                state,
                outputs.wall_k,
                outputs.pressure_ratio,
                outputs.bearing_k,
            )
        }
    }

    /// The model itself.
    pub fn model(&self) -> &Model {
        self.model
    }

    /// Net power that accelerates the shaft, W.
    #[inline]
    pub fn shaft_balance_w(&self, outputs: &Outputs) -> f64 {
        outputs.turbine.power_w - outputs.compressor_power_w - outputs.friction_power_w
            + outputs.added.shaft_power_w
    }

    /// Net heat to the compressor housing, W; to its outer part if the inner wall has its own temperature.
    #[inline]
    pub fn compressor_housing_balance_w(&self, state: &State, outputs: &Outputs) -> f64 {
        let from_inside_w = if self.model.has_inner_wall() {
            outputs.inner_heat_w
        } else {
            outputs.compressor_heat_w + outputs.added.inner_heat_w
        };
        from_inside_w + self.bearing_conductance_w_k * (outputs.bearing_k - state.tc_k)
            - outputs.compressor_external_heat_w
            + outputs.radiation_w
            + outputs.added.compressor_heat_w
    }

    /// Net heat to the inner wall of the compressor housing, W; 0 if the housing is one node.
    #[inline]
    pub fn inner_wall_balance_w(&self, outputs: &Outputs) -> f64 {
        if self.model.has_inner_wall() {
            outputs.compressor_heat_w + outputs.added.inner_heat_w - outputs.inner_heat_w
        } else {
            0.0
        }
    }

    /// Net heat to the turbine housing, W.
    #[inline]
    pub fn turbine_housing_balance_w(&self, state: &State, outputs: &Outputs) -> f64 {
        outputs.turbine.heat_w
            - self.bearing_conductance_w_k * (state.tt_k - outputs.bearing_k)
            - outputs.turbine_external_heat_w
            - outputs.radiation_w
            + outputs.added.turbine_heat_w
    }

    /// Rates of the first `N` states, in the order of [`State`]'s fields.
    #[inline]
    pub(crate) fn derivatives<const N: usize>(&self, state: &State, outputs: &Outputs) -> [f64; N] {
        let params = &self.model.params;
        let tau_s = outputs.t2_probe_time_constant_s;
        let outer_ratio = 1.0 - params.compressor.inner_capacity_ratio;
        let all: [f64; MAX_STATES] = [
            self.shaft_balance_w(outputs) / (params.shaft_inertia_kgm2 * state.shaft_speed_rad_s),
            air::HEAT_CAPACITY_RATIO * self.gas_constant_j_kgk * outputs.t2_k / params.outlet.volume_m3
                * (outputs.flow_kg_s - outputs.valve_flow_kg_s + outputs.added.outlet_flow_kg_s),
            self.compressor_housing_balance_w(state, outputs)
                / (outer_ratio * housing::compressor_capacity_j_k(params, state.tc_k)),
            self.turbine_housing_balance_w(state, outputs)
                / housing::turbine_capacity_j_k(params, state.tt_k),
            if tau_s > 0.0 { (outputs.t2_probe_target_k - state.t2_tip_k) / tau_s } else { 0.0 },
            if N > 5 && self.model.has_inner_wall() {
                self.inner_wall_balance_w(outputs)
                    / (params.compressor.inner_capacity_ratio
                        * housing::compressor_capacity_j_k(params, state.inner_k))
            } else {
                0.0
            },
            outputs.added.extra_rates_k_s[0],
            outputs.added.extra_rates_k_s[1],
        ];
        std::array::from_fn(|i| all[i])
    }
}

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
