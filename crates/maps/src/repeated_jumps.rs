//! Changes of efficiency between repeats of one jump, as evidence of drift.

use mapper_core::{IdentifiedPoint, OperatingPoint, StepKind, StepMarker};
use serde::Serialize;

/// A jump that the run made more than once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedJump {
    /// Start of the jump.
    pub from: OperatingPoint,
    /// Target of the jump.
    pub to: OperatingPoint,
    /// Indices of the steps, from 0; files have their numbers, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub steps: Vec<usize>,
    /// Efficiency of each step, fraction.
    pub eta: Vec<f64>,
    /// Last minus first efficiency, fraction.
    pub eta_change: f64,
    /// Standard error of this change from noise, fraction; fixed offsets cancel. `None` if an interval is missing.
    pub eta_change_standard_error: Option<f64>,
}

/// Finds the repeated jumps, with the efficiency each time; a point that the same jump reached counts too.
pub fn repeated_jumps(markers: &[StepMarker], points: &[IdentifiedPoint]) -> Vec<RepeatedJump> {
    let mut jumps: Vec<(OperatingPoint, OperatingPoint)> = Vec::new();
    for marker in markers.iter().filter(|marker| marker.kind == StepKind::Repeat) {
        if let Some(jump) = marker.from.zip(marker.to).filter(|jump| !jumps.contains(jump)) {
            jumps.push(jump);
        }
    }
    jumps
        .into_iter()
        .filter_map(|(from, to)| {
            let steps = markers.iter().filter(|marker| (marker.from, marker.to) == (Some(from), Some(to)));
            let found: Vec<(&IdentifiedPoint, f64)> = steps
                .filter_map(|marker| {
                    let point = points.iter().find(|point| point.step == marker.index)?;
                    Some((point, point.eta?))
                })
                .collect();
            let ((first, first_eta), (last, last_eta)) = (found.first()?, found.last()?);
            let noise = |point: &IdentifiedPoint| Some(point.eta_uncertainty?.noise_standard_error);
            (found.len() > 1).then(|| RepeatedJump {
                from,
                to,
                steps: found.iter().map(|(point, _)| point.step).collect(),
                eta: found.iter().map(|(_, eta)| *eta).collect(),
                eta_change: last_eta - first_eta,
                eta_change_standard_error: noise(first)
                    .zip(noise(last))
                    .map(|(first, last)| first.hypot(last)),
            })
        })
        .collect()
}
