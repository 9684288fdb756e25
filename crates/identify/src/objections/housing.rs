//! Tc against T2: the housing's heat balance.
//!
//! Within a step the housing goes from one temperature to another, and T2 follows it by a share `s` that the step itself tells
//! (`T2 = s Tc + (1 - s) T2ad`, eq. 3, so that `s` is the slope of T2 over Tc, whatever the offsets). The gas then gives the
//! housing `K (T2 - Tc)` with `K = m cp s/(1 - s)`, and what it gives is stored or lost:
//!
//! `K (T2 - Tc) = C dTc/dt + b Tc - a + alpha K (Tc - T1) + K d`
//!
//! with one heat capacity `C`, one loss `b` to oil, cell and turbine, and one share `alpha` before the wheel for the whole recording. `d`
//! is what T2 reads more than Tc does of the same temperature. `K` changes by a factor of five over a map and `dTc/dt` its sign, so that `d` is
//! told to some tenths of a kelvin, by no map and no other recording. A housing that is no single mass moves `d` and blurs it, which its
//! standard error says.

use crate::IdentifyConfig;
use crate::findings::code;
use crate::objections::linear::{Coefficient, fit};
use crate::objections::objection::Objection;
use crate::samples::Samples;
use mapper_core::{Channel, Recording, StepKind, StepMarker, Window};
use mapper_numerics::statistics::mean;
use mapper_physics::air;

/// Whether the heat balance of the housing may object. An apparent efficiency has nothing to do with Tc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Balance {
    Asked,
    NotAsked,
}

/// Begin of what is looked at, after that of the step, s: speed, flow and probe have settled.
const AFTER_S: f64 = 10.0;
/// Part over which the housing's slope is taken, s.
const PART_S: f64 = 18.0;
/// Shortest step that is looked at, behind that begin, s. In less, a dozen independent readings tell neither the slope nor the share:
/// of twelve sound campaigns of such steps alone five came out 2.7 to 3.9 K off, with errors of 0.3 to 0.9 K.
const SHORTEST_S: f64 = 27.0;
/// Points from which on one balance can be told from another. Repeats add none: where they alone were long enough, ten steps at two
/// places closed only with 3.4 to 3.8 K, in three of forty sound campaigns.
const FEWEST_POINTS: usize = 8;
/// Rows of a part and of a step, at least.
const FEWEST_ROWS: usize = 10;
/// Shares of T2 that follow the housing and say something of it.
const SHARES: std::ops::RangeInclusive<f64> = 0.02..=0.95;
/// Samples at 10 Hz that remember each other, as noise of 2 s does.
const ALIKE: f64 = 20.0;
/// What a balance lacks, W, and share of the conductance.
const LACKS_W: f64 = 10.0;
const LACKS_RATIO: f64 = 0.05;
/// Difference of T2 and Tc, K, that a housing of one temperature does not explain, beside three declared standard deviations.
const MOST_K: f64 = 1.0;
const OFFSETS: f64 = 3.0;
/// The same of what comes over the run, K: a housing of two walls makes 3 K.
const MOST_CREEP_K: f64 = 3.0;
/// Standard errors that a finding has at least.
const SIGMAS: f64 = 8.0;
/// Middle of what Tc and T4 are, so that the constants stay small, K.
const AROUND_K: f64 = 330.0;

/// A part of a step.
struct Part {
    slope_k_s: f64,
    tc_k: f64,
    t1_k: f64,
    over_k: f64,
    conductance_w_k: f64,
    /// Of `conductance x over`, one standard deviation, W.
    error_w: f64,
    middle_s: f64,
}

pub(crate) fn objections(recording: &Recording, config: &IdentifyConfig) -> Option<Objection> {
    let steps: Vec<Vec<Part>> = recording
        .steps
        .iter()
        .map(|step| parts(recording, step.start_s + AFTER_S, step.end_s, config))
        .collect();
    let is_point =
        |(step, parts): &(&StepMarker, &Vec<Part>)| step.kind == StepKind::Point && !parts.is_empty();
    if recording.steps.iter().zip(&steps).filter(is_point).count() < FEWEST_POINTS {
        return None;
    }
    let parts: Vec<&Part> = steps.iter().flatten().collect();
    let (first_s, last_s) = parts.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), part| {
        (low.min(part.middle_s), high.max(part.middle_s))
    });
    let column =
        |of: &dyn Fn(&Part) -> f64| parts.iter().map(|part| of(part) / part.error_w).collect::<Vec<f64>>();
    let values = column(&|part| part.conductance_w_k * part.over_k);
    let mut columns = vec![
        column(&|part| part.slope_k_s),
        column(&|part| part.tc_k - AROUND_K),
        column(&|_| 1.0),
        column(&|part| part.conductance_w_k * (part.tc_k - part.t1_k)),
        column(&|part| part.conductance_w_k),
    ];
    let apart = *fit(&columns, &values)?.last()?;
    columns
        .push(column(&|part| part.conductance_w_k * ((part.middle_s - first_s) / (last_s - first_s) - 0.5)));
    let creep = *fit(&columns, &values)?.last()?;
    let offset =
        |channel: Channel| config.declared.get(&channel).map_or(0.0, |declared| declared.offset_sigma);
    let most_k = MOST_K + OFFSETS * offset(Channel::T2).hypot(offset(Channel::Tc));
    let told = |found: Coefficient, most_k: f64| found.value.abs() > most_k.max(SIGMAS * found.error);
    // Tc is named, for T2 has more that speaks for it.
    let said = if told(creep, MOST_CREEP_K) {
        format!("creeps by {:+.1} +/- {:.1} K over the run", -creep.value, 2.0 * creep.error)
    } else if told(apart, most_k) {
        format!("reads {:+.1} +/- {:.1} K too much", -apart.value, 2.0 * apart.error)
    } else {
        return None;
    };
    let message = format!(
        "the housing's heat balance, with what the gas gives it by T2 - Tc and what it stores by the slope of Tc, closes only if Tc {said} \
         beside T2: Tc or T2 is off or creeps, or the thermocouple is not where the heat is; compare them at standstill (`zero`)"
    );
    Some(Objection::new(code::SCALED_CHANNEL, message, (0..recording.steps.len()).collect()))
}

/// The parts of a step; none where T2 does not say how far it follows the housing.
fn parts(recording: &Recording, start_s: f64, end_s: f64, config: &IdentifyConfig) -> Vec<Part> {
    if end_s - start_s < SHORTEST_S {
        return Vec::new();
    }
    let samples = Samples::of(recording, Window { start_s, end_s }, config, true);
    let Some((kept, error)) = kept_ratio(&samples) else { return Vec::new() };
    if !SHARES.contains(&(1.0 - kept)) {
        return Vec::new();
    }
    let count = ((end_s - start_s) / PART_S).floor().min(8.0) as usize;
    let whole = samples.len();
    let part = |place: usize| {
        let range = place * whole / count..(place + 1) * whole / count;
        if range.len() < FEWEST_ROWS {
            return None;
        }
        let of = |column: &[f64]| mean(&column[range.clone()]);
        let (middle_s, tc_k, t1_k) = (of(&samples.t_s)?, of(&samples.tc_k)?, of(&samples.t1_k)?);
        let over_k = of(&samples.t2_k)? - tc_k;
        let capacity_w_k = of(&samples.flow_kg_s)? * air::heat_capacity_j_kgk(t1_k);
        let (top, bottom) = range.clone().fold((0.0, 0.0), |(top, bottom), i| {
            let since_s = samples.t_s[i] - middle_s;
            (top + since_s * samples.tc_k[i], bottom + since_s * since_s)
        });
        let conductance_w_k = capacity_w_k * (1.0 - kept) / kept;
        // d((1 - kept)/kept) = -d kept/kept^2.
        let by_kept_w = capacity_w_k * error / (kept * kept) * over_k;
        let error_w = by_kept_w.hypot(LACKS_W + LACKS_RATIO * conductance_w_k);
        let slope_k_s = top / bottom;
        (slope_k_s.is_finite() && error_w.is_finite()).then_some(Part {
            slope_k_s,
            tc_k,
            t1_k,
            over_k,
            conductance_w_k,
            error_w,
            middle_s,
        })
    };
    (0..count).filter_map(part).collect()
}

/// Share of its temperature after compression that the gas keeps, and the error of that: by least squares of `T2 - Tc = kept (T1 - Tc) +
/// (kept/eta) dT_is`.
fn kept_ratio(samples: &Samples) -> Option<(f64, f64)> {
    let count = samples.len();
    if count < 2 * FEWEST_ROWS {
        return None;
    }
    let row = |i: usize| {
        let rise_k = samples.t1_k[i] * samples.rise_ratio[i];
        (samples.t1_k[i] - samples.tc_k[i], rise_k, samples.t2_k[i] - samples.tc_k[i])
    };
    let (aa, ab, bb, ay, by) = (0..count).map(row).fold((0.0, 0.0, 0.0, 0.0, 0.0), |sums, (a, b, y)| {
        (sums.0 + a * a, sums.1 + a * b, sums.2 + b * b, sums.3 + a * y, sums.4 + b * y)
    });
    let determinant = aa * bb - ab * ab;
    let (kept, of_rise) = ((bb * ay - ab * by) / determinant, (aa * by - ab * ay) / determinant);
    let left: f64 = (0..count).map(row).map(|(a, b, y)| (y - kept * a - of_rise * b).powi(2)).sum();
    let variance = ALIKE * left / count as f64 * bb / determinant;
    (kept.is_finite() && variance.is_finite() && variance > 0.0).then(|| (kept, variance.sqrt()))
}
