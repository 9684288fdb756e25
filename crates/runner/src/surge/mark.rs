//! The surge marks of a recording, one for each line with a surge search; and surge events with hysteresis: a compressor in surge crosses the
//! surge line many times a second, and each surge is one event.

use crate::surge::estimate::{SurgeEstimate, SurgeReading, soft_surge};
use mapper_core::{
    Channel, DeclaredUncertainty, Event, EventKind, Recording, ReferenceState, SampleBatch, StepKind,
    StepMarker, SurgeFoundBy, SurgeMark, SurgeNotFound,
};
use std::collections::BTreeMap;

/// Declared sensor errors that enter a mark.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurgeErrors {
    /// Gain of the flow meter, one standard deviation, ratio.
    pub flow_gain_ratio: f64,
    /// Offset of P1, one standard deviation, Pa.
    pub p1_offset_pa: f64,
    /// Offset of P2, one standard deviation, Pa.
    pub p2_offset_pa: f64,
}

impl SurgeErrors {
    /// The declared errors of flow meter and pressures.
    pub fn of(declared: &BTreeMap<Channel, DeclaredUncertainty>) -> Self {
        let declared_for = |channel: Channel| declared.get(&channel).copied();
        SurgeErrors {
            flow_gain_ratio: declared_for(Channel::CompressorFlow).map_or(0.0, |flow| flow.gain_sigma_ratio),
            p1_offset_pa: declared_for(Channel::P1).map_or(0.0, |p1| p1.offset_sigma),
            p2_offset_pa: declared_for(Channel::P2).map_or(0.0, |p2| p2.offset_sigma),
        }
    }
}

/// Results of the approaches in a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurgeMarks {
    /// Marks in order of speed.
    pub marks: Vec<SurgeMark>,
    /// Lines on which surge was not found.
    pub remarks: Vec<SurgeNotFound>,
    /// Number of surge events during the approaches.
    pub surges: usize,
}

/// The marks of all approaches to surge in a recording.
///
/// `soft_growth_ratio` is [`SurgeSearchSettings::soft_growth_ratio`](mapper_core::SurgeSearchSettings::soft_growth_ratio).
pub fn find_surge_marks(
    recording: &Recording,
    reference: ReferenceState,
    errors: SurgeErrors,
    soft_growth_ratio: f64,
) -> SurgeMarks {
    let mut found = SurgeMarks::default();
    for approach in group_approaches(&recording.steps) {
        let entered = |step: &&StepMarker| {
            recording.events.iter().any(|event| {
                event.kind == EventKind::SurgeEntered && (step.start_s..step.end_s).contains(&event.t_s)
            })
        };
        let surged = approach.iter().find(entered);
        found.surges += usize::from(surged.is_some());
        let readings: Vec<SurgeReading> = approach
            .iter()
            // The first step brings the machine to the end of the line.
            .skip(1)
            .take_while(|step| surged.is_none_or(|surged| step.start_s < surged.start_s))
            .filter_map(|step| SurgeReading::of(recording, step, reference))
            .collect();
        let target_speed_rpm = approach.first().and_then(|step| step.to).map_or(0.0, |to| to.speed_rpm);
        match mark_approach(&readings, target_speed_rpm, surged.map(|step| step.valve_opening_ratio), errors)
        {
            Ok(mark) => {
                found.marks.push(SurgeMark { soft: soft_surge(&readings, soft_growth_ratio), ..mark });
            }
            Err(not_found) => found.remarks.push(not_found),
        }
    }
    found.marks.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    found
}

/// Steps of each approach: one speed, and a valve that never opens.
fn group_approaches(steps: &[StepMarker]) -> Vec<Vec<StepMarker>> {
    let mut approaches: Vec<Vec<StepMarker>> = Vec::new();
    let mut returned = false;
    for step in steps.iter().filter(|step| step.kind == StepKind::Approach) {
        let before = approaches.last().and_then(|approach| approach.last());
        let goes_on =
            before.is_some_and(|before| before.to.map(|to| to.speed_rpm) == step.to.map(|to| to.speed_rpm));
        let opens = before.is_some_and(|before| step.valve_opening_ratio > before.valve_opening_ratio);
        if !goes_on {
            approaches.push(vec![*step]);
            returned = false;
        } else if opens || returned {
            // The return from the end of the line.
            returned = true;
        } else if let Some(approach) = approaches.last_mut() {
            approach.push(*step);
        }
    }
    approaches
}

/// The mark of one approach; `surged_at_ratio` is the opening at which the compressor went into surge.
fn mark_approach(
    readings: &[SurgeReading],
    target_speed_rpm: f64,
    surged_at_ratio: Option<f64>,
    errors: SurgeErrors,
) -> Result<SurgeMark, SurgeNotFound> {
    let not_found = |enough: bool| SurgeNotFound { target_speed_rpm, openings: readings.len(), enough };
    let last = readings.last().ok_or(not_found(false))?;
    let (flow_kg_s, standard_error_kg_s, closest_kg_s) = match surged_at_ratio {
        Some(surged_at_ratio) => {
            let high = last.flow_corrected_kg_s;
            let low = high * surged_at_ratio / last.valve_opening_ratio;
            // Equal probability anywhere between the two.
            (0.5 * (low + high), (high - low) / 12.0f64.sqrt(), high)
        }
        None => {
            let estimate = SurgeEstimate::of(readings).ok_or(not_found(false))?;
            if !estimate.is_usable {
                return Err(not_found(true));
            }
            (estimate.flow_corrected_kg_s, estimate.standard_error_kg_s, estimate.closest_flow_kg_s)
        }
    };
    let (pressure_ratio, own_error) = pressure_ratio_at(readings, last, flow_kg_s);
    let offsets_pa = errors.p2_offset_pa.hypot(pressure_ratio * errors.p1_offset_pa);
    Ok(SurgeMark {
        target_speed_rpm,
        speed_corrected_rpm: last.speed_corrected_rpm,
        flow_corrected_kg_s: flow_kg_s,
        flow_standard_error_kg_s: standard_error_kg_s,
        flow_common_standard_error_kg_s: errors.flow_gain_ratio * flow_kg_s,
        pressure_ratio,
        pressure_ratio_standard_error: own_error.hypot(offsets_pa / last.p1_pa),
        closest_flow_corrected_kg_s: closest_kg_s,
        closest_end_s: last.end_s,
        found_by: if surged_at_ratio.is_some() { SurgeFoundBy::Surge } else { SurgeFoundBy::Precursor },
        steps: readings.len(),
        soft: None,
    })
}

/// Pressure ratio extrapolated linearly in flow from the last readings, with its standard error.
fn pressure_ratio_at(readings: &[SurgeReading], last: &SurgeReading, flow_kg_s: f64) -> (f64, f64) {
    const LAST_READINGS: usize = 5;
    let last_readings = &readings[readings.len().saturating_sub(LAST_READINGS)..];
    let point = |reading: &SurgeReading| {
        let factor = last.speed_corrected_rpm / reading.speed_corrected_rpm;
        let (flow, ratio) = mapper_physics::compressor_map::closed_form_map::at_speed(
            reading.flow_corrected_kg_s,
            reading.pressure_ratio,
            factor,
        );
        (flow, ratio)
    };
    let points: Vec<(f64, f64)> = last_readings.iter().map(point).collect();
    let count = points.len() as f64;
    let (flow, ratio) =
        points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
    let (mut along, mut slope) = (0.0, 0.0);
    for (x, y) in &points {
        along += (x - flow).powi(2);
        slope += (x - flow) * (y - ratio);
    }
    let slope = if along > 0.0 { (slope / along).min(0.0) } else { 0.0 };
    // The line flattens towards surge: the value lies between the last reading and the straight line.
    let highest = ratio + slope * (flow_kg_s - flow);
    let seen = last.pressure_ratio;
    (0.5 * (highest + seen), (highest - seen).abs() / 12.0f64.sqrt())
}

/// Time without surge after which it has ended, s. Judgement: longer than the cycle of the slowest surge, 1 s.
const QUIET_S: f64 = 2.0;

/// Joins the crossings that a rig reports to one event at the start of each surge and one at its end.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurgeEvents {
    surge: Option<Surge>,
}

#[derive(Debug, Clone, Copy)]
struct Surge {
    since_s: f64,
    /// Time of the last crossing back; `None` while the compressor surges.
    left_s: Option<f64>,
    lowest_flow_kg_s: f64,
}

impl SurgeEvents {
    /// Replaces the crossings in the events of a batch, whose samples end at `now_s`.
    pub(crate) fn join(&mut self, batch: &mut SampleBatch, now_s: f64) {
        let events = std::mem::take(&mut batch.events);
        for event in events {
            match event.kind {
                EventKind::SurgeEntered => {
                    batch.events.extend(self.end_before(event.t_s));
                    match &mut self.surge {
                        Some(surge) => surge.left_s = None,
                        None => {
                            self.surge = Some(Surge {
                                since_s: event.t_s,
                                left_s: None,
                                lowest_flow_kg_s: f64::INFINITY,
                            });
                            batch.events.push(event);
                        }
                    }
                }
                EventKind::SurgeLeft => match &mut self.surge {
                    Some(surge) => surge.left_s = Some(event.t_s),
                    None => batch.events.push(event),
                },
                _ => batch.events.push(event),
            }
        }
        if let Some(surge) = &mut self.surge {
            let flows = batch.column(Channel::CompressorFlow).unwrap_or_default();
            let rows = batch.t_s.iter().zip(flows);
            let during = rows.filter(|(t_s, flow)| **t_s >= surge.since_s && flow.is_finite());
            surge.lowest_flow_kg_s = during.map(|(_, flow)| *flow).fold(surge.lowest_flow_kg_s, f64::min);
        }
        batch.events.extend(self.end_before(now_s));
    }

    /// The event of a surge that has ended by `now_s`.
    fn end_before(&mut self, now_s: f64) -> Option<Event> {
        let Surge { since_s, left_s, lowest_flow_kg_s } = self.surge?;
        let left_s = left_s.filter(|left_s| now_s - left_s >= QUIET_S)?;
        self.surge = None;
        let flow = match lowest_flow_kg_s.is_finite() {
            true => format!(", lowest flow {:.2} g/s", 1e3 * lowest_flow_kg_s),
            false => String::new(),
        };
        let message = format!(
            "surge ended: it lasted {:.2} s from {since_s:.2} s to {left_s:.2} s{flow}",
            left_s - since_s
        );
        Some(Event { t_s: now_s, kind: EventKind::SurgeLeft, message })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    /// Seven crossings a second for three seconds, and another surge later.
    #[test]
    fn each_surge_is_one_event_with_its_duration_and_lowest_flow() {
        let mut events = SurgeEvents::default();
        let mut found: Vec<Event> = Vec::new();
        let is_surge = |t_s: f64| (3.0..6.0).contains(&t_s) || (12.0..12.55).contains(&t_s);
        for second in 0..20 {
            let from_s = f64::from(second);
            let t_s: Vec<f64> = (0..10).map(|i| from_s + 0.1 * f64::from(i)).collect();
            let values = t_s.iter().map(|t_s| if is_surge(*t_s) { 0.03 } else { 0.05 }).collect();
            let columns = vec![ChannelColumn { channel: Channel::CompressorFlow, values }];
            let crossing = |i: u32| {
                let kind = if i.is_multiple_of(2) { EventKind::SurgeEntered } else { EventKind::SurgeLeft };
                Event { t_s: from_s + f64::from(i) / 14.0, kind, message: String::new() }
            };
            let crossings = (0..14).map(crossing).filter(|event| is_surge(event.t_s)).collect();
            let mut batch = SampleBatch { t_s, columns, events: crossings, ..SampleBatch::default() };
            events.join(&mut batch, from_s + 1.0);
            found.extend(batch.events);
        }
        let kinds: Vec<EventKind> = found.iter().map(|event| event.kind).collect();
        use EventKind::{SurgeEntered, SurgeLeft};
        assert_eq!(kinds, [SurgeEntered, SurgeLeft, SurgeEntered, SurgeLeft]);
        assert!(found[1].message.contains("30.00 g/s") && found[1].message.contains("2.93 s"), "{found:?}");
        assert!(found.windows(2).all(|pair| pair[0].t_s <= pair[1].t_s));
    }
}
