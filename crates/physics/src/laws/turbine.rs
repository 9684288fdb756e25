//! Laws of the turbine, as an orifice with an efficiency.

use crate::gas::air;
use crate::gas::air::{Air, GAS_CONSTANT_J_KGK, HEAT_CAPACITY_RATIO as G, power};
use crate::gas::mixture::Gas;
use crate::laws::convection;
use crate::machine::params::{BoundaryConditions, TurbineParams, rad_s_of_rpm};

/// Friction power, W, from the friction coefficient c in W s^2/rad^2 and the shaft speed in rad/s.
pub fn friction_power_w(bearing_friction_w_s2: f64, shaft_speed_rad_s: f64) -> f64 {
    bearing_friction_w_s2 * shaft_speed_rad_s * shaft_speed_rad_s
}

/// A friction coefficient in W s^2/rad^2 as text: the power at 150 krpm to two digits, e.g. "370 W at 150 krpm".
pub fn at_150_krpm(bearing_friction_w_s2: f64) -> String {
    let power_w = friction_power_w(bearing_friction_w_s2, rad_s_of_rpm(150e3));
    if power_w == 0.0 || !power_w.is_finite() {
        return format!("{power_w} W at 150 krpm");
    }
    let second_digit = power_w.abs().log10().floor() as i32 - 1;
    let step_w = 10f64.powi(second_digit);
    let decimals = (-second_digit).max(0) as usize;
    format!("{:.decimals$} W at 150 krpm", (power_w / step_w).round() * step_w)
}

/// Reference state of the swallowing capacity: the ISA day.
const FLOW_REFERENCE_K: f64 = 288.15;
const FLOW_REFERENCE_PA: f64 = 101_325.0;
/// Exponent of the swallowing curve `1 - (P3/P4)^-1.1`.
pub const SWALLOWING_EXPONENT: f64 = -1.1;

/// Terms that depend only on the boundary conditions; computed once while these are constant.
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
    /// Heat-transfer coefficient at a gas viscosity of 1 Pa s at the wall; the actual viscosity enters with the exponent -0.14.
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
        let gas = Air::new(params.gas, 0.0);
        let flow_kg_s = params.choked_flow_kg_s
            * (1.0 - (SWALLOWING_EXPONENT * ln_expansion_ratio).exp()).sqrt()
            * (boundary.p3_pa / FLOW_REFERENCE_PA)
            / (boundary.t3_k / FLOW_REFERENCE_K).sqrt()
            / gas.dry_flow_ratio();
        let cp3_j_kgk = gas.heat_capacity_j_kgk(boundary.t3_k);
        // At equal viscosity of wall and gas the viscosity ratio is 1; scale this to a wall of 1 Pa s.
        let h_unit_wall_w_m2k = convection::coefficient_w_m2k(
            params.nusselt_coefficient,
            params.nusselt_exponent,
            params.inlet_diameter_m,
            flow_kg_s,
            boundary.t3_k,
            boundary.t3_k,
        ) * air::viscosity_pa_s(boundary.t3_k).powf(convection::WALL_EXPONENT);
        TurbineInlet {
            params: *params,
            t3_k: boundary.t3_k,
            flow_kg_s,
            ln_expansion_ratio,
            isentropic_drop_ratio: isentropic_drop_ratio(
                ln_expansion_ratio,
                gas.isentropic_exponent(boundary.t3_k),
            ),
            cp3_j_kgk,
            h_unit_wall_w_m2k,
        }
    }

    /// Efficiency by the parabola over the blade-speed ratio, with its peak at another one.
    #[inline]
    pub fn efficiency(params: &TurbineParams, blade_speed_ratio: f64, peak_blade_speed_ratio: f64) -> f64 {
        let deviation = (blade_speed_ratio - peak_blade_speed_ratio) / peak_blade_speed_ratio;
        (params.peak_efficiency * (1.0 - 0.8 * deviation * deviation)).max(0.05)
    }

    /// The turbine with a housing at `tt_k` and a shaft at `shaft_speed_rad_s`.
    ///
    /// `T4 = T3' - eta_t T3' (1 - (P3/P4)^(-R/cp(T3)))`, `W_t = m_t cp(T3) (T3' - T4)`, efficiency a parabola over
    /// blade-speed ratio.
    #[inline]
    pub fn at(&self, tt_k: f64, shaft_speed_rad_s: f64) -> TurbineState {
        let params = &self.params;
        let h_w_m2k = self.h_unit_wall_w_m2k * power(air::viscosity_pa_s(tt_k), -convection::WALL_EXPONENT);
        let conductance_w_k = h_w_m2k * params.internal_area_m2;
        let transfer_units = conductance_w_k / (self.flow_kg_s * self.cp3_j_kgk);
        let t3_prime_k = (self.t3_k + transfer_units * tt_k) / (1.0 + transfer_units);
        let cp_prime = params.gas.heat_capacity_j_kgk(t3_prime_k);
        let exponent = params.gas.gas_constant_j_kgk / cp_prime;
        let spouting_velocity_m_s =
            (2.0 * cp_prime * t3_prime_k * isentropic_drop_ratio(self.ln_expansion_ratio, exponent)).sqrt();
        let blade_speed_ratio = shaft_speed_rad_s * params.wheel_radius_m / spouting_velocity_m_s;
        let efficiency = Self::efficiency(params, blade_speed_ratio, params.peak_blade_speed_ratio);
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

/// Isentropic drop of the specific enthalpy from a total inlet state to the outlet pressure, J/kg: `h(T) - h(T_s)` with
/// `s(T_s, p4) = s(T, p3)`. The denominator of a turbine's efficiency (SAE J1826).
///
/// ```
/// use mapper_physics::{gas::mixture::Gas, laws::turbine::isentropic_drop_j_kg};
/// // Air tables (Moran and Shapiro, table A-22): from 773.15 K to a third of the pressure 211.2 kJ/kg.
/// assert!((isentropic_drop_j_kg(Gas::air(), 773.15, 3.0) / 211.2e3 - 1.0).abs() < 2e-3);
/// ```
pub fn isentropic_drop_j_kg(gas: Gas, inlet_k: f64, expansion_ratio: f64) -> f64 {
    let gas = Air::new(gas, 0.0);
    gas.enthalpy_rise_j_kg(gas.isentropic_k(inlet_k, expansion_ratio.recip()), inlet_k)
}

/// Blade speed at the wheel's inlet over the spouting velocity of that drop.
pub fn blade_speed_ratio(wheel_radius_m: f64, shaft_speed_rad_s: f64, isentropic_drop_j_kg: f64) -> f64 {
    shaft_speed_rad_s * wheel_radius_m / (2.0 * isentropic_drop_j_kg).sqrt()
}

/// `1 - ER^-kappa`, kappa = R/cp: the isentropic temperature drop over the inlet temperature.
#[inline]
fn isentropic_drop_ratio(ln_expansion_ratio: f64, exponent: f64) -> f64 {
    1.0 - (-exponent * ln_expansion_ratio).exp()
}

// The back-pressure valve as an isentropic orifice (St. Venant and Wantzel).
// Domain: a perfect gas with constant gamma = 1.4, as in the paper's model; hot air at 450 K has 1.39, which moves
// the flow by 0.3 %. The pressure is total before the throat and static after it; backflow is not modelled.

/// Mass flow of an isentropic orifice from (`p_up_pa`, `t_up_k`) to `p_down_pa`, choked below the critical pressure
/// ratio, kg/s; 0 without a forward pressure difference.
///
/// `effective_area_m2` is area times discharge coefficient.
#[inline]
pub fn flow_kg_s(effective_area_m2: f64, p_up_pa: f64, t_up_k: f64, p_down_pa: f64) -> f64 {
    if p_up_pa <= p_down_pa {
        return 0.0;
    }
    // (2/(g+1))^(g/(g-1)) for g = 1.4.
    const CRITICAL_RATIO: f64 = 0.528_281_787_717_174;
    let r = (p_down_pa / p_up_pa).max(CRITICAL_RATIO);
    // r^(2/g) and r^((g+1)/g) = r^(2/g) r^((g-1)/g).
    let r_kappa = r.powf((G - 1.0) / G);
    let r_2_g = (r / r_kappa) * (r / r_kappa);
    let shape = 2.0 * G / (G - 1.0) * r_2_g * (1.0 - r_kappa);
    effective_area_m2 * p_up_pa / (GAS_CONSTANT_J_KGK * t_up_k).sqrt() * shape.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::params::Params;

    /// By hand: 150 krpm are 15708 rad/s, their square 2.467e8, times 1.49e-6 368 W.
    #[test]
    fn power_by_hand() {
        let power_w = friction_power_w(1.49e-6, rad_s_of_rpm(150e3));
        // Four figures by hand.
        assert!((power_w - 367.6).abs() < 0.1, "{power_w}");
    }

    #[test]
    fn two_figures() {
        assert_eq!(at_150_krpm(1.49e-6), "370 W at 150 krpm");
        assert_eq!(at_150_krpm(1.5e-7), "37 W at 150 krpm");
        assert_eq!(at_150_krpm(-2.9e-8), "-7.2 W at 150 krpm");
        assert_eq!(at_150_krpm(0.0), "0 W at 150 krpm");
    }

    /// A turbine without heat loss and with efficiency 1 at every blade-speed ratio that a test can reach.
    fn inlet(expansion_ratio: f64, t3_k: f64) -> TurbineInlet {
        let params =
            TurbineParams { internal_area_m2: 0.0, peak_efficiency: 1.0, ..Params::default().turbine };
        let p4_pa = 110e3;
        let boundary = BoundaryConditions {
            p3_pa: expansion_ratio * p4_pa,
            t3_k,
            p4_pa,
            ..BoundaryConditions::default()
        };
        TurbineInlet::new(&params, &boundary)
    }

    /// The turbine at its best blade-speed ratio.
    fn at_best(inlet: &TurbineInlet) -> TurbineState {
        let per_rad_s = inlet.at(400.0, 1.0).blade_speed_ratio;
        inlet.at(400.0, inlet.params.peak_blade_speed_ratio / per_rad_s)
    }

    /// NACA report 1135, gamma = 1.4: at p/p0 = 0.5283 the isentropic temperature is 0.8333 T0. Air of 300 K has 1.3997.
    #[test]
    fn an_ideal_expansion_follows_the_isentropic_tables() {
        let state = at_best(&inlet(1.0 / 0.5283, 300.0));
        assert!((state.efficiency - 1.0).abs() < 1e-12);
        assert!((state.t4_k / 300.0 - 0.8333).abs() < 3e-4, "{} K", state.t4_k);
        assert_eq!(state.heat_w, 0.0);
    }

    /// Air tables (Moran and Shapiro, table A-22): from 773.15 K (h = 792.5 kJ/kg, pr = 41.95) to a third of the pressure the
    /// isentropic end is at pr = 13.98, h = 581.3 kJ/kg. The constant cp of the inlet costs 1 %.
    #[test]
    fn the_power_of_hot_gas_is_its_drop_of_enthalpy() {
        let hot = inlet(3.0, 773.15);
        let state = at_best(&hot);
        let drop_j_kg = state.power_w / hot.flow_kg_s;
        assert!((drop_j_kg / 211.2e3 - 1.0).abs() < 0.01, "{drop_j_kg} J/kg");
    }

    /// Choked, on the ISA day, it swallows its declared flow; hotter gas in proportion to 1/sqrt(T3).
    #[test]
    fn the_swallowing_curve_is_corrected_to_the_isa_day() {
        let choked = inlet(1e6, FLOW_REFERENCE_K);
        let corrected_kg_s = choked.flow_kg_s * FLOW_REFERENCE_PA / (1e6 * 110e3);
        assert!((corrected_kg_s / Params::default().turbine.choked_flow_kg_s - 1.0).abs() < 1e-6);
        assert!((inlet(2.0, 1152.6).flow_kg_s / inlet(2.0, FLOW_REFERENCE_K).flow_kg_s - 0.5).abs() < 1e-12);
    }
}

#[cfg(test)]
mod orifice_tests {
    use super::*;

    /// ISO 9300 / any gas dynamics text: C* = sqrt(g (2/(g+1))^((g+1)/(g-1))) = 0.684731 for g = 1.4.
    #[test]
    fn choked_flow_has_the_critical_flow_function() {
        let flow = flow_kg_s(1e-4, 400e3, 350.0, 100e3);
        let critical = flow * (GAS_CONSTANT_J_KGK * 350.0).sqrt() / (1e-4 * 400e3);
        assert!((critical - 0.684_731).abs() < 1e-6, "{critical}");
        assert_eq!(flow, flow_kg_s(1e-4, 400e3, 350.0, 10e3));
        assert_eq!(flow_kg_s(1e-4, 100e3, 350.0, 100e3), 0.0);
    }

    /// NACA report 1135, gamma = 1.4: at p/p0 = 0.8430 the flow is at Mach 0.5, where A*/A = 1/1.3398.
    #[test]
    fn subsonic_flow_follows_the_isentropic_tables() {
        let ratio = flow_kg_s(1e-4, 400e3, 350.0, 0.8430 * 400e3) / flow_kg_s(1e-4, 400e3, 350.0, 100e3);
        // Four printed digits of the pressure ratio.
        assert!((ratio - 1.0 / 1.3398).abs() < 2e-4, "{ratio}");
    }
}
