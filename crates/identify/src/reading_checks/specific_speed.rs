//! Compares speed, flow and head: the specific speed `omega sqrt(Q)/dh^0.75` is independent of the diameter. Radial compressors have 0.3 to 2
//! from surge to near choke, whatever their size (Cordier's diagram, e.g. Balje, Turbomachines, 1981).
//!
//! A wrong unit changes it far more than machines differ: 1/s for rpm by 60, kg/h for kg/s by 60.

use crate::reading_checks::ends::Ends;
use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::{Scaled, Warning};
use mapper_numerics::statistics::median;
use mapper_physics::machine::state::rad_s_of_rpm;

/// Exponent of the head. Source: definition of the specific speed.
const HEAD_EXPONENT: f64 = 0.75;

/// Limits for the median of a campaign's points, with a wide margin about real machines. Bound: radial compressors have 0.3 to 2
/// (Cordier's diagram).
const POSSIBLE: std::ops::RangeInclusive<f64> = 0.15..=4.0;

pub(crate) fn failed_checks(ends: &[Option<Ends>]) -> Option<FailedCheck> {
    let used: Vec<&Ends> = ends.iter().flatten().filter(|end| end.isentropic_rise_k() > 0.0).collect();
    let of = |end: &&Ends| {
        let omega_rad_s = rad_s_of_rpm(end.speed_rpm);
        let flow_m3_s = end.flow_kg_s * end.air.gas_constant_j_kgk() * end.t1_k / end.p1_pa;
        let head_j_kg = end.air.heat_capacity_j_kgk(end.t1_k) * end.isentropic_rise_k();
        omega_rad_s * flow_m3_s.max(0.0).sqrt() / head_j_kg.powf(HEAD_EXPONENT)
    };
    let middle = median(used.iter().map(of).filter(|speed| speed.is_finite()))?;
    if POSSIBLE.contains(&middle) {
        return None;
    }
    let of_middle = |read: fn(&Ends) -> f64| median(used.iter().map(|end| read(end))).unwrap_or(f64::NAN);
    let scaled = Scaled::SpecificSpeed {
        speed_rpm: of_middle(|end| end.speed_rpm),
        flow_kg_s: of_middle(|end| end.flow_kg_s),
        pressure_ratio: of_middle(|end| end.p2_pa / end.p1_pa),
        specific_speed: middle,
    };
    Some(FailedCheck::new(Warning::ScaledChannel(scaled), (0..ends.len()).collect()))
}
