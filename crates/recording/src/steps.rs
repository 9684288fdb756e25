//! The steps of a recording: from its markers, or from changes of the commands and of the readings.

use crate::ReadWarning;
use crate::error::StepsFound;
use crate::jump_steps::{Jump, can_be_searched, drop_rest_steps, find_jumps, is_at_rest_before};
use mapper_core::{
    Channel, Group, OperatingPoint, SLOW_JUMP_MULTIPLE, Series, StepKind, StepMarker, is_same_command,
    jump_ratio,
};
use mapper_numerics::statistics::median;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Share of [`MAX_JUMP_GAP_S`] in which a fast jump already changes in proportion. Bound: the fastest rate of a controller lasts longer.
const FAST_START_SHARE: f64 = 0.25;

/// Maximum time between changes of commands that belong to one jump, s. Pressure and valve change one after the other, and a ramp is a
/// chain of changes. Bound: pressure and valve change one after the other, and a ramp is a chain of changes.
const MAX_JUMP_GAP_S: f64 = 1.0;

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct StepMessage {
    #[serde(flatten, with = "mapper_core::test_plan::step_number::entry")]
    index: usize,
    kind: StepKind,
    phase: Phase,
    pub(crate) t_s: f64,
    p3_pa: Option<f64>,
    valve: Option<f64>,
    from: Option<OperatingPoint>,
    to: Option<OperatingPoint>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Phase {
    Start,
    End,
    Abandoned,
}

/// Steps from their markers. A step without an end ends where the next one starts, or with the last sample.
pub(crate) fn steps_from_markers(
    messages: impl Iterator<Item = StepMessage>,
    last_sample_s: f64,
    warnings: &mut Vec<ReadWarning>,
) -> Vec<StepMarker> {
    let mut steps: Vec<StepMarker> = Vec::new();
    let mut open = false;
    for message in messages {
        match message.phase {
            Phase::Start => {
                if let Some(unfinished) = steps.last_mut().filter(|_| open) {
                    unfinished.end_s = message.t_s;
                }
                open = true;
                steps.push(StepMarker {
                    index: message.index,
                    kind: message.kind,
                    start_s: message.t_s,
                    end_s: f64::NAN,
                    from: message.from,
                    to: message.to,
                    p3_pa: message.p3_pa.unwrap_or(f64::NAN),
                    valve_opening_ratio: message.valve.unwrap_or(f64::NAN),
                });
            }
            Phase::Abandoned => {
                if open && steps.last().is_some_and(|step| step.index == message.index) {
                    steps.pop();
                    open = false;
                }
            }
            Phase::End => {
                let of_open = |step: &&mut StepMarker| open && step.index == message.index;
                if let Some(step) = steps.last_mut().filter(of_open) {
                    step.end_s = message.t_s;
                    open = false;
                }
            }
        }
    }
    if let Some(unfinished) = steps.last_mut().filter(|_| open) {
        unfinished.end_s = last_sample_s.max(unfinished.start_s);
        let (index, end_s) = (unfinished.index, unfinished.end_s);
        warnings.push(ReadWarning::UnfinishedStep { index, end_s });
    }
    steps
}

/// Time between a jump of the commands and one of the readings that are the same jump, s. Bound: a drive moves within some seconds, and means
/// over three seconds, two apart, show it.
const SAME_JUMP_S: f64 = 5.0;

/// Minimum number of channels in which a jump shows that no recorded command has. Bound: a single reading may be at fault.
const FEWEST_SHOWING: usize = 2;

/// Steps from jumps of the `commands` that mark steps and of the readings: each lasts from one jump to the next. The time before the first jump
/// is the first step, so that a hold at the first point is its beginning. A jump of both begins with that of the commands.
pub(crate) fn find_steps(
    series: &BTreeMap<Channel, Series>,
    commands: &[Channel],
    measured_valve: bool,
    warnings: &mut Vec<ReadWarning>,
) -> Vec<StepMarker> {
    let Some((first_s, last_s)) = span_s(series) else { return Vec::new() };
    let is_searched = can_be_searched(series);
    if commands.is_empty() && !is_searched {
        warnings.push(ReadWarning::NoCommands);
        return Vec::new();
    }
    let command = |channel: Channel| series.get(&channel).filter(|_| commands.contains(&channel));
    let (p3, valve) = (command(Channel::P3Command), command(Channel::ValveCommand));
    let commanded = command_jumps(p3, valve);
    let (measured, channels) =
        if is_searched { find_jumps(series, measured_valve) } else { Default::default() };
    let is_same = |jump: &Jump, (start_s, settled_s): &(f64, f64)| {
        (start_s - SAME_JUMP_S..=settled_s + SAME_JUMP_S).contains(&jump.start_s)
    };
    let enough = if commands.is_empty() { 1 } else { FEWEST_SHOWING };
    let only_measured = |jump: &&Jump| {
        jump.channels.len() >= enough && !commanded.iter().any(|commanded| is_same(jump, commanded))
    };
    let (of_starts, of_readings): (Vec<f64>, Vec<f64>) = measured
        .iter()
        .filter(only_measured)
        .map(|jump| jump.start_s)
        .partition(|start_s| is_at_rest_before(series, *start_s));
    // Start of each step, and the time at which its commands have reached their values.
    let mut jumps_s: Vec<(f64, f64)> = commanded.clone();
    // With both commands recorded, a jump of the readings alone is reported but begins no step. The start from standstill does: its commands
    // may have been given long before.
    let is_complete = p3.is_some() && valve.is_some();
    let further = of_starts.iter().chain(of_readings.iter().filter(|_| !is_complete));
    jumps_s.extend(further.map(|start_s| (*start_s, *start_s)));
    jumps_s.push((first_s, first_s));
    jumps_s.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends_s = jumps_s.iter().skip(1).map(|(start_s, _)| last_before_s(series, *start_s)).chain([last_s]);
    let step = |(index, (&(start_s, settled_s), end_s)): (usize, (&(f64, f64), f64))| {
        // Without a command: what the rig reached.
        let value = |command: Option<&Series>, channel: Channel| match command {
            Some(command) => held_number(command, settled_s),
            None => {
                let later_half = series.get(&channel)?.slice(0.5 * (start_s + end_s), end_s).1;
                median(later_half.iter().filter(|value| value.is_finite()))
            }
        };
        StepMarker {
            index,
            kind: StepKind::Point,
            start_s,
            end_s: end_s.max(start_s),
            from: None,
            to: None,
            p3_pa: value(p3, Channel::P3).unwrap_or(f64::NAN),
            valve_opening_ratio: value(valve, Channel::ValveCommand).unwrap_or(f64::NAN),
        }
    };
    let steps: Vec<StepMarker> = jumps_s.iter().zip(ends_s).enumerate().map(step).collect();
    let unanswered =
        |commanded: &&(f64, f64)| is_searched && !measured.iter().any(|jump| is_same(jump, commanded));
    let unanswered: Vec<f64> = commanded.iter().filter(unanswered).map(|(start_s, _)| *start_s).collect();
    if !is_complete || !of_readings.is_empty() || !unanswered.is_empty() {
        let of_commands = [(Channel::P3Command, p3), (Channel::ValveCommand, valve)];
        let shown_by_commands = of_commands.into_iter().filter_map(|(channel, command)| {
            let command = command?;
            let shown = if channel == Channel::P3Command {
                command_jumps(Some(command), None)
            } else {
                command_jumps(None, Some(command))
            };
            Some((channel, shown.len()))
        });
        let shown_by_readings = channels.into_iter().map(|channel| {
            (channel, measured.iter().filter(|jump| jump.channels.contains(&channel)).count())
        });
        warnings.push(ReadWarning::StepsFound(Box::new(StepsFound {
            count: drop_rest_steps(steps.clone(), series).len(),
            shown: shown_by_commands.chain(shown_by_readings).collect(),
            only_readings_s: if is_complete { of_readings } else { Vec::new() },
            only_commands_s: unanswered,
        })));
    }
    steps
}

pub(crate) fn span_s(series: &BTreeMap<Channel, Series>) -> Option<(f64, f64)> {
    let first = series.values().filter_map(|s| s.t_s.first().copied()).reduce(f64::min)?;
    let last = series.values().filter_map(|s| s.t_s.last().copied()).reduce(f64::max)?;
    Some((first, last))
}

/// Steps that are mostly a gap in the readings: the log paused, or its clock was set at rest.
pub(crate) fn hollow_steps(
    steps: &[StepMarker],
    series: &BTreeMap<Channel, Series>,
) -> impl Iterator<Item = ReadWarning> {
    steps.iter().filter_map(|step| {
        let (times, _) = series.get(&Channel::T2)?.slice(step.start_s, step.end_s);
        let gaps = times.windows(2).map(|pair| (pair[1] - pair[0], pair[0]));
        let (gap_s, from_s) = gaps.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let duration_s = step.end_s - step.start_s;
        (gap_s > MAX_JUMP_GAP_S.max(0.5 * duration_s)).then_some(ReadWarning::HollowStep {
            index: step.index,
            gap_s,
            from_s,
            duration_s,
        })
    })
}

fn command_jumps(p3: Option<&Series>, valve: Option<&Series>) -> Vec<(f64, f64)> {
    let p3_changes = p3.map(find_changes).unwrap_or_default();
    let valve_changes = valve.map(find_changes).unwrap_or_default();
    let mut times_s: Vec<f64> = p3_changes.iter().chain(&valve_changes).map(|change| change.t_s).collect();
    times_s.sort_by(f64::total_cmp);
    let chains = times_s.chunk_by(|before_s, t_s| t_s - before_s <= MAX_JUMP_GAP_S);
    chains.filter_map(|chain| jump_of_chain(chain, &p3_changes, &valve_changes)).collect()
}

/// The jump in a chain of changes, which may begin with changes by a controller.
fn jump_of_chain(chain: &[f64], p3_changes: &[Change], valve_changes: &[Change]) -> Option<(f64, f64)> {
    let (first_s, last_s) = (*chain.first()?, *chain.last()?);
    let within = |changes: &[Change], from_s: f64, to_s: f64| -> Vec<Change> {
        let from = changes.partition_point(|change| change.t_s < from_s);
        let to = changes.partition_point(|change| change.t_s <= to_s);
        changes.get(from..to).unwrap_or_default().to_vec()
    };
    let moved_ratio = |from_s: f64, to_s: f64| match within(p3_changes, from_s, to_s).as_slice() {
        [first, .., last] => (last.after / first.before - 1.0).abs(),
        [only] => (only.after / only.before - 1.0).abs(),
        [] => 0.0,
    };
    // Without this limit, a controller's trim before a jump would become its start.
    let fast_over = |from_s: f64, share: f64| {
        moved_ratio(from_s, from_s + share * MAX_JUMP_GAP_S) > share * jump_ratio(Channel::P3Command)
    };
    let fast = chain.iter().copied().find(|t_s| {
        !within(valve_changes, *t_s, *t_s).is_empty()
            || fast_over(*t_s, FAST_START_SHARE) && fast_over(*t_s, 1.0)
    });
    let slow_ratio = SLOW_JUMP_MULTIPLE * jump_ratio(Channel::P3Command);
    let slow = (moved_ratio(first_s, last_s) > slow_ratio).then_some(first_s);
    Some((fast.or(slow)?, last_s))
}

/// Time of the last measured sample before `change_s`, or `change_s` if there is none.
///
/// A command appears at a sample. The recording does not show whether the sample is from before or after the change, so it counts for
/// neither step.
fn last_before_s(series: &BTreeMap<Channel, Series>, change_s: f64) -> f64 {
    let measured = series.iter().filter(|(channel, _)| channel.info().group != Group::Command);
    let before_s = |series: &Series| {
        let before = series.t_s.partition_point(|t_s| *t_s < change_s);
        before.checked_sub(1).map(|index| series.t_s[index])
    };
    measured.filter_map(|(_, series)| before_s(series)).reduce(f64::max).unwrap_or(change_s)
}

#[derive(Debug, Clone, Copy)]
struct Change {
    t_s: f64,
    before: f64,
    after: f64,
}

fn find_changes(command: &Series) -> Vec<Change> {
    let mut current: Option<f64> = None;
    let mut changes = Vec::new();
    for (t_s, value) in command.t_s.iter().zip(&command.values).filter(|(_, value)| value.is_finite()) {
        let before = current.filter(|before| !is_same_command(*value, *before));
        changes.extend(before.map(|before| Change { t_s: *t_s, before, after: *value }));
        if before.is_some() || current.is_none() {
            current = Some(*value);
        }
    }
    changes
}

/// The latest number at or before a time, or else the first one.
fn held_number(command: &Series, t_s: f64) -> Option<f64> {
    let after = command.t_s.partition_point(|t| *t <= t_s);
    let finite = |value: &&f64| value.is_finite();
    command.values[..after].iter().rfind(finite).or_else(|| command.values.iter().find(finite)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMANDS: [Channel; 2] = [Channel::P3Command, Channel::ValveCommand];

    fn commands(rows: &[(f64, f64, f64)]) -> BTreeMap<Channel, Series> {
        let t_s: Vec<f64> = rows.iter().map(|row| row.0).collect();
        let column = |pick: fn(&(f64, f64, f64)) -> f64| Series {
            t_s: t_s.clone(),
            values: rows.iter().map(pick).collect(),
        };
        BTreeMap::from([
            (Channel::P3Command, column(|row| row.1)),
            (Channel::ValveCommand, column(|row| row.2)),
        ])
    }

    #[test]
    fn a_step_that_is_mostly_a_gap_is_reported() {
        let step = |start_s: f64, end_s: f64| StepMarker {
            index: 4,
            kind: StepKind::Point,
            from: None,
            to: None,
            start_s,
            end_s,
            p3_pa: 2e5,
            valve_opening_ratio: 1.0,
        };
        let t_s: Vec<f64> =
            (0..600).map(|row| f64::from(row) + if row < 300 { 0.0 } else { 500.0 }).collect();
        let series = BTreeMap::from([(Channel::T2, Series { values: t_s.clone(), t_s })]);
        let found = |step| hollow_steps(&[step], &series).collect::<Vec<_>>();
        assert!(found(step(0.0, 299.0)).is_empty() && found(step(0.0, 1099.0)).is_empty());
        let hollow = ReadWarning::HollowStep { index: 4, gap_s: 501.0, from_s: 299.0, duration_s: 600.0 };
        assert_eq!(found(step(250.0, 850.0)), [hollow]);
    }

    /// Version 1 of the format has `index` from 0, version 2 `step` from 1.
    #[test]
    fn marks_of_both_versions_are_the_same_steps() {
        let message = |name: &str, number: usize, phase: &str, t_s: f64| -> StepMessage {
            let text = format!(
                r#"{{"{name}":{number},"kind":"point","phase":"{phase}","t_s":{t_s},"p3_pa":1e5,"valve":0.5}}"#
            );
            serde_json::from_str(&text).unwrap()
        };
        let steps = |name: &str, first: usize| {
            let marks = (0..3).flat_map(|place| {
                let start_s = 10.0 * place as f64;
                [("start", start_s), ("end", start_s + 9.0)]
                    .map(|(phase, t_s)| message(name, first + place, phase, t_s))
            });
            steps_from_markers(marks, 29.0, &mut Vec::new())
        };
        let (old, new) = (steps("index", 0), steps("step", 1));
        assert_eq!(
            old.iter().map(|step| (step.index, step.end_s)).collect::<Vec<_>>(),
            [(0, 9.0), (1, 19.0), (2, 29.0)]
        );
        let places = |steps: &[StepMarker]| {
            steps.iter().map(|step| (step.index, step.start_s, step.end_s)).collect::<Vec<_>>()
        };
        assert_eq!(places(&old), places(&new));
    }

    #[test]
    fn a_jump_of_pressure_and_valve_a_moment_apart_is_one_step() {
        let rows = [
            (0.0, 1.5e5, 0.5),
            (10.0, 1.5e5, 0.5),
            (20.0, 2.0e5, 0.5),
            (20.8, 2.0e5, 0.7),
            (25.0, f64::NAN, 0.7),
            (30.0, 2.0e5 * (1.0 + 1e-9), 0.7),
            (40.0, 1.5e5, 0.7),
            (50.0, 1.5e5, 0.7),
        ];
        let mut warnings = Vec::new();
        let steps = find_steps(&commands(&rows), &COMMANDS, false, &mut warnings);
        let found: Vec<_> =
            steps.iter().map(|s| (s.start_s, s.end_s, s.p3_pa, s.valve_opening_ratio)).collect();
        assert_eq!(found, [(0.0, 20.0, 1.5e5, 0.5), (20.0, 40.0, 2.0e5, 0.7), (40.0, 50.0, 1.5e5, 0.7)]);
        assert!(warnings.is_empty());
    }

    /// The speed controller trims P3 each second, up to the next jump, which follows within a second.
    #[test]
    fn a_loop_that_trims_the_pressure_makes_no_steps() {
        let trims = (3..40).map(|second| (f64::from(second), 1.5e5 * (1.0 + 2e-4 * f64::from(second)), 0.5));
        let mut rows = vec![(0.0, 1.5e5, 0.5)];
        rows.extend(trims);
        rows.extend([(39.9, 2.0e5, 0.7), (45.0, 2.001e5, 0.7), (60.0, 2.001e5, 0.7)]);
        let steps = find_steps(&commands(&rows), &COMMANDS, false, &mut Vec::new());
        let starts_s: Vec<_> = steps.iter().map(|step| step.start_s).collect();
        assert_eq!(starts_s, [0.0, 39.9]);
    }

    #[test]
    fn a_slow_ramp_is_one_jump() {
        let ramp = (0..=60).map(|i| (20.0 + 0.5 * f64::from(i), 1.5e5 + 500.0 * f64::from(i), 0.5));
        let mut rows = vec![(0.0, 1.5e5, 0.5)];
        rows.extend(ramp);
        rows.push((90.0, 1.8e5, 0.5));
        let steps = find_steps(&commands(&rows), &COMMANDS, false, &mut Vec::new());
        let found: Vec<_> = steps.iter().map(|step| (step.start_s, step.p3_pa)).collect();
        // The value at 20 s is the previous one.
        assert_eq!(found, [(0.0, 1.5e5), (20.5, 1.8e5)]);
    }

    #[test]
    fn without_commands_there_are_no_steps_and_a_warning() {
        let mut warnings = Vec::new();
        let t1 = BTreeMap::from([(Channel::T1, Series { t_s: vec![0.0, 1.0], values: vec![298.0; 2] })]);
        assert!(find_steps(&t1, &[], false, &mut warnings).is_empty());
        assert_eq!(warnings, [ReadWarning::NoCommands]);
    }
}
