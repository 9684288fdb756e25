//! The surge marks of a recording: one for each line with a surge search.

use crate::surge::estimate::SurgeEstimate;
use crate::surge::variation::SurgeReading;
use mapper_core::{
    Channel, DeclaredUncertainty, EventKind, Recording, ReferenceState, StepKind, StepMarker, SurgeFoundBy,
    SurgeMark, SurgeNotFound,
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
pub fn find_surge_marks(recording: &Recording, reference: ReferenceState, errors: SurgeErrors) -> SurgeMarks {
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
            Ok(mark) => found.marks.push(mark),
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
    })
}

/// Pressure ratio extrapolated linearly in flow from the last readings, with its standard error.
fn pressure_ratio_at(readings: &[SurgeReading], last: &SurgeReading, flow_kg_s: f64) -> (f64, f64) {
    const LAST_READINGS: usize = 5;
    let last_readings = &readings[readings.len().saturating_sub(LAST_READINGS)..];
    let point = |reading: &SurgeReading| {
        let factor = last.speed_corrected_rpm / reading.speed_corrected_rpm;
        let (flow, ratio) = mapper_physics::compressor_map::characteristic::at_speed(
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
