//! Head against speed squared: similar points of a compressor have the same head coefficient at every speed.
//!
//! `dT_is/N^2` is a smooth function of the flow coefficient `m T1/(P1 N)`, with a slow change by compressibility (Dixon and
//! Hall, Fluid Mechanics and Thermodynamics of Turbomachinery, ch. 2: dimensional analysis). A fault of P1 or P2 adds a rise that
//! does not go with the speed squared: 10 % of P2 are 8 K at every speed, where 50 krpm have 12 K. And what comes with the time of the
//! run alone creeps.

use crate::findings::code;
use crate::objections::ends::Ends;
use crate::objections::linear::{Coefficient, fit};
use crate::objections::objection::Objection;
use mapper_numerics::statistics::median;

/// Points and ratio of the largest to the smallest speed from which on the speeds can be compared.
const FEWEST: usize = 10;
const LEAST_SPEED_RATIO: f64 = 1.6;
/// Rise that does not go with the speed squared, K: near choke the curves of real maps are not similar, which passes for 3 K.
const MOST_K: f64 = 6.0;
/// Rise that comes over the run, K.
const MOST_CREEP_K: f64 = 3.0;
/// Standard errors that a finding has at least.
const SIGMAS: f64 = 8.0;

pub(crate) fn objections(ends: &[Option<Ends>]) -> Vec<Objection> {
    let rises: Vec<(&Ends, f64)> = ends.iter().flatten().map(|end| (end, end.isentropic_rise_k())).collect();
    let Some(Trend { aside, creep }) = trend(&rises) else { return Vec::new() };
    let mut said = Vec::new();
    if aside.value.abs() > MOST_K.max(SIGMAS * aside.error) {
        said.push(format!(
            "{:+.1} +/- {:.1} K of the isentropic temperature rise do not go with the speed squared",
            aside.value,
            2.0 * aside.error
        ));
    }
    if creep.over(MOST_CREEP_K) {
        said.push(format!(
            "the isentropic temperature rise creeps by {:+.1} +/- {:.1} K over the run at the same speed and flow",
            creep.value,
            2.0 * creep.error
        ));
    }
    if said.is_empty() {
        return Vec::new();
    }
    let message = format!(
        "{}, which no compressor does: P1 or P2 is scaled, off or creeps (or N or m_c is); check unit, zero and line of the pressures",
        said.join(", and ")
    );
    vec![Objection::new(code::SCALED_CHANNEL, message, (0..ends.len()).collect())]
}

/// What a temperature rise has beside what goes with the speed squared, K.
pub(crate) struct Trend {
    /// The same at all speeds.
    pub(crate) aside: Coefficient,
    /// What comes over the run.
    pub(crate) creep: Coefficient,
}

/// Fits `rise/N^2` by flow coefficient and speed, with what is the same at all speeds, and what comes over the run; `None` where points
/// or speeds are too few.
pub(crate) fn trend(rises: &[(&Ends, f64)]) -> Option<Trend> {
    let used: Vec<&(&Ends, f64)> =
        rises.iter().filter(|(end, rise_k)| end.speed_rpm > 0.0 && rise_k.is_finite()).collect();
    let (slowest, fastest) = used.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), (end, _)| {
        (low.min(end.speed_rpm), high.max(end.speed_rpm))
    });
    if used.len() < FEWEST || fastest < LEAST_SPEED_RATIO * slowest {
        return None;
    }
    let column = |of: &dyn Fn(&Ends) -> f64| used.iter().map(|(end, _)| of(end)).collect::<Vec<f64>>();
    let relative = |end: &Ends| end.speed_rpm / fastest;
    let flow = |end: &Ends| end.flow_kg_s * end.t1_k / (end.p1_pa * relative(end));
    let middle = median(column(&flow))?;
    let off_middle = |end: &Ends| flow(end) / middle - 1.0;
    let (first_s, last_s) = used.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (end, _)| {
        (low.min(end.end_s), high.max(end.end_s))
    });
    let time = |end: &Ends| (end.end_s - first_s) / (last_s - first_s) - 0.5;
    let aside = |end: &Ends| relative(end).powi(-2);
    let mut columns = vec![
        column(&|_| 1.0),
        column(&off_middle),
        column(&|end| off_middle(end).powi(2)),
        column(&|end| relative(end).powi(2) - 1.0),
        column(&aside),
    ];
    let values: Vec<f64> = used.iter().map(|(end, rise_k)| rise_k * aside(end)).collect();
    let steady = fit(&columns, &values)?;
    columns.push(column(&|end| aside(end) * time(end)));
    let creeping = fit(&columns, &values)?;
    Some(Trend { aside: *steady.get(4)?, creep: *creeping.get(5)? })
}
