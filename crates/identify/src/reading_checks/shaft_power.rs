//! Compares compressor and turbine power: a shaft cannot deliver more than it receives.
//!
//! `m_c (h2 - h1)` against `m_t (h3 - h4)`, the whole enthalpy that the exhaust gas loses, heat included. Bearings and housings take 10
//! to 40 % of it. A single point may exceed it for a while, if a hot compressor housing heats the air or the shaft slows down. The median of a
//! campaign may not.

use crate::reading_checks::ends::Ends;
use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::{Channel, Scaled, Warning, check_running};
use mapper_numerics::statistics::median;
use mapper_physics::gas::air::Air;

/// Limits for the ratio of compressor to turbine power. Bound: upper, and lower. A turbine housing that loses as much as it delivers is
/// far below every gas stand.
const POSSIBLE: std::ops::RangeInclusive<f64> = 0.2..=1.15;

pub(crate) fn failed_checks(ends: &[Option<Ends>]) -> Option<FailedCheck> {
    let powers_w: Vec<(f64, f64)> = ends
        .iter()
        .flatten()
        .filter_map(|end| {
            let (flow_kg_s, t3_k, t4_k) = (end.turbine_flow_kg_s?, end.t3_k?, end.t4_k?);
            let running = [(Channel::TurbineFlow, flow_kg_s), (Channel::T3, t3_k), (Channel::T4, t4_k)];
            if running.into_iter().any(|(channel, value)| check_running(channel, value).is_err()) {
                return None;
            }
            let taken = end.flow_kg_s * end.air.enthalpy_rise_j_kg(end.t1_k, end.t2_k);
            let given = flow_kg_s * Air::new(end.turbine_gas, 0.0).enthalpy_rise_j_kg(t4_k, t3_k);
            (given > 0.0).then_some((taken, given))
        })
        .collect();
    let of_points = median(powers_w.iter().map(|(taken, given)| taken / given))?;
    let of = |read: fn(&(f64, f64)) -> f64| median(powers_w.iter().map(read)).unwrap_or(f64::NAN);
    let (compressor_w, turbine_w) = (of(|powers| powers.0), of(|powers| powers.1));
    // The ratio of few points, as early in a run, may be that of a cooling housing at low power; a wrong scale shows in both.
    let power_ratio = compressor_w / turbine_w;
    let is_possible = [of_points, power_ratio].iter().any(|ratio| POSSIBLE.contains(ratio));
    if is_possible || 2 * powers_w.len() < ends.len() {
        return None;
    }
    let scaled = Scaled::ShaftPower { compressor_w, turbine_w, power_ratio };
    Some(FailedCheck::new(Warning::ScaledChannel(scaled), (0..ends.len()).collect()))
}
