//! Flow against valve and P2: at one opening the back-pressure valve has one area.
//!
//! `m sqrt(T2)/(P2 psi(P1/P2))`, with the St. Venant and Wantzel function psi of an orifice that blows off to the inlet's
//! pressure, is the area of the valve. It may be anything, and need not go with the opening, but at one opening it is the same at
//! all speeds and all times. The check sees m_c, P2 and P1 (through P2 - P1); T2 counts by its root alone.

use crate::IdentifyConfig;
use crate::findings::code;
use crate::objections::ends::Ends;
use crate::objections::linear::fit;
use crate::objections::objection::Objection;
use mapper_core::{Channel, Recording, step_number};
use mapper_numerics::statistics::median;
use mapper_physics::orifice;

/// What a valve's discharge coefficient may vary with the pressure ratio, a meter with the flow, and a cell's pressure from the
/// inlet's, ratio.
const SAME_RATIO: f64 = 0.04;
/// Pressure over that behind the valve below which its flow says nothing of it, Pa: an exhaust line has some hundred.
const LEAST_PA: f64 = 5e3;
/// Standard deviations of the declared offsets that are allowed for besides.
const SIGMAS: f64 = 4.0;
/// Change over the run from which on a channel creeps: share of the flow, pressure in Pa, standard errors.
const MOST_CREEP_RATIO: f64 = 0.02;
const MOST_CREEP_PA: f64 = 1.5e3;
const CREEP_SIGMAS: f64 = 5.0;
/// Points at one opening from which they judge each other.
const FEWEST: usize = 3;

pub(crate) fn objections(
    recording: &Recording,
    ends: &[Option<Ends>],
    config: &IdentifyConfig,
) -> Option<Objection> {
    let declared = |channel: Channel| config.declared.get(&channel).copied().unwrap_or_default();
    let offset_pa = declared(Channel::P1).offset_sigma.hypot(declared(Channel::P2).offset_sigma);
    let offset_kg_s = declared(Channel::CompressorFlow).offset_sigma;
    let mut known: Vec<&Ends> =
        ends.iter().flatten().filter(|end| end.valve_opening_ratio.is_finite()).collect();
    known.sort_by(|a, b| a.valve_opening_ratio.total_cmp(&b.valve_opening_ratio));
    let mut deviations: Vec<(&Ends, f64)> = Vec::new();
    let (mut off, mut judged, mut worst): (Vec<usize>, usize, Option<(f64, &Ends)>) = (Vec::new(), 0, None);
    let same = |a: &&Ends, b: &&Ends| (a.valve_opening_ratio - b.valve_opening_ratio).abs() < 1e-6;
    for opening in known.chunk_by(same) {
        let areas_m2: Vec<Option<f64>> = opening.iter().map(|end| area_m2(end)).collect();
        let usable = areas_m2.iter().flatten().count();
        let Some(middle_m2) = median(areas_m2.iter().flatten()).filter(|_| usable >= FEWEST) else {
            continue;
        };
        for (end, area_m2) in opening.iter().zip(&areas_m2) {
            let Some(area_m2) = area_m2 else {
                // Flow through a closed pressure difference.
                if end.p2_pa < end.p1_pa {
                    off.push(end.position);
                    judged += 1;
                }
                continue;
            };
            judged += 1;
            let by = (area_m2 / middle_m2).ln();
            deviations.push((end, by));
            // The flow goes with the root of the difference.
            let allowed = SAME_RATIO
                + SIGMAS * (0.5 * offset_pa / (end.p2_pa - end.p1_pa)).hypot(offset_kg_s / end.flow_kg_s);
            if by.abs() > allowed {
                off.push(end.position);
                if worst.is_none_or(|(before, _): (f64, _)| before.abs() < by.abs()) {
                    worst = Some((by, end));
                }
            }
        }
    }
    if off.is_empty() {
        return creep(&deviations, ends.len());
    }
    let example = worst.map_or_else(String::new, |(by, end)| {
        format!(
            " (step {}: {:.2} g/s at {:.1} kPa, {:+.0} % off)",
            step_number(recording.steps.get(end.position).map_or(end.position, |step| step.index)),
            end.flow_kg_s * 1e3,
            end.p2_pa / 1e3,
            100.0 * by.exp_m1()
        )
    });
    let message = format!(
        "m_c and P2 - P1 do not go together at {} of {judged} points: the area of the valve that follows from them is another than at \
         the other points of the same opening{example}; m_c, P1 or P2 is frozen, scaled or creeps, or the valve is not where it was told to be",
        off.len()
    );
    // Where many are off, or more over time, nobody knows which are right.
    let steps = if 4 * off.len() > judged || creep(&deviations, ends.len()).is_some() {
        (0..ends.len()).collect()
    } else {
        off
    };
    Some(Objection::new(code::CONTRADICTED_CHANNEL, message, steps))
}

/// Area of the valve, discharge coefficient included, m2; `None` where the pressures say nothing of it.
fn area_m2(end: &Ends) -> Option<f64> {
    (end.p2_pa - end.p1_pa > LEAST_PA).then_some(())?;
    let per_m2 = orifice::flow_kg_s(1.0, end.p2_pa, end.t2_k, end.p1_pa);
    Some(end.flow_kg_s / per_m2).filter(|area_m2| area_m2.is_finite() && *area_m2 > 0.0)
}

/// What comes over the run: as a share of the flow, or as a pressure, which the slow points show most.
fn creep(deviations: &[(&Ends, f64)], steps: usize) -> Option<Objection> {
    let values: Vec<f64> = deviations.iter().map(|(_, by)| *by).collect();
    let (first_s, last_s) =
        deviations.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (end, _)| {
            (low.min(end.end_s), high.max(end.end_s))
        });
    let time = |end: &Ends| (end.end_s - first_s) / (last_s - first_s) - 0.5;
    let found = |weight: &dyn Fn(&Ends) -> f64| {
        let column =
            |of: &dyn Fn(&Ends) -> f64| deviations.iter().map(|(end, _)| of(end)).collect::<Vec<f64>>();
        let columns = [column(&|_| 1.0), column(&|end| time(end) * weight(end))];
        fit(&columns, &values)?.get(1).copied().filter(|slope| slope.value.abs() > CREEP_SIGMAS * slope.error)
    };
    let flow = found(&|_| 1.0).filter(|slope| slope.value.abs() > MOST_CREEP_RATIO);
    let pressure =
        found(&|end| -0.5 / (end.p2_pa - end.p1_pa)).filter(|slope| slope.value.abs() > MOST_CREEP_PA);
    let said = match (flow, pressure) {
        (_, Some(slope)) => format!("P2 - P1 by {:+.1} kPa, or m_c likewise", slope.value / 1e3),
        (Some(slope), None) => format!("m_c by {:+.1} %", 100.0 * slope.value),
        (None, None) => return None,
    };
    let message = format!(
        "the area of the valve that follows from m_c and P2 - P1 changes over the run at the same opening, as if a channel crept: {said}; \
         check zero and line of flow meter and pressures"
    );
    Some(Objection::new(code::SCALED_CHANNEL, message, (0..steps).collect()))
}
