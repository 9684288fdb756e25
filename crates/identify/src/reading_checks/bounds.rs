//! Checks the readings of compressor and turbine against physics: limits of any compressor, specific speed, and the power of the shaft.
//!
//! T2 lies between isentropic compression and about three times that rise: turbocharger compressors have 0.3 to 0.85. A housing far from the
//! gas temperature changes this apparent efficiency, but for a rise of 20 K or more it stays within 0.2 to 1.3 (docs/reference/model.md: the housing
//! exchanges at most half of the capacity flow times its distance). Hot turbine inlet gas read as T2 is beyond that; a turbine may be driven
//! by cold gas.

use crate::reading_checks::ends::{Ends, FailedCheck};
use mapper_core::{Channel, Scaled, Swapped, Warning, check_running};
use mapper_numerics::statistics::median;
use mapper_physics::gas::air::Air;
use mapper_physics::machine::params::rad_s_of_rpm;

/// Isentropic rise above which heat no longer hides the work, K. Bound: heat changes T2 by less than half of it.
const MIN_RISE_K: f64 = 20.0;
/// Isentropic efficiencies, total to total, of turbocharger compressors. Bound: the best stay below 0.85, poor ones near choke have a
/// third.
pub const EFFICIENCY: std::ops::RangeInclusive<f64> = 0.25..=0.88;
/// Apparent efficiencies of single points. Bound: they include the heat of a housing far from the gas.
const APPARENT: std::ops::RangeInclusive<f64> = 0.2..=1.3;
/// Apparent efficiency of the median point. Bound: there the housing is warmer than the gas before compression and colder than the gas
/// after it.
const MIDDLE: std::ops::RangeInclusive<f64> = 0.35..=1.0;

pub(crate) fn efficiency_checks(ends: &[Option<Ends>]) -> Vec<FailedCheck> {
    let known: Vec<&Ends> = ends.iter().flatten().collect();
    let all = || (0..ends.len()).collect::<Vec<usize>>();
    let mut found = Vec::new();
    let below = known.iter().filter(|end| end.p2_pa < end.p1_pa).count();
    if 2 * below > known.len() {
        let middle = |read: fn(&Ends) -> f64| median(known.iter().map(|end| read(end))).unwrap_or(f64::NAN);
        let swapped = Swapped::P2BelowP1 {
            points: below,
            of: known.len(),
            p1_pa: middle(|end| end.p1_pa),
            p2_pa: middle(|end| end.p2_pa),
        };
        found.push(FailedCheck::new(Warning::SwappedChannels(swapped), all()));
        return found;
    }
    let apparent = |end: &Ends| end.isentropic_rise_k() / (end.t2_k - end.t1_k);
    // A turbine may be driven by cold gas, or by gas as warm as the compressor's outlet. Hot gas that is read as T2 is warmer than the
    // outlet of any compressor.
    let swapped =
        |end: &&&Ends| end.t3_k.is_some_and(|t3_k| end.t2_k > t3_k) && apparent(end) < *MIDDLE.start();
    if 2 * known.iter().filter(swapped).count() > known.len() {
        found.push(FailedCheck::new(Warning::SwappedChannels(Swapped::T2AboveT3), all()));
    }
    let judged: Vec<&&Ends> = known.iter().filter(|end| end.isentropic_rise_k() > MIN_RISE_K).collect();
    // Without a rise of T2 the efficiency is undefined; treat it as too high.
    let value = |end: &Ends| if end.t2_k > end.t1_k { apparent(end) } else { f64::INFINITY };
    let Some(middle) = median(judged.iter().map(|end| value(end))) else { return found };
    let impossible: Vec<usize> =
        judged.iter().filter(|end| !APPARENT.contains(&value(end))).map(|end| end.position).collect();
    if !MIDDLE.contains(&middle) || 2 * impossible.len() > judged.len() {
        let of = |read: fn(&Ends) -> f64| median(judged.iter().map(|end| read(end))).unwrap_or(f64::NAN);
        let scaled = Scaled::ApparentEfficiency {
            rise_k: of(|end| end.t2_k - end.t1_k),
            t1_k: of(|end| end.t1_k),
            pressure_ratio: of(|end| end.p2_pa / end.p1_pa),
            isentropic_rise_k: of(Ends::isentropic_rise_k),
            efficiency: middle,
        };
        found.push(FailedCheck::new(Warning::ScaledChannel(scaled), all()));
    } else if !impossible.is_empty() {
        found.push(FailedCheck::new(Warning::ScaledChannel(Scaled::SomePoints), impossible));
    }
    found
}

// Compares speed, flow and head: the specific speed `omega sqrt(Q)/dh^0.75` is independent of the diameter. Radial compressors have 0.3 to 2
// from surge to near choke, whatever their size (Cordier's diagram, e.g. Balje, Turbomachines, 1981).
// A wrong unit changes it far more than machines differ: 1/s for rpm by 60, kg/h for kg/s by 60.

/// Exponent of the head. Source: definition of the specific speed.
const HEAD_EXPONENT: f64 = 0.75;

/// Limits for the median of a campaign's points, with a wide margin about real machines. Bound: radial compressors have 0.3 to 2
/// (Cordier's diagram).
const SPECIFIC_SPEED: std::ops::RangeInclusive<f64> = 0.15..=4.0;

pub(crate) fn specific_speed_check(ends: &[Option<Ends>]) -> Option<FailedCheck> {
    let used: Vec<&Ends> = ends.iter().flatten().filter(|end| end.isentropic_rise_k() > 0.0).collect();
    let of = |end: &&Ends| {
        let omega_rad_s = rad_s_of_rpm(end.speed_rpm);
        let flow_m3_s = end.flow_kg_s * end.air.gas_constant_j_kgk() * end.t1_k / end.p1_pa;
        let head_j_kg = end.air.heat_capacity_j_kgk(end.t1_k) * end.isentropic_rise_k();
        omega_rad_s * flow_m3_s.max(0.0).sqrt() / head_j_kg.powf(HEAD_EXPONENT)
    };
    let middle = median(used.iter().map(of).filter(|speed| speed.is_finite()))?;
    if SPECIFIC_SPEED.contains(&middle) {
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

// Compares compressor and turbine power: a shaft cannot deliver more than it receives.
// `m_c (h2 - h1)` against `m_t (h3 - h4)`, the whole enthalpy that the exhaust gas loses, heat included. Bearings and housings take 10
// to 40 % of it. A single point may exceed it for a while, if a hot compressor housing heats the air or the shaft slows down. The median of a
// campaign may not.

/// Limits for the ratio of compressor to turbine power. Bound: upper, and lower. A turbine housing that loses as much as it delivers is
/// far below every gas stand.
const POWER_RATIO: std::ops::RangeInclusive<f64> = 0.2..=1.15;

pub(crate) fn power_check(ends: &[Option<Ends>]) -> Option<FailedCheck> {
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
    let is_possible = [of_points, power_ratio].iter().any(|ratio| POWER_RATIO.contains(ratio));
    if is_possible || 2 * powers_w.len() < ends.len() {
        return None;
    }
    let scaled = Scaled::ShaftPower { compressor_w, turbine_w, power_ratio };
    Some(FailedCheck::new(Warning::ScaledChannel(scaled), (0..ends.len()).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five ends of an efficiency of 0.7 at a pressure ratio of 2, with this gas before the turbine.
    fn ends_with(t3_k: f64, t2_read_k: Option<f64>) -> Vec<Option<Ends>> {
        let end = Ends {
            air: mapper_physics::gas::air::Air::PAPER,
            turbine_gas: mapper_physics::gas::mixture::Gas::CLOSED_FORM_AIR,
            position: 0,
            end_s: 0.0,
            valve_opening_ratio: 1.0,
            speed_rpm: 1e5,
            flow_kg_s: 0.1,
            p1_pa: 1e5,
            p2_pa: 2e5,
            t1_k: 298.15,
            t2_k: 0.0,
            tc_k: None,
            turbine_flow_kg_s: None,
            t3_k: Some(t3_k),
            t4_k: None,
        };
        let t2_k = t2_read_k.unwrap_or(end.t1_k + end.isentropic_rise_k() / 0.7);
        (0..5).map(|position| Some(Ends { position, t2_k, ..end })).collect()
    }

    /// Rigs drive turbines with cold gas; adiabatic mapping uses gas as warm as the compressor's outlet.
    #[test]
    fn gas_colder_than_the_outlet_is_no_mistake_and_hot_gas_read_as_t2_is_one() {
        for t3_k in [300.0, 385.0, 773.15] {
            assert!(efficiency_checks(&ends_with(t3_k, None)).is_empty(), "{t3_k} K before the turbine");
        }
        let exchanged = efficiency_checks(&ends_with(388.0, Some(773.15)));
        assert!(matches!(exchanged[0].warning, Warning::SwappedChannels(_)), "{exchanged:?}");
    }
}
