//! What a jump is: how far commands and readings change between two points of a map, and whether two steps are at the same point.

use crate::{Channel, Recording, Series, StepMarker};

/// Channels that jump between the points of a map, with the minimum relative change between two different points. Temperatures are not among
/// them, because they take minutes to follow.
///
/// | | ratio | why |
/// |---|---|---|
/// | shaft speed | 1 % | a fifth of the distance of speed lines |
/// | flow, P3, P2 | 2 %, 1.5 % | held less precisely than the speed |
/// | commanded P3 | 1 % | a command has no noise, and a speed loop moves it by less in a second |
/// | valve opening | 2 % | a positioner resolves some tenths of a per cent |
///
/// Bound: between what a controller holds and the distance of two points of a map.
pub const JUMPS: [(Channel, f64); 6] = [
    (Channel::ShaftSpeed, 0.01),
    (Channel::CompressorFlow, 0.02),
    (Channel::P3, 0.015),
    (Channel::P2, 0.015),
    (Channel::P3Command, 0.01),
    (Channel::ValveCommand, 0.02),
];

/// Multiple of the jump of a commanded P3 that a chain of slow changes must exceed to be a jump of a slow rig. Bound: the trims of a speed loop
/// add up to more than one jump while the housings warm up.
pub const SLOW_JUMP_MULTIPLE: f64 = 2.0;

/// Relative change of a command within which a speed loop trims it at one point. Bound: half of the smallest jump of a command ([`JUMPS`]), and more
/// than loggers round.
pub const SAME_COMMAND_RATIO: f64 = 5e-3;

/// Relative change below which a command counts as unchanged. Bound: the read-back of a constant command varies in the last digits of a
/// single-precision number.
const READ_BACK_RATIO: f64 = 1e-6;

/// The relative change of a channel from which two points differ; 0 of a channel that does not jump.
pub fn jump_ratio(channel: Channel) -> f64 {
    JUMPS.iter().find(|(of, _)| *of == channel).map_or(0.0, |(_, ratio)| *ratio)
}

/// Whether a channel jumps between two values. Values that are not numbers do not jump.
pub fn is_jump(channel: Channel, before: f64, after: f64) -> bool {
    (after - before).abs() > jump_ratio(channel) * before.abs().min(after.abs())
}

/// Whether P3 or the valve jumps between two pairs of commands, each of P3, Pa, and opening.
pub fn is_commanded_jump(before: (f64, f64), after: (f64, f64)) -> bool {
    is_jump(Channel::P3Command, before.0, after.0) || is_jump(Channel::ValveCommand, before.1, after.1)
}

/// Whether two values of a command are the same but for the digits of its read-back.
pub fn is_same_command(value: f64, other: f64) -> bool {
    (value - other).abs() <= READ_BACK_RATIO * value.abs().max(other.abs())
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
        let is_same =
            |channel: Channel, a: f64, b: f64| a.is_finite() && b.is_finite() && !is_jump(channel, a, b);
        let both_unknown = |a: f64, b: f64| a.is_nan() && b.is_nan();
        let opening = (self.valve_opening_ratio, other.valve_opening_ratio);
        let same_opening = if both_unknown(opening.0, opening.1) {
            is_same(Channel::CompressorFlow, self.flow_kg_s, other.flow_kg_s)
        } else {
            is_same(Channel::ValveCommand, opening.0, opening.1)
        };
        same_opening
            && is_same(Channel::ShaftSpeed, self.speed_rpm, other.speed_rpm)
            && (both_unknown(self.p3_pa, other.p3_pa) || is_same(Channel::P3, self.p3_pa, other.p3_pa))
    }
}

/// Where a step is: its target, its commands, or what was measured if neither is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepPoint {
    step: StepMarker,
    pub(crate) held: Option<HeldPoint>,
}

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
