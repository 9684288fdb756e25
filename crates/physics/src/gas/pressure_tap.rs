//! Relation of the static pressure at the wall of a pipe and the total pressure of its flow.
//!
//! One-dimensional isentropic relations of a perfect gas (e.g. Shapiro, The Dynamics and Thermodynamics of
//! Compressible Fluid Flow, ch. 4), with the ratio of specific heats at the total temperature. Domain: subsonic flow that
//! fills the pipe, 250 to 800 K (see [`air`]).

use crate::gas::air;
use mapper_numerics::root::bisect;

fn heat_capacity_ratio(temperature_k: f64) -> f64 {
    let cp = air::heat_capacity_j_kgk(temperature_k);
    cp / (cp - air::GAS_CONSTANT_J_KGK)
}

/// Total pressure, Pa, of a flow in a pipe, from the static pressure at its wall.
///
/// Continuity gives `m sqrt(R T0)/(p A) = sqrt(gamma) M sqrt(1 + (gamma-1)/2 M^2)`, a quadratic in M^2 for static
/// pressure and total temperature; then `p0/p = (1 + (gamma-1)/2 M^2)^(gamma/(gamma-1))`. Valid up to
/// Mach 1 and slightly beyond; all arguments positive. The sign of the flow does not matter.
pub fn static_to_total_pa(
    static_pa: f64,
    flow_kg_s: f64,
    total_temperature_k: f64,
    pipe_diameter_m: f64,
) -> f64 {
    let gamma = heat_capacity_ratio(total_temperature_k);
    let half = 0.5 * (gamma - 1.0);
    let area_m2 = 0.25 * std::f64::consts::PI * pipe_diameter_m * pipe_diameter_m;
    let flow_number_squared =
        air::GAS_CONSTANT_J_KGK * total_temperature_k / gamma * (flow_kg_s / (static_pa * area_m2)).powi(2);
    // M^2 (1 + half M^2) = K; in a form that keeps all digits at small Mach numbers.
    let mach_squared = 2.0 * flow_number_squared / (1.0 + (1.0 + 4.0 * half * flow_number_squared).sqrt());
    static_pa * (1.0 + half * mach_squared).powf(gamma / (gamma - 1.0))
}

/// Static pressure, Pa, at the wall: the inverse of [`static_to_total_pa`] on its subsonic branch.
///
/// `None` if the flow exceeds the choking flow of the pipe.
pub fn total_to_static_pa(
    total_pa: f64,
    flow_kg_s: f64,
    total_temperature_k: f64,
    pipe_diameter_m: f64,
) -> Option<f64> {
    let gamma = heat_capacity_ratio(total_temperature_k);
    // The total pressure rises with the static one above the sonic point; bisection between sonic and standstill.
    let sonic_pa = total_pa * (0.5 * (gamma + 1.0)).powf(-gamma / (gamma - 1.0));
    let total_of = |static_pa| static_to_total_pa(static_pa, flow_kg_s, total_temperature_k, pipe_diameter_m);
    if !matches!(
        total_of(sonic_pa).partial_cmp(&total_pa),
        Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
    ) {
        return None;
    }
    let (low_pa, high_pa) = bisect(sonic_pa, total_pa, 0.0, |static_pa| total_of(static_pa) < total_pa);
    Some(0.5 * (low_pa + high_pa))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Isentropic flow tables for gamma = 1.4 (NACA report 1135): p/p0 = 0.8430 at M = 0.5, 0.9725 at M = 0.2. Air
    /// at 250 K has gamma = 1.4009 in the closed form used here; four printed digits allow 2e-4.
    #[test]
    fn pressure_ratios_follow_the_isentropic_tables() {
        let (total_temperature_k, diameter_m, static_pa) = (250.0, 0.04, 9.0e4);
        let area_m2 = std::f64::consts::PI * 4e-4;
        for (mach, table) in [(0.2f64, 0.9725), (0.5, 0.8430), (0.8, 0.6560)] {
            let temperature_k = total_temperature_k / (1.0 + 0.2 * mach * mach);
            let velocity_m_s = mach * (1.4f64 * 287.05 * temperature_k).sqrt();
            let flow_kg_s = static_pa / (287.05 * temperature_k) * area_m2 * velocity_m_s;
            let total_pa = static_to_total_pa(static_pa, flow_kg_s, total_temperature_k, diameter_m);
            assert!((static_pa / total_pa / table - 1.0).abs() < 1e-3, "M {mach}: {}", static_pa / total_pa);
        }
    }

    /// Slow flow: Bernoulli, `p0 = p + rho v^2/2`.
    #[test]
    fn slow_flow_follows_bernoulli() {
        let (static_pa, flow_kg_s, temperature_k, diameter_m) = (1.0e5, 0.01, 300.0, 0.04);
        let area_m2 = std::f64::consts::PI * 4e-4;
        let density = static_pa / (287.05 * temperature_k);
        let dynamic_pa = flow_kg_s * flow_kg_s / (2.0 * density * area_m2 * area_m2);
        let found_pa = static_to_total_pa(static_pa, flow_kg_s, temperature_k, diameter_m) - static_pa;
        // Compressibility is of the order of M^2/4, here 1e-4.
        assert!((found_pa / dynamic_pa - 1.0).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn total_and_static_are_inverse(
            static_pa in 0.8e5..4e5f64, flow_kg_s in 0.0..0.2f64, temperature_k in 280.0..450.0f64,
        ) {
            let total_pa = static_to_total_pa(static_pa, flow_kg_s, temperature_k, 0.05);
            prop_assert!(total_pa >= static_pa);
            let back_pa = total_to_static_pa(total_pa, flow_kg_s, temperature_k, 0.05);
            let area_m2 = 0.25 * std::f64::consts::PI * 0.0025;
            let mach = flow_kg_s * (287.05 * temperature_k).sqrt() / (static_pa * area_m2);
            prop_assume!(mach < 0.9);
            prop_assert!((back_pa.unwrap() / static_pa - 1.0).abs() < 1e-9);
        }
    }
}
