//! Repairs the times of recordings whose clock was set during the run.
//!
//! With step markers, no two readings of a channel share a time and no step is lost. Without them, every reading continues across the gap as if
//! no time had passed. While a logger pauses the machine continues, so changing readings differ after the gap. If they continue from their last
//! value at the same slope, the clock was set. A constant reading is no evidence.

use crate::ReadWarning;
use crate::channel_mapping::channel_map::MappedQuantity;
use crate::samples::log_clock::{MAX_BACK_INTERVALS, MAX_BACK_S};
use crate::samples::rig_sink::PositionedMessage;
use crate::samples::series_builder::{ClockBreak, SeriesBuilder};
use crate::steps::StepMessage;
use mapper_core::Event;
use mapper_core::unit_factors::NS_PER_S;
use mapper_numerics::statistics::median;
use std::collections::BTreeMap;

/// Maximum number of messages between the breaks of several channels that one step of the clock caused. Bound: the fastest topic sends as
/// many while the slowest sends one.
const MAX_MESSAGES_APART: u64 = 1000;

/// Clocks of channels and markers may differ by this much, ns. Bound: threads write in turn.
const TOLERANCE_NS: u64 = 2_000_000_000;

/// Interval of a channel that has only one sample before the break, ns. Source: the rate of this program's recordings.
const USUAL_INTERVAL_NS: u64 = 100_000_000;

type Builders = BTreeMap<MappedQuantity, SeriesBuilder>;

/// Repairs times after a clock was set back: every channel goes back at the same place of the file by the same amount. Late topics, and files with
/// one topic after the other, have no such place.
pub(crate) fn repair_set_back(
    builders: &mut Builders,
    steps: &mut [PositionedMessage<StepMessage>],
    events: &mut [PositionedMessage<Event>],
    warnings: &mut Vec<ReadWarning>,
) {
    let Some(reference) = builders.values().max_by_key(|builder| builder.len()) else { return };
    for found in reference.breaks().to_vec() {
        let same = |other: &&ClockBreak| {
            other.position.abs_diff(found.position) <= MAX_MESSAGES_APART
                && other.back_ns.abs_diff(found.back_ns) <= TOLERANCE_NS
        };
        let on_both_sides = |builder: &&SeriesBuilder| {
            let (first, last) = builder.positions();
            first < found.position && found.position < last
        };
        let breaks: Vec<Option<ClockBreak>> = builders
            .values()
            .filter(on_both_sides)
            .map(|builder| {
                builder.breaks().iter().find(same).filter(|found| builder.continues_from(found)).copied()
            })
            .collect();
        let Some(breaks) =
            breaks.into_iter().collect::<Option<Vec<ClockBreak>>>().filter(|all| !all.is_empty())
        else {
            continue;
        };
        let back_ns = breaks.iter().map(|one| one.back_ns).max().unwrap_or(0);
        let shift_ns = back_ns + found.interval_ns.unwrap_or(USUAL_INTERVAL_NS);
        let from = breaks.iter().map(|one| one.position).min().unwrap_or(found.position);
        for builder in builders.values_mut() {
            builder.move_later(from, shift_ns);
        }
        move_messages(steps, from, shift_ns);
        move_messages(events, from, shift_ns);
        warnings.push(ReadWarning::ClockSet { by_s: -(shift_ns as f64) / NS_PER_S });
    }
}

fn move_messages<T>(messages: &mut [PositionedMessage<T>], from: u64, shift_ns: u64) {
    for message in messages.iter_mut().filter(|message| message.position >= from) {
        message.log_time_ns = message.log_time_ns.saturating_add(shift_ns);
    }
}

/// Repairs times after a clock was set forward, in recordings whose step markers have the time of the run as well. If all times are off
/// against the markers, moves the start of the run.
pub(crate) fn repair_set_forward(
    builders: &mut Builders,
    steps: &mut [PositionedMessage<StepMessage>],
    start_time_ns: &mut u64,
    warnings: &mut Vec<ReadWarning>,
) {
    let first_ns = builders.values().filter_map(SeriesBuilder::first_time_ns).min();
    let (Some(first_ns), Some(first)) = (first_ns, steps.first()) else { return };
    let ahead_ns = |step: &PositionedMessage<StepMessage>, start_time_ns: u64| {
        let run_ns = (step.message.t_s * NS_PER_S) as i128;
        i64::try_from(i128::from(step.log_time_ns) - i128::from(start_time_ns) - run_ns).unwrap_or(0)
    };
    let by_ns = ahead_ns(first, *start_time_ns);
    let was_set =
        u64::try_from(by_ns).is_ok_and(|by_ns| has_gap(builders, (first_ns, first.log_time_ns), by_ns));
    if by_ns.unsigned_abs() > TOLERANCE_NS && !was_set {
        *start_time_ns = start_time_ns.saturating_add_signed(by_ns);
        warnings.push(ReadWarning::ClockSet { by_s: by_ns as f64 / NS_PER_S });
    }
    let mut from_ns = first_ns;
    for at in 0..steps.len() {
        let Some(step) = steps.get(at) else { continue };
        let (by_ns, to_ns) = (u64::try_from(ahead_ns(step, *start_time_ns)).unwrap_or(0), step.log_time_ns);
        if by_ns > TOLERANCE_NS {
            for builder in builders.values_mut() {
                // A channel that begins later has no gap.
                if !builder.close_gap(from_ns, to_ns, by_ns, TOLERANCE_NS) {
                    builder.move_earlier(to_ns, by_ns);
                }
            }
            for step in steps.iter_mut().skip(at) {
                step.log_time_ns = step.log_time_ns.saturating_sub(by_ns);
            }
            warnings.push(ReadWarning::ClockSet { by_s: by_ns as f64 / NS_PER_S });
        }
        from_ns = steps.get(at).map_or(from_ns, |step| step.log_time_ns);
    }
}

/// Whether the channel with the most samples has gaps of this size between two times.
fn has_gap(builders: &Builders, (from_ns, to_ns): (u64, u64), by_ns: u64) -> bool {
    let reference = builders.values().max_by_key(|builder| builder.len());
    reference.is_some_and(|builder| builder.clone().close_gap(from_ns, to_ns, by_ns, TOLERANCE_NS))
}

/// Samples on each side of a gap that determine level and slope. Bound: more would average over changes.
const SIDE_SAMPLES: usize = 20;
/// Their minimum number. Bound: the error of their standard deviation is a quarter.
const MIN_SIDE_SAMPLES: usize = 8;

/// Maximum number of gaps that are checked. Bound: a clock is set once or twice.
const MAX_GAPS: usize = 100;

/// Standard errors within which two levels, or two slopes, are equal. Bound: by chance never exceeded.
const EQUAL_SIGMAS: f64 = 5.0;

/// Minimum slope in standard errors for a reading that is evidence. Bound: noise never reaches it.
const MIN_SLOPE_SIGMAS: f64 = 8.0;
/// Minimum change over a pause in tolerances for a reading that is evidence. Bound: equal levels on both sides then exclude a pause.
const MIN_MOVE_RATIO: f64 = 10.0;

/// Rounding of readings, relative to their level. Bound: stored numbers have more digits.
const ROUNDING_RATIO: f64 = 1e-9;

/// A straight line through the samples next to a gap.
#[derive(Debug, Clone, Copy)]
struct LineFit {
    /// Level at the edge of the gap, and its standard error.
    level: f64,
    level_sigma: f64,
    slope_per_s: f64,
    slope_sigma_per_s: f64,
}

impl LineFit {
    /// Through times, s from the edge, and values; `None` without a spread of times.
    fn through(samples: &[(f64, f64)]) -> Option<LineFit> {
        let count = samples.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / count;
        let (mean_s, mean_value) = (mean(|sample| sample.0), mean(|sample| sample.1));
        let spread: f64 = samples.iter().map(|(t_s, _)| (t_s - mean_s).powi(2)).sum();
        if samples.len() < MIN_SIDE_SAMPLES || spread <= 0.0 {
            return None;
        }
        let cross_sum: f64 = samples.iter().map(|(t_s, value)| (t_s - mean_s) * (value - mean_value)).sum();
        let slope_per_s = cross_sum / spread;
        let level = mean_value - slope_per_s * mean_s;
        let residual = |(t_s, value): &(f64, f64)| (value - level - slope_per_s * t_s).powi(2);
        let sigma = (samples.iter().map(residual).sum::<f64>() / (count - 2.0)).sqrt();
        let rounding = ROUNDING_RATIO * mean_value.abs();
        Some(LineFit {
            level,
            level_sigma: sigma * (1.0 / count + mean_s * mean_s / spread).sqrt() + rounding,
            slope_per_s,
            slope_sigma_per_s: (sigma + rounding) / spread.sqrt(),
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GapEvidence {
    /// The reading changed: time passed.
    Paused,
    /// The reading was changing, and continued as if no time had passed.
    Set,
    /// The reading was constant.
    Nothing,
}

fn gap_evidence(
    builder: &SeriesBuilder,
    (from_ns, to_ns): (u64, u64),
    interval_s: f64,
) -> Option<GapEvidence> {
    let (before, after) = builder.sides(from_ns, to_ns, SIDE_SAMPLES)?;
    let (before, after) = (LineFit::through(&before)?, LineFit::through(&after)?);
    let jump = after.level - (before.level + before.slope_per_s * interval_s);
    let tolerance = EQUAL_SIGMAS * before.level_sigma.hypot(after.level_sigma);
    let slope_sigma = before.slope_sigma_per_s.hypot(after.slope_sigma_per_s);
    let gap_s = to_ns.saturating_sub(from_ns) as f64 / NS_PER_S;
    if jump.abs() > tolerance {
        return Some(GapEvidence::Paused);
    }
    let is_moving = before.slope_per_s.abs() > MIN_SLOPE_SIGMAS * slope_sigma
        && before.slope_per_s.abs() * gap_s > MIN_MOVE_RATIO * tolerance;
    let is_same_slope = (after.slope_per_s - before.slope_per_s).abs()
        <= EQUAL_SIGMAS * slope_sigma + 0.5 * before.slope_per_s.abs();
    Some(if is_moving && is_same_slope { GapEvidence::Set } else { GapEvidence::Nothing })
}

/// Closes the gaps of a clock that was set forward, in all channels.
pub(crate) fn repair_gaps<'a>(
    builders: &mut BTreeMap<MappedQuantity, SeriesBuilder>,
    others: impl IntoIterator<Item = &'a mut SeriesBuilder>,
    warnings: &mut Vec<ReadWarning>,
) {
    let mut others: Vec<&mut SeriesBuilder> = others.into_iter().collect();
    for _ in 0..MAX_GAPS {
        let Some((gap, by_ns)) = find_clock_step(builders) else { return };
        for builder in builders.values_mut().chain(others.iter_mut().map(|builder| &mut **builder)) {
            builder.close_gap(gap.0, gap.1, by_ns, (MAX_BACK_S * NS_PER_S) as u64);
        }
        warnings.push(ReadWarning::ClockSet { by_s: by_ns as f64 / NS_PER_S });
    }
}

/// The first gap that is due to a clock that was set, and its excess over the usual interval, ns.
fn find_clock_step(builders: &BTreeMap<MappedQuantity, SeriesBuilder>) -> Option<((u64, u64), u64)> {
    // Late messages cause gaps as well.
    if !builders.values().all(SeriesBuilder::is_in_order) {
        return None;
    }
    let reference = builders.values().max_by_key(|builder| builder.len())?;
    let intervals_s = reference.intervals_s();
    let interval_s = median(&intervals_s)?;
    let limit_s = MAX_BACK_S.max(MAX_BACK_INTERVALS * interval_s);
    reference.gaps(limit_s).take(MAX_GAPS).find_map(|gap| {
        let all: Vec<GapEvidence> =
            builders.values().filter_map(|builder| gap_evidence(builder, gap, interval_s)).collect();
        let set = all.contains(&GapEvidence::Set) && !all.contains(&GapEvidence::Paused);
        set.then(|| (gap, (gap.1 - gap.0).saturating_sub((interval_s * NS_PER_S).round() as u64)))
    })
}
