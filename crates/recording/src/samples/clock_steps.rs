//! Repairs the times of recordings whose clock was set during the run, so that no two readings of a channel share a time and no step is
//! lost.

use crate::ReadWarning;
use crate::channel_mapping::mapped_topics::MappedQuantity;
use crate::samples::rig_sink::PositionedMessage;
use crate::samples::series_builder::{ClockBreak, SeriesBuilder};
use crate::step_detection::steps::StepMessage;
use mapper_core::Event;
use mapper_core::unit_factors::NS_PER_S;
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
