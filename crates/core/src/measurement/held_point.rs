//! The measured operating point of a step, which distinguishes points if no commands were recorded.

use crate::{Channel, Recording, Series, StepMarker};

/// Channels that jump between the points of a map, with the minimum relative change between two different points. Temperatures are not among them,
/// because they take minutes to follow.
pub const JUMPS: [(Channel, f64); 4] = [
    (Channel::ShaftSpeed, 0.01),
    (Channel::CompressorFlow, 0.02),
    (Channel::P3, 0.015),
    (Channel::P2, 0.015),
];

/// Like [`JUMPS`], for the valve's opening.
pub const VALVE_JUMP_RATIO: f64 = 0.02;

/// The relative change of a channel from which two points differ; 0 of a channel that does not jump.
pub fn jump_ratio(channel: Channel) -> f64 {
    JUMPS.iter().find(|(of, _)| *of == channel).map_or(0.0, |(_, ratio)| *ratio)
}

/// Medians of the second half of a step; NaN if there are none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HeldPoint {
    speed_rpm: f64,
    flow_kg_s: f64,
    p3_pa: f64,
    valve_opening_ratio: f64,
}

impl HeldPoint {
    /// The measured point of a step; `None` if targets or a commanded P3 and valve define it.
    fn of(recording: &Recording, step: &StepMarker) -> Option<HeldPoint> {
        let commanded = recording.series.contains_key(&Channel::P3Command)
            && step.p3_pa.is_finite()
            && step.valve_opening_ratio.is_finite();
        if step.to.is_some() || commanded {
            return None;
        }
        let held = |channel: Channel| {
            recording
                .series
                .get(&channel)
                .map_or(f64::NAN, |series| median(series, 0.5 * (step.start_s + step.end_s), step.end_s))
        };
        Some(HeldPoint {
            speed_rpm: held(Channel::ShaftSpeed),
            flow_kg_s: held(Channel::CompressorFlow),
            p3_pa: held(Channel::P3),
            valve_opening_ratio: step.valve_opening_ratio,
        })
    }

    /// Whether two steps were at the same point: equal speed and P3, and equal valve opening, or equal flow if the opening is unknown, each within
    /// the size of a jump. A point without speed matches none.
    pub(crate) fn is_same(&self, other: &HeldPoint) -> bool {
        let is_close = |a: f64, b: f64, ratio: f64| (a - b).abs() <= ratio * a.abs().max(b.abs());
        let unknown_or_close = |a: f64, b: f64, ratio: f64| a.is_nan() && b.is_nan() || is_close(a, b, ratio);
        let opening = (self.valve_opening_ratio, other.valve_opening_ratio);
        let same_opening = if opening.0.is_nan() && opening.1.is_nan() {
            is_close(self.flow_kg_s, other.flow_kg_s, jump_ratio(Channel::CompressorFlow))
        } else {
            is_close(opening.0, opening.1, VALVE_JUMP_RATIO)
        };
        same_opening
            && is_close(self.speed_rpm, other.speed_rpm, jump_ratio(Channel::ShaftSpeed))
            && unknown_or_close(self.p3_pa, other.p3_pa, jump_ratio(Channel::P3))
    }
}

/// Where a step is: its target, its commands, or what was measured if neither is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepPoint {
    step: StepMarker,
    pub(crate) held: Option<HeldPoint>,
}

/// Tolerance of the commands within which steps of logs without targets are at the same point: a third of the smallest jump ([`JUMPS`]), and
/// more than loggers round.
pub const SAME_COMMAND_RATIO: f64 = 5e-3;

impl StepPoint {
    /// The point of a step.
    pub fn of(recording: &Recording, step: &StepMarker) -> StepPoint {
        StepPoint { step: *step, held: HeldPoint::of(recording, step) }
    }

    /// Whether two steps are at the same point.
    pub fn is_same(&self, other: &StepPoint) -> bool {
        let is_close = |a: f64, b: f64| (a - b).abs() <= SAME_COMMAND_RATIO * a.abs().max(b.abs());
        let (own, others) = (&self.step, &other.step);
        match (own.to, others.to, self.held, other.held) {
            (Some(own), Some(other), ..) => own == other,
            (None, None, Some(own), Some(other)) => own.is_same(&other),
            (None, None, None, None) => {
                is_close(own.p3_pa, others.p3_pa)
                    && is_close(own.valve_opening_ratio, others.valve_opening_ratio)
            }
            _ => false,
        }
    }
}

fn median(series: &Series, start_s: f64, end_s: f64) -> f64 {
    let mut values: Vec<f64> =
        series.slice(start_s, end_s).1.iter().copied().filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
