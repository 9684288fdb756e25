//! The steps of a recording: from its markers, or from changes of the commands.

use crate::ReadWarning;
use mapper_core::{Channel, Group, OperatingPoint, Series, StepKind, StepMarker};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Changes of commands no further apart than this belong to one jump, s. Pressure and valve of a jump are set one
/// after the other, and a ramp is a chain of changes.
const JUMP_GAP_S: f64 = 1.0;

/// Relative change below which a command counts as unchanged: read-back of a held command moves in its last digits.
const COMMAND_TOLERANCE_RATIO: f64 = 1e-6;

/// A message on `/step`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct StepMessage {
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

/// Steps from changes of the commanded pressure and valve: each lasts from one jump to the next. What was held before
/// the first jump is the first step, so that a hold at the first point is its beginning.
pub(crate) fn steps_from_commands(
    series: &BTreeMap<Channel, Series>,
    span_s: Option<(f64, f64)>,
    warnings: &mut Vec<ReadWarning>,
) -> Vec<StepMarker> {
    let Some((first_s, last_s)) = span_s else { return Vec::new() };
    let commands = [Channel::P3Command, Channel::ValveCommand].map(|channel| (channel, series.get(&channel)));
    if commands.iter().all(|(_, command)| command.is_none()) {
        warnings.push(ReadWarning::NoCommands);
        return Vec::new();
    }
    let missing = commands.iter().filter(|(_, command)| command.is_none());
    warnings.extend(missing.map(|(channel, _)| ReadWarning::MissingCommand { channel: *channel }));

    let mut changes_s: Vec<f64> =
        commands.iter().flat_map(|(_, command)| command.map(change_times_s).unwrap_or_default()).collect();
    changes_s.sort_by(f64::total_cmp);
    // Start of each step, and the time its commands have taken their values.
    let mut jumps_s: Vec<(f64, f64)> = vec![(first_s, first_s)];
    let mut last_change_s = f64::NEG_INFINITY;
    for change_s in changes_s {
        match jumps_s.last_mut() {
            Some((_, settled_s)) if change_s - last_change_s <= JUMP_GAP_S => *settled_s = change_s,
            _ => jumps_s.push((change_s, change_s)),
        }
        last_change_s = change_s;
    }
    let ends_s = jumps_s.iter().skip(1).map(|(start_s, _)| last_before_s(series, *start_s)).chain([last_s]);
    jumps_s
        .iter()
        .zip(ends_s)
        .enumerate()
        .map(|(index, ((start_s, settled_s), end_s))| {
            let held = |command: Option<&Series>| command.and_then(|c| held_number(c, *settled_s));
            StepMarker {
                index,
                kind: StepKind::Point,
                start_s: *start_s,
                end_s,
                from: None,
                to: None,
                p3_pa: held(commands[0].1).unwrap_or(f64::NAN),
                valve_opening_ratio: held(commands[1].1).unwrap_or(f64::NAN),
            }
        })
        .collect()
}

/// Time of the last measured sample before `change_s`, or `change_s` where nothing was measured before.
///
/// A command is seen at a sample: whether that sample was taken before or after the change, the recording does not say,
/// so it belongs to neither step's end.
fn last_before_s(series: &BTreeMap<Channel, Series>, change_s: f64) -> f64 {
    let measured = series.iter().filter(|(channel, _)| channel.info().group != Group::Command);
    let before_s = |series: &Series| {
        let before = series.t_s.partition_point(|t_s| *t_s < change_s);
        before.checked_sub(1).map(|index| series.t_s[index])
    };
    measured.filter_map(|(_, series)| before_s(series)).reduce(f64::max).unwrap_or(change_s)
}

/// Times at which a command takes a new value.
fn change_times_s(command: &Series) -> Vec<f64> {
    let mut current: Option<f64> = None;
    let mut changes_s = Vec::new();
    for (t_s, value) in command.t_s.iter().zip(&command.values).filter(|(_, value)| value.is_finite()) {
        let changed = current
            .is_some_and(|held| (value - held).abs() > COMMAND_TOLERANCE_RATIO * value.abs().max(held.abs()));
        if changed {
            changes_s.push(*t_s);
        }
        if changed || current.is_none() {
            current = Some(*value);
        }
    }
    changes_s
}

/// The latest number at or before a time, or the first one there is.
fn held_number(command: &Series, t_s: f64) -> Option<f64> {
    let after = command.t_s.partition_point(|t| *t <= t_s);
    let finite = |value: &&f64| value.is_finite();
    command.values[..after].iter().rfind(finite).or_else(|| command.values.iter().find(finite)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let steps = steps_from_commands(&commands(&rows), Some((0.0, 50.0)), &mut warnings);
        let found: Vec<_> =
            steps.iter().map(|s| (s.start_s, s.end_s, s.p3_pa, s.valve_opening_ratio)).collect();
        assert_eq!(found, [(0.0, 20.0, 1.5e5, 0.5), (20.0, 40.0, 2.0e5, 0.7), (40.0, 50.0, 1.5e5, 0.7)]);
        assert!(warnings.is_empty());
    }

    #[test]
    fn without_commands_there_are_no_steps_and_a_warning() {
        let mut warnings = Vec::new();
        assert!(steps_from_commands(&BTreeMap::new(), Some((0.0, 1.0)), &mut warnings).is_empty());
        assert_eq!(warnings, [ReadWarning::NoCommands]);
    }
}
