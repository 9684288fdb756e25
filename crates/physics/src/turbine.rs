//! The turbine (vanes fixed): swallowing, heat to the housing, expansion.

use crate::air::{self, GAS_CONSTANT_J_KGK};
use crate::nusselt;
use crate::params::{BoundaryConditions, TurbineParams};

/// State of the ISA day to which the swallowing curve is corrected.
const FLOW_REFERENCE_K: f64 = 288.15;
const FLOW_REFERENCE_PA: f64 = 101_325.0;
/// Exponent of the swallowing curve `1 - (P3/P4)^-1.1`.
const SWALLOWING_EXPONENT: f64 = -1.1;

/// What depends on the boundary conditions alone; made once for as long as they hold.
#[derive(Debug, Clone, Copy)]
pub struct TurbineInlet {
    params: TurbineParams,
    t3_k: f64,
    /// Gas flow, kg/s.
    pub flow_kg_s: f64,
    ln_expansion_ratio: f64,
    /// `1 - (P3/P4)^(-R/cp(T3))`, the isentropic drop over T3'.
    isentropic_drop_ratio: f64,
    cp3_j_kgk: f64,
    /// Heat-transfer coefficient for a wall of viscosity 1 Pa s; the wall's own viscosity enters with ^-0.14.
    h_unit_wall_w_m2k: f64,
}

/// The turbine at one housing temperature and speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurbineState {
    /// Before the wheel (station 3'), K.
    pub t3_prime_k: f64,
    /// At the outlet (station 4), K.
    pub t4_k: f64,
    /// Heat from gas to metal, W.
    pub heat_w: f64,
    /// Power to the shaft, W.
    pub power_w: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: f64,
    /// Efficiency, total to static, fraction.
    pub efficiency: f64,
    /// Blade speed over spouting velocity.
    pub blade_speed_ratio: f64,
}

impl TurbineInlet {
    /// Prepares the turbine for boundary conditions with `p3_pa > p4_pa`.
    #[inline]
    pub fn new(params: &TurbineParams, boundary: &BoundaryConditions) -> Self {
        let expansion_ratio = boundary.p3_pa / boundary.p4_pa;
        let ln_expansion_ratio = expansion_ratio.ln();
        let flow_kg_s = params.choked_flow_kg_s
            * (1.0 - (SWALLOWING_EXPONENT * ln_expansion_ratio).exp()).sqrt()
            * (boundary.p3_pa / FLOW_REFERENCE_PA)
            / (boundary.t3_k / FLOW_REFERENCE_K).sqrt();
        let cp3_j_kgk = air::heat_capacity_j_kgk(boundary.t3_k);
        // A wall as viscous as the gas gives the plain correlation; scale that to a wall of 1 Pa s.
        let h_unit_wall_w_m2k = nusselt::coefficient_w_m2k(
            params.nusselt_coefficient,
            params.nusselt_exponent,
            params.inlet_diameter_m,
            flow_kg_s,
            boundary.t3_k,
            boundary.t3_k,
        ) * air::viscosity_pa_s(boundary.t3_k).powf(nusselt::WALL_EXPONENT);
        TurbineInlet {
            params: *params,
            t3_k: boundary.t3_k,
            flow_kg_s,
            ln_expansion_ratio,
            isentropic_drop_ratio: isentropic_drop_ratio(ln_expansion_ratio, cp3_j_kgk),
            cp3_j_kgk,
            h_unit_wall_w_m2k,
        }
    }

    /// The turbine with a housing at `tt_k` and a shaft at `shaft_speed_rad_s`.
    ///
    /// `T4 = T3' - eta_t T3' (1 - (P3/P4)^(-R/cp(T3)))`, `W_t = m_t cp(T3) (T3' - T4)`, efficiency a parabola over
    /// blade-speed ratio.
    #[inline]
    pub fn at(&self, tt_k: f64, shaft_speed_rad_s: f64) -> TurbineState {
        let params = &self.params;
        let h_w_m2k = self.h_unit_wall_w_m2k * air::viscosity_pa_s(tt_k).powf(-nusselt::WALL_EXPONENT);
        let conductance_w_k = h_w_m2k * params.internal_area_m2;
        let transfer_units = conductance_w_k / (self.flow_kg_s * self.cp3_j_kgk);
        let t3_prime_k = (self.t3_k + transfer_units * tt_k) / (1.0 + transfer_units);
        let cp_prime = air::heat_capacity_j_kgk(t3_prime_k);
        let spouting_velocity_m_s =
            (2.0 * cp_prime * t3_prime_k * isentropic_drop_ratio(self.ln_expansion_ratio, cp_prime)).sqrt();
        let blade_speed_ratio = shaft_speed_rad_s * params.wheel_radius_m / spouting_velocity_m_s;
        let away = (blade_speed_ratio - params.peak_blade_speed_ratio) / params.peak_blade_speed_ratio;
        let efficiency = (params.peak_efficiency * (1.0 - 0.8 * away * away)).max(0.05);
        let drop_k = efficiency * t3_prime_k * self.isentropic_drop_ratio;
        TurbineState {
            t3_prime_k,
            t4_k: t3_prime_k - drop_k,
            heat_w: conductance_w_k * (t3_prime_k - tt_k),
            power_w: self.flow_kg_s * self.cp3_j_kgk * drop_k,
            h_w_m2k,
            efficiency,
            blade_speed_ratio,
        }
    }
}

/// `1 - ER^(-R/cp)`: the isentropic temperature drop over the inlet temperature.
#[inline]
fn isentropic_drop_ratio(ln_expansion_ratio: f64, cp_j_kgk: f64) -> f64 {
    1.0 - (-GAS_CONSTANT_J_KGK / cp_j_kgk * ln_expansion_ratio).exp()
}
