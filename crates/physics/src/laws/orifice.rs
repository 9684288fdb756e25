//! The back-pressure valve as an isentropic orifice (St. Venant and Wantzel).
//!
//! Domain: a perfect gas with constant gamma = 1.4, as in the paper's model; hot air at 450 K has 1.39, which moves
//! the flow by 0.3 %. The pressure is total before the throat and static after it; backflow is not modelled.

use crate::gas::air::{GAS_CONSTANT_J_KGK, HEAT_CAPACITY_RATIO as G};

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
