//! Detects the ends of the speed lines of a map: surge and choke.

use mapper_core::{CompressorMap, EndEvidence, LineEnd, MapPoint, SpeedLine, Warning};
use serde::Serialize;

/// Efficiency below which a compressor counts as choked (Garrett, Turbo Tech 103). Source: Garrett, Turbo Tech 103.
const MAX_CHOKE_ETA: f64 = 0.58;
/// Maximum relative rise of flow over the relative loss of pressure rise on the vertical part of a line. It is above 1 at the zero-slope
/// point and approaches 0 in choke. Bound: it is above 1 at the zero-slope point and approaches 0 in choke.
const MAX_VERTICAL_SLOPE_RATIO: f64 = 0.1;
/// Minimum loss of pressure rise, ratio. Bound: large compared with the scatter of repeated points, 0.2 %.
const MIN_PRESSURE_LOSS_RATIO: f64 = 0.05;
/// Maximum relative difference in flow of a repeated point. Bound: twice the usual uncertainty of a flow meter, 0.5 %.
const REPEAT_RATIO: f64 = 0.01;

/// An end of a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DetectedEnd {
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio.
    pub pressure_ratio: f64,
    /// Evidence.
    pub by: EndEvidence,
}

/// Both ends of a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineEnds {
    /// Corrected speed of the line, rpm.
    pub speed_corrected_rpm: f64,
    /// Side of the smallest flow.
    pub surge: DetectedEnd,
    /// Side of the largest flow.
    pub choke: DetectedEnd,
}

/// Detects the ends of every line, and marks their points. `named` returns the end that the table states for a step.
pub fn mark_line_ends(map: &mut CompressorMap, named: impl Fn(usize) -> Option<LineEnd>) -> Vec<LineEnds> {
    let mut ends = Vec::new();
    for line in &mut map.lines {
        let place =
            |end: LineEnd| line.points.iter().position(|point| named(point.identified.step) == Some(end));
        let last = line.points.len().saturating_sub(1);
        let (surge_at, surge_by) = match place(LineEnd::Surge) {
            Some(at) => (at, EndEvidence::Named),
            None => (0, surge_evidence(line)),
        };
        let (choke_at, choke_by) = match place(LineEnd::Choke) {
            Some(at) => (at, EndEvidence::Named),
            None => choke_evidence(line).unwrap_or((last, EndEvidence::NotReached)),
        };
        let end = |at: usize, by: EndEvidence| {
            let point = line.points.get(at)?;
            let (flow_corrected_kg_s, pressure_ratio) = (point.flow_corrected_kg_s, point.pressure_ratio);
            Some(DetectedEnd { flow_corrected_kg_s, pressure_ratio, by })
        };
        let Some((surge, choke)) = end(surge_at, surge_by).zip(end(choke_at, choke_by)) else { continue };
        ends.push(LineEnds { speed_corrected_rpm: line.speed_corrected_rpm, surge, choke });
        mark(line.points.get_mut(surge_at), surge_by, |evidence| Warning::SurgeEnd { evidence });
        mark(line.points.get_mut(choke_at), choke_by, |evidence| Warning::ChokeEnd { evidence });
    }
    ends
}

fn surge_evidence(line: &SpeedLine) -> EndEvidence {
    let Some(first) = line.points.first() else { return EndEvidence::NotReached };
    let is_next =
        |point: &&MapPoint| point.flow_corrected_kg_s > (1.0 + REPEAT_RATIO) * first.flow_corrected_kg_s;
    match line.points.iter().find(is_next) {
        Some(next) if first.pressure_ratio <= next.pressure_ratio => EndEvidence::ZeroSlope,
        _ => EndEvidence::NotReached,
    }
}

/// The first point in choke, towards larger flow.
fn choke_evidence(line: &SpeedLine) -> Option<(usize, EndEvidence)> {
    let best = line.points.iter().filter_map(|point| point.eta).fold(0.0, f64::max);
    let top = line.points.iter().map(|point| point.pressure_ratio).fold(1.0, f64::max);
    let peak = line.points.iter().position(|point| point.eta == Some(best)).unwrap_or(0);
    let evidence = |(at, point): (usize, &MapPoint)| {
        // Heat keeps the apparent efficiency of slow lines below the limit everywhere: only the slope indicates choke there.
        if at > peak && best >= MAX_CHOKE_ETA && point.eta.is_some_and(|eta| eta < MAX_CHOKE_ETA) {
            return Some((at, EndEvidence::Efficiency));
        }
        let loss_ratio = |other: &MapPoint| (other.pressure_ratio - point.pressure_ratio) / (top - 1.0);
        let above =
            line.points.get(..at)?.iter().rev().find(|other| loss_ratio(other) >= MIN_PRESSURE_LOSS_RATIO)?;
        let flow_rise_ratio = point.flow_corrected_kg_s / above.flow_corrected_kg_s - 1.0;
        (flow_rise_ratio < MAX_VERTICAL_SLOPE_RATIO * loss_ratio(above))
            .then_some((at, EndEvidence::Vertical))
    };
    line.points.iter().enumerate().find_map(evidence)
}

fn mark(point: Option<&mut MapPoint>, evidence: EndEvidence, warning: fn(EndEvidence) -> Warning) {
    if let Some(point) = point.filter(|_| evidence != EndEvidence::NotReached) {
        point.identified.warnings.push(warning(evidence));
    }
}
