//! Checks T2 against the physical limits of any compressor.
//!
//! T2 lies between isentropic compression and about three times that rise: turbocharger compressors have 0.3 to 0.85. A housing far from the
//! gas temperature changes this apparent efficiency, but for a rise of 20 K or more it stays within 0.2 to 1.3 (docs/reference/model.md: the housing
//! exchanges at most half of the capacity flow times its distance). Hot turbine inlet gas read as T2 is beyond that; a turbine may be driven
//! by cold gas.

use crate::reading_checks::ends::Ends;
use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::{Scaled, Swapped, Warning};
use mapper_numerics::statistics::median;

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

pub(crate) fn failed_checks(ends: &[Option<Ends>]) -> Vec<FailedCheck> {
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
            assert!(failed_checks(&ends_with(t3_k, None)).is_empty(), "{t3_k} K before the turbine");
        }
        let exchanged = failed_checks(&ends_with(388.0, Some(773.15)));
        assert!(matches!(exchanged[0].warning, Warning::SwappedChannels(_)), "{exchanged:?}");
    }
}
