//! Dimensionless coefficients of a compressor wheel and of the flow in its outlet pipe.
//!
//! Source: M. Casey and C. Robinson, "A method to estimate the performance map of a centrifugal compressor stage", J. Turbomachinery 135
//! (2013) 021034: tip-speed (blade) Mach number `Mu2 = u2/a1`, flow coefficient `phi = m/(rho1 u2 D2^2)`, work coefficient
//! `lambda = dh/u2^2`, all with total quantities at the inlet.

use crate::gas::air::Air;
use crate::gas::pressure_tap::total_to_static_pa;
use crate::laws::compression::isentropic_rise_ratio;
use serde::Serialize;
use std::f64::consts::PI;

/// A measured operating point of a compressor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Mass flow, kg/s.
    pub flow_kg_s: f64,
    /// Inlet total temperature, K.
    pub t1_k: f64,
    /// Inlet total pressure, Pa.
    pub p1_pa: f64,
    /// Total pressure ratio.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, fraction.
    pub eta: Option<f64>,
}

/// Coefficients of a wheel at an operating point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WheelCoefficients {
    /// Speed of the wheel at its exit diameter u2, m/s.
    pub tip_speed_m_s: f64,
    /// That speed over the speed of sound at the inlet's total temperature, Mu2.
    pub blade_mach_number: f64,
    /// Volume flow at the inlet over u2 D2^2, phi.
    pub flow_coefficient: f64,
    /// Specific work over u2^2, lambda; `None` without an efficiency.
    pub work_coefficient: Option<f64>,
}

impl WheelCoefficients {
    /// The coefficients at a point, for a wheel of this exit diameter.
    pub fn new(point: &MeasuredPoint, wheel_diameter_m: f64, air: Air) -> WheelCoefficients {
        let tip_speed_m_s = PI * wheel_diameter_m * point.speed_rpm / 60.0;
        let gas_constant_j_kgk = air.gas_constant_j_kgk();
        let cp_j_kgk = air.heat_capacity_j_kgk(point.t1_k);
        let sound_m_s = (cp_j_kgk / (cp_j_kgk - gas_constant_j_kgk) * gas_constant_j_kgk * point.t1_k).sqrt();
        let density_kg_m3 = point.p1_pa / (gas_constant_j_kgk * point.t1_k);
        let ideal_work_j_kg =
            cp_j_kgk * point.t1_k * isentropic_rise_ratio(point.pressure_ratio, point.t1_k, air);
        WheelCoefficients {
            tip_speed_m_s,
            blade_mach_number: tip_speed_m_s / sound_m_s,
            flow_coefficient: point.flow_kg_s
                / (density_kg_m3 * tip_speed_m_s * wheel_diameter_m * wheel_diameter_m),
            work_coefficient: point
                .eta
                .filter(|eta| *eta > 0.0)
                .map(|eta| ideal_work_j_kg / eta / (tip_speed_m_s * tip_speed_m_s)),
        }
    }
}

/// Static pressure, Pa, and Mach number of a flow in a pipe; `None` if it exceeds the choking flow.
pub fn pipe_flow(
    total_pa: f64,
    flow_kg_s: f64,
    total_k: f64,
    pipe_diameter_m: f64,
    air: Air,
) -> Option<(f64, f64)> {
    let static_pa = total_to_static_pa(total_pa, flow_kg_s, total_k, pipe_diameter_m)?;
    let cp_j_kgk = air.heat_capacity_j_kgk(total_k);
    let kappa = air.gas_constant_j_kgk() / cp_j_kgk;
    // T0/T = (p0/p)^kappa = 1 + (gamma - 1)/2 M^2, with (gamma - 1)/2 = kappa/(2 (1 - kappa)).
    let mach_number = (((total_pa / static_pa).powf(kappa) - 1.0) * 2.0 * (1.0 - kappa) / kappa).sqrt();
    Some((static_pa, mach_number))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The speed of sound in dry air at 15 degC is 340.3 m/s (ICAO standard atmosphere); 60 mm at 100 krpm are 314.2 m/s.
    #[test]
    fn the_coefficients_by_hand() {
        let point = MeasuredPoint {
            speed_rpm: 100e3,
            flow_kg_s: 0.05,
            t1_k: 288.15,
            p1_pa: 101_325.0,
            pressure_ratio: 2.0,
            eta: Some(0.75),
        };
        let found = WheelCoefficients::new(&point, 0.06, Air::PAPER);
        assert!((found.tip_speed_m_s - 314.16).abs() < 0.01);
        assert!((found.blade_mach_number - 314.16 / 340.3).abs() < 2e-3);
        // 1.225 kg/m3.
        assert!((found.flow_coefficient - 0.05 / (1.225 * 314.16 * 0.0036)).abs() < 1e-4);
        // cp T (2^0.2857 - 1)/0.75 = 1005 288.15 0.2190/0.75 = 84 560 J/kg.
        assert!((found.work_coefficient.unwrap() - 84_560.0 / 98_696.0).abs() < 3e-3);
    }

    /// NACA report 1135, gamma = 1.4: M = 0.3 at p/p0 = 0.9395.
    #[test]
    fn the_flow_in_a_pipe_by_table() {
        let (total_pa, total_k) = (200e3, 300.0);
        let (static_pa, static_k) = (0.9395 * total_pa, total_k / (1.0 + 0.2 * 0.09));
        let velocity_m_s = 0.3 * (1.4f64 * 287.05 * static_k).sqrt();
        let area_m2 = 0.25 * PI * 0.035 * 0.035;
        let flow_kg_s = static_pa / (287.05 * static_k) * velocity_m_s * area_m2;
        let (found_pa, mach) = pipe_flow(total_pa, flow_kg_s, total_k, 0.035, Air::PAPER).unwrap();
        assert!((found_pa / static_pa - 1.0).abs() < 1e-3 && (mach - 0.3).abs() < 1e-3, "{mach}");
    }
}
