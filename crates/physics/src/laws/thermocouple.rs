//! The T2 probe: a small sphere in the outlet pipe (eqs. 11-12).
//!
//! Eq. 11 is Whitaker's correlation (AIChE J. 18, 1972) for a sphere: Re 3.5 to 7.6e4, Pr 0.71 to 380. The tip has one
//! temperature, which requires a Biot number below 0.1: here tips up to some 10 mm.

use crate::gas::air;

/// Density times heat capacity of the tip, J/(m3 K): 8600 kg/m3 and 480 J/(kg K) (type K).
const TIP_HEAT_CAPACITY_J_M3K: f64 = 8600.0 * 480.0;

/// Time constant of the probe's tip, s; 0 for an ideal probe.
///
/// Eq. 11 with the viscosity ratio taken as 1, eq. 12 for a sphere: `tau = rho c d^2/(6 Nu k)`. The Reynolds number
/// is that of the tip in the outlet pipe, `4 m d/(pi D^2 mu)`; properties at `t2_k`. `flow_kg_s` > 0.
#[inline]
pub fn time_constant_s(tip_diameter_m: f64, pipe_diameter_m: f64, flow_kg_s: f64, t2_k: f64) -> f64 {
    if tip_diameter_m <= 0.0 {
        return 0.0;
    }
    let mu = air::viscosity_pa_s(t2_k);
    let ln_k_ratio = air::ln_conductivity_ratio(t2_k);
    let k = air::CONDUCTIVITY_AT_300_K_W_MK * ln_k_ratio.exp();
    let ln_prandtl =
        (air::heat_capacity_j_kgk(t2_k) * mu / air::CONDUCTIVITY_AT_300_K_W_MK).ln() - ln_k_ratio;
    let reynolds =
        4.0 * flow_kg_s * tip_diameter_m / (std::f64::consts::PI * pipe_diameter_m * pipe_diameter_m * mu);
    let third_root = reynolds.cbrt();
    let nusselt = 2.0 + (0.4 * reynolds.sqrt() + 0.06 * third_root * third_root) * (0.4 * ln_prandtl).exp();
    TIP_HEAT_CAPACITY_J_M3K * tip_diameter_m * tip_diameter_m / (6.0 * nusselt * k)
}

/// `v^2/(2 cp)` in the outlet pipe, K, with `v = m/(rho A)` and `rho = P2/(R T2)`: the error of a probe without recovery.
#[inline]
pub fn dynamic_temperature_k(
    pipe_diameter_m: f64,
    flow_kg_s: f64,
    p2_pa: f64,
    t2_k: f64,
    gas_constant_j_kgk: f64,
) -> f64 {
    let area_m2 = 0.25 * std::f64::consts::PI * pipe_diameter_m * pipe_diameter_m;
    let velocity_m_s = flow_kg_s * gas_constant_j_kgk * t2_k / (p2_pa * area_m2);
    0.5 * velocity_m_s * velocity_m_s / air::heat_capacity_j_kgk(t2_k)
}

#[cfg(test)]
mod tests {
    /// A sphere of 10 mm in air of 300 K by hand, with the properties of a table (Incropera, table A.4): 0.05 kg/s in a pipe of
    /// 35 mm is Re = 28 150 on the tip and Nu = 2 + (0.4 Re^0.5 + 0.06 Re^(2/3)) Pr^0.4 = 108.7, so that
    /// tau = 8600 480 0.01^2/(6 Nu k) = 24.1 s.
    #[test]
    fn a_large_tip_follows_whitaker() {
        let tau_s = super::time_constant_s(10e-3, 35e-3, 0.05, 300.0);
        // Closed forms of air: 2 %.
        assert!((tau_s / 24.1 - 1.0).abs() < 0.02, "{tau_s} s");
    }

    /// 100 m/s of air carry v^2/(2 cp) = 1e4/2010 = 4.97 K.
    #[test]
    fn the_dynamic_temperature_is_that_of_the_velocity() {
        let density_kg_m3 = 150e3 / (287.05 * 350.0);
        let flow_kg_s = 100.0 * density_kg_m3 * 0.25 * std::f64::consts::PI * 0.035 * 0.035;
        let dynamic_k = super::dynamic_temperature_k(0.035, flow_kg_s, 150e3, 350.0, 287.05);
        // cp of 350 K: 1008 instead of 1005 J/(kg K).
        assert!((dynamic_k - 4.97).abs() < 0.03, "{dynamic_k} K");
    }

    /// The paper: "time constants can be as large as 10 s for a 3 mm thermocouple": at the lowest flows of the map.
    #[test]
    fn three_millimetres_take_about_ten_seconds() {
        let tau_s = super::time_constant_s(3e-3, 35e-3, 0.01, 300.0);
        assert!((8.0..12.0).contains(&tau_s), "{tau_s} s");
        assert_eq!(super::time_constant_s(0.0, 35e-3, 0.02, 315.0), 0.0);
    }
}
