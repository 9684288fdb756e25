//! Work against speed squared: Euler's equation of turbomachinery gives a wheel `U^2` times a function of the flow coefficient.
//!
//! The work is isentropic rise over efficiency, heat to and from the housing taken out by the two-parameter method, so that T1, T2
//! and Tc all count. What does not go with the speed squared is friction of small Reynolds numbers, which is positive and at most
//! some kelvin, or an offset; what comes with the time of the run is a creeping sensor, or fouling far beyond what one run can bring.

use crate::IdentifyConfig;
use crate::dynamic::Estimate;
use crate::findings::code;
use crate::objections::ends::Ends;
use crate::objections::head::{Trend, trend};
use crate::objections::objection::Objection;
use mapper_core::Channel;

/// Rise that does not go with the speed squared, K: published maps lose 2 to 10 points towards low speed, as 0.5 to 5 K would, and steps of
/// 20 s, each taken by itself, made 8 K of a sound machine that loses 8 points.
const MOST_K: f64 = 9.0;
const LEAST_K: f64 = -0.5;
/// Rise that comes over the run, K.
const MOST_CREEP_K: f64 = 1.5;
/// Standard errors that a finding has at least, and declared offsets that are allowed for.
const SIGMAS: f64 = 8.0;
const OFFSETS: f64 = 3.0;
/// Efficiencies that are used: beyond, a point says nothing of the work.
const USED: std::ops::RangeInclusive<f64> = 0.05..=3.0;

pub(crate) fn objections(
    ends: &[Option<Ends>],
    alone: &[Estimate],
    config: &IdentifyConfig,
) -> Vec<Objection> {
    let work = |end: &'_ Ends| {
        let (eta, _) = alone.get(end.position)?.eta.filter(|(eta, _)| USED.contains(eta))?;
        Some(end.isentropic_rise_k() / eta)
    };
    let rises: Vec<(&Ends, f64)> = ends.iter().flatten().filter_map(|end| Some((end, work(end)?))).collect();
    let Some(Trend { aside, creep }) = trend(&rises) else { return Vec::new() };
    let offset =
        |channel: Channel| config.declared.get(&channel).map_or(0.0, |declared| declared.offset_sigma);
    // A housing that reads 1 K too much takes about half a kelvin off the gas.
    let offset_k = offset(Channel::T1).hypot(offset(Channel::T2)).hypot(0.5 * offset(Channel::Tc));
    let mut said = Vec::new();
    let within = LEAST_K - OFFSETS * offset_k..=MOST_K + OFFSETS * offset_k;
    if !within.contains(&aside.value) && aside.value.abs() > SIGMAS * aside.error {
        said.push(format!(
            "{:+.1} +/- {:.1} K of the temperature rise do not go with the speed squared (0 to 5 K do not in sound compressors)",
            aside.value,
            2.0 * aside.error
        ));
    }
    if creep.over(MOST_CREEP_K) {
        said.push(format!(
            "the temperature rise creeps by {:+.1} +/- {:.1} K over the run at the same speed and flow",
            creep.value,
            2.0 * creep.error
        ));
    }
    if said.is_empty() {
        return Vec::new();
    }
    let message = format!(
        "{}: T1, T2 or Tc is scaled, off or creeps; compare them at standstill (`zero`), and mend the channel",
        said.join(", and ")
    );
    vec![Objection::new(code::SCALED_CHANNEL, message, (0..ends.len()).collect())]
}
