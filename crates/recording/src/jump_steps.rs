//! Finds jumps of speed, flow and pressures, and of a valve position that is mapped as the command: the steps of a recording without markers.

use mapper_core::{Channel, Group, JUMPS, Series, StepMarker, jump_ratio};
use mapper_numerics::statistics::{self, nearest_rank};
use std::collections::BTreeMap;

/// Share of the largest level below which a signal counts as at rest. Bound: idle is above it.
const MIN_LEVEL_SHARE: f64 = 0.1;

/// Median absolute value of a standard normal distribution. Source: its quantile at 0.75.
const MEDIAN_OF_SIZE: f64 = 0.6745;

/// Minimum size of a jump's start in noise of a mean. Bound: by chance once in 16,000 means.
const START_SIGMAS: f64 = 4.0;

/// Time over which means are compared before and after, s. Bound: noise of a mean over it is below any jump; slower changes are no jumps.
const WINDOW_S: f64 = 3.0;

/// Time between the two windows, s. Bound: long compared with a jump, short compared with a drift.
const SEPARATION_S: f64 = 2.0;

/// Shortest interval of the search grid for jumps, s. Bound: twice the usual sample interval.
const GRID_S: f64 = 0.2;

/// Maximum number of points of that grid. Bound: a day at its shortest interval.
const MAX_GRID_POINTS: f64 = 5e5;

/// Multiple of the noise of a mean over the grid's interval that a jump must exceed. Bound: by chance never exceeded.
const NOISE_MULTIPLE: f64 = 6.0;

/// Share of a jump that marks its start. Bound: a sample of the start, far above noise.
const START_SHARE: f64 = 0.1;

/// Share of the smallest jump per window below which a signal counts as settled again. Bound: what is left of a jump after a window is
/// smaller.
const CALM_SHARE: f64 = 0.3;

/// A speed controller goes on correcting for this long after a jump, s, by less than [`SETTLING_SHARE`] of it. Bound: integral times of
/// stands are some seconds.
const SETTLING_S: f64 = 15.0;

/// See [`SETTLING_S`]. Bound: overshoot of a damped controller.
const SETTLING_SHARE: f64 = 0.2;

/// Shaft speed below which the machine is at rest, rpm. Bound: far below any idle, far above any sensor's noise.
const MAX_REST_RPM: f64 = 1000.0;

fn measured_jumps() -> impl Iterator<Item = (Channel, f64)> {
    JUMPS.into_iter().filter(|(channel, _)| channel.info().group != Group::Command)
}

/// Whether there is a signal that may jump.
pub(crate) fn can_be_searched(series: &BTreeMap<Channel, Series>) -> bool {
    measured_jumps().any(|(channel, _)| series.get(&channel).is_some_and(|series| series.t_s.len() > 30))
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Jump {
    pub(crate) start_s: f64,
    pub(crate) channels: Vec<Channel>,
}

/// The jumps of the measured channels, in order, and the channels that were searched. A measured valve is evaluated too.
pub(crate) fn find_jumps(
    series: &BTreeMap<Channel, Series>,
    measured_valve: bool,
) -> (Vec<Jump>, Vec<Channel>) {
    let valve = measured_valve.then_some((Channel::ValveCommand, jump_ratio(Channel::ValveCommand)));
    let wanted: Vec<(Channel, f64)> = measured_jumps().chain(valve).collect();
    let grid = Grid::of(series, &wanted);
    (grid.jumps(), grid.signals.iter().map(|signal| signal.channel).collect())
}

/// Removes the steps in which the shaft is at rest: a soak before the first point, the end of a run. Renumbers the others.
pub(crate) fn drop_rest_steps(steps: Vec<StepMarker>, series: &BTreeMap<Channel, Series>) -> Vec<StepMarker> {
    let Some(speed) = series.get(&Channel::ShaftSpeed) else { return steps };
    let is_at_rest = |step: &StepMarker| median(speed, step.start_s, step.end_s) < MAX_REST_RPM;
    if steps.iter().all(is_at_rest) {
        // A dead sensor, or a file without a run: neither shows when the machine is at rest.
        return steps;
    }
    let turning = steps.into_iter().filter(|step| !is_at_rest(step));
    turning.enumerate().map(|(index, step)| StepMarker { index, ..step }).collect()
}

/// Whether the shaft is at rest over a window before a time.
pub(crate) fn is_at_rest_before(series: &BTreeMap<Channel, Series>, t_s: f64) -> bool {
    let speed = series.get(&Channel::ShaftSpeed);
    speed.is_some_and(|speed| median(speed, t_s - WINDOW_S, t_s) < MAX_REST_RPM)
}

/// NaN without readings.
fn median(series: &Series, start_s: f64, end_s: f64) -> f64 {
    let values = series.slice(start_s, end_s).1.iter().filter(|value| value.is_finite());
    statistics::median(values).unwrap_or(f64::NAN)
}

/// Means of the signals over equal intervals, without the empty ones: a jump in a gap appears after the gap.
struct Grid {
    interval_s: f64,
    t_s: Vec<f64>,
    signals: Vec<Signal>,
}

struct Signal {
    channel: Channel,
    values: Vec<f64>,
    sums: Vec<f64>,
    sigma: f64,
    min_jump_ratio: f64,
    /// Level below which a relative change has no meaning.
    floor: f64,
}

impl Grid {
    fn of(series: &BTreeMap<Channel, Series>, wanted: &[(Channel, f64)]) -> Grid {
        let found: Vec<(Channel, f64, &Series)> = wanted
            .iter()
            .filter_map(|(channel, ratio)| {
                Some((*channel, *ratio, series.get(channel).filter(|s| s.t_s.len() > 30)?))
            })
            .collect();
        let typical_s = |series: &Series| {
            let intervals_s = series.t_s.windows(2).take(4096).map(|pair| pair[1] - pair[0]);
            nearest_rank(intervals_s, 0.5).unwrap_or(GRID_S)
        };
        let first_s = found.iter().filter_map(|(.., s)| s.t_s.first().copied()).fold(f64::INFINITY, f64::min);
        let last_s =
            found.iter().filter_map(|(.., s)| s.t_s.last().copied()).fold(f64::NEG_INFINITY, f64::max);
        let slowest_s = found.iter().map(|(.., s)| typical_s(s)).fold(GRID_S, f64::max);
        let interval_s = slowest_s.max((last_s - first_s) / MAX_GRID_POINTS);
        let mut bins: BTreeMap<i64, Vec<(f64, f64)>> = BTreeMap::new();
        for (index, (.., series)) in found.iter().enumerate() {
            for (t_s, value) in series.t_s.iter().zip(&series.values).filter(|(_, value)| value.is_finite()) {
                let bin = bins
                    .entry(((t_s - first_s) / interval_s) as i64)
                    .or_insert_with(|| vec![(0.0, 0.0); found.len()]);
                if let Some(bin) = bin.get_mut(index) {
                    bin.0 += value;
                    bin.1 += 1.0;
                }
            }
        }
        let t_s: Vec<f64> = bins.keys().map(|bin| first_s + *bin as f64 * interval_s).collect();
        let signals = found.iter().enumerate().map(|(index, (channel, ratio, _))| {
            let mut mean = f64::NAN;
            let mut values: Vec<f64> = Vec::with_capacity(bins.len());
            for bin in bins.values() {
                let (sum, count) = bin.get(index).copied().unwrap_or_default();
                mean = if count > 0.0 { sum / count } else { mean };
                values.push(mean);
            }
            // Before its first reading a signal has its first value.
            let first = values.iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
            values.iter_mut().take_while(|value| !value.is_finite()).for_each(|value| *value = first);
            Signal::of(*channel, *ratio, values)
        });
        let signals = signals.collect();
        Grid { interval_s, t_s, signals }
    }

    fn point_count(&self, time_s: f64) -> usize {
        ((time_s / self.interval_s).round() as usize).max(2)
    }

    fn jumps(&self) -> Vec<Jump> {
        let (window, apart) = (self.point_count(WINDOW_S), self.point_count(SEPARATION_S));
        let mut jumps = Vec::new();
        let mut last: Option<(usize, Vec<f64>)> = None;
        let mut at = window;
        while at + apart + window <= self.t_s.len() {
            let jumped = |signal: &Signal| {
                let (before, after) =
                    (signal.mean(at - window, at), signal.mean(at + apart, at + apart + window));
                (after - before).abs() > signal.min_jump(before, after)
            };
            let moved: Vec<&Signal> = self.signals.iter().filter(|signal| jumped(signal)).collect();
            if moved.is_empty() {
                at += 1;
                continue;
            }
            let end = (at + apart + window).min(self.t_s.len() - 1);
            let begun = |place: &usize| {
                moved.iter().any(|signal| signal.has_begun(*place, at - window, at, at + apart, window))
            };
            let start = (at..end).find(begun).unwrap_or(at);
            let size = |signal: &Signal| {
                signal.mean(start + apart, start + apart + window) - signal.mean(at - window, at)
            };
            let sizes: Vec<f64> = self.signals.iter().map(size).collect();
            let settles = last.as_ref().is_some_and(|(last, whole): &(usize, Vec<f64>)| {
                let sizes =
                    self.signals.iter().zip(&sizes).zip(whole).filter(|((signal, _), _)| jumped(signal));
                start - last < self.point_count(SETTLING_S)
                    && sizes.into_iter().all(|((_, size), whole)| size.abs() < SETTLING_SHARE * whole.abs())
            });
            if !settles {
                let shows = |(signal, size): &(&Signal, &f64)| {
                    let before = signal.mean(at - window, at);
                    jumped(signal) || size.abs() > signal.min_jump(before, before + **size)
                };
                let showing = self.signals.iter().zip(&sizes).filter(shows);
                let channels = showing.map(|(signal, _)| signal.channel).collect();
                jumps.extend(self.t_s.get(start).map(|start_s| Jump { start_s: *start_s, channels }));
                last = Some((start, sizes));
            }
            at = start + window;
            // The end of a slow jump is not another jump.
            while at + window <= self.t_s.len()
                && !self.signals.iter().all(|signal| signal.is_calm(at - window, at, window))
            {
                at += 1;
            }
        }
        jumps
    }
}

impl Signal {
    fn of(channel: Channel, min_jump_ratio: f64, values: Vec<f64>) -> Signal {
        let sums = std::iter::once(0.0)
            .chain(values.iter().scan(0.0, |sum, value| {
                *sum += value;
                Some(*sum)
            }))
            .collect();
        let top = values.iter().map(|value| value.abs()).fold(0.0, f64::max);
        let floor = MIN_LEVEL_SHARE * top;
        // Only while the signal moves, and without steps of 0: for a reading that is constant between its jumps,
        // only the jumps would remain.
        let running = values.windows(2).filter(|pair| pair[0].abs() > floor && pair[1].abs() > floor);
        let mut steps: Vec<f64> = running.map(|pair| (pair[1] - pair[0]).abs()).collect();
        steps.sort_unstable_by(f64::total_cmp);
        // A difference has twice the variance.
        let sigma =
            steps.get(steps.len() / 2).copied().unwrap_or(0.0) / MEDIAN_OF_SIZE / std::f64::consts::SQRT_2;
        Signal { channel, values, sums, sigma, min_jump_ratio, floor }
    }

    fn mean(&self, from: usize, to: usize) -> f64 {
        let sum = |at: usize| self.sums.get(at.min(self.values.len())).copied().unwrap_or(0.0);
        (sum(to) - sum(from)) / to.saturating_sub(from).max(1) as f64
    }

    /// The smallest difference of two means that is a jump.
    fn min_jump(&self, before: f64, after: f64) -> f64 {
        (self.min_jump_ratio * before.abs().max(after.abs()).max(self.floor)).max(NOISE_MULTIPLE * self.sigma)
    }

    /// Whether the jump between two means has begun at a grid point, and continues at the next one.
    fn has_begun(&self, place: usize, from: usize, to: usize, after_from: usize, window: usize) -> bool {
        let (before, after) = (self.mean(from, to), self.mean(after_from, after_from + window));
        let jump = after - before;
        let enough = (START_SHARE * jump.abs()).max(START_SIGMAS * self.sigma).min(0.5 * jump.abs());
        let off = |place: usize| {
            self.values.get(place).is_some_and(|value| (value - before) * jump.signum() > enough)
        };
        off(place) && (off(place + 1) || place + 1 >= self.values.len())
    }

    fn is_calm(&self, from: usize, at: usize, window: usize) -> bool {
        let (before, after) = (self.mean(from, at), self.mean(at, at + window));
        let calm = CALM_SHARE * self.min_jump_ratio * before.abs().max(after.abs()).max(self.floor);
        (after - before).abs() <= calm.max(NOISE_MULTIPLE * self.sigma)
    }
}

/// Minimum share of samples in which a measured position reverses. Bound: commands with points of a minute reverse a tenth as often.
const MIN_REVERSAL_SHARE: f64 = 0.05;

/// Their minimum number. Bound: a campaign of commands has fewer in such a share of its samples.
const MIN_REVERSALS: usize = 20;

/// Share of the largest opening. Bound: if half of the moves are smaller, they are the resolution of a sensor.
const SMALL_MOVE_SHARE: f64 = 5e-3;

/// Share of samples in which a command reverses, if the reversals are so frequent or so small that it is a measured position.
pub(crate) fn reversal_share(command: &Series) -> Option<f64> {
    let values: Vec<f64> = command.values.iter().copied().filter(|value| value.is_finite()).collect();
    let moves: Vec<f64> =
        values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step != 0.0).collect();
    let turns = moves.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    if turns < MIN_REVERSALS {
        return None;
    }
    let share = turns as f64 / values.len() as f64;
    let top = values.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let sizes: Vec<f64> = moves.iter().map(|step| step.abs()).collect();
    let small = statistics::median(&sizes).is_some_and(|size| size < SMALL_MOVE_SHARE * top);
    (share > MIN_REVERSAL_SHARE || small).then_some(share)
}

/// The command reconstructed from the position: for each step, the opening at its end.
pub(crate) fn hold_at_step_ends(position: &mut Series, steps: &[StepMarker]) {
    let mut openings = Vec::with_capacity(position.values.len());
    for t_s in &position.t_s {
        let at = steps.partition_point(|step| step.start_s <= *t_s).max(1) - 1;
        openings.push(steps.get(at).map_or(f64::NAN, |step| step.valve_opening_ratio));
    }
    position.values = openings;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadWarning;
    use crate::steps::find_steps;

    /// A shaft that follows jumps of its drive with a lag of two seconds, at 10 Hz, with noise of a fixed pattern.
    fn run(jumps: &[(f64, f64)], end_s: f64) -> BTreeMap<Channel, Series> {
        let (mut speed, mut t_s, mut values) = (jumps[0].1, Vec::new(), Vec::new());
        for row in 0..(10.0 * end_s) as usize {
            let t = row as f64 / 10.0;
            let wanted = jumps.iter().rfind(|(at, _)| *at <= t).map_or(0.0, |(_, rpm)| *rpm);
            speed += (wanted - speed) * 0.1 / 2.0;
            t_s.push(t);
            values.push(speed + 30.0 * (row as f64 * 12.9898).sin());
        }
        BTreeMap::from([(Channel::ShaftSpeed, Series { t_s, values })])
    }

    fn starts(series: &BTreeMap<Channel, Series>) -> Vec<f64> {
        let steps = drop_rest_steps(find_steps(series, &[], false, &mut Vec::new()), series);
        assert!(
            steps.iter().enumerate().all(|(index, step)| step.index == index && step.end_s > step.start_s)
        );
        steps.iter().map(|step| step.start_s).collect()
    }

    #[test]
    fn jumps_are_found_within_a_second_and_drifts_are_none() {
        let jumps = [(0.0, 90e3), (60.0, 120e3), (90.0, 118e3), (150.0, 60e3), (180.0, 150e3)];
        let found = starts(&run(&jumps, 240.0));
        assert_eq!(found.len(), jumps.len(), "{found:?}");
        assert!(found.iter().zip(&jumps).all(|(found, (jump, _))| (found - jump).abs() <= 1.0), "{found:?}");
        let drift: Vec<(f64, f64)> = (0..240).map(|s| (f64::from(s), 90e3 + 20.0 * f64::from(s))).collect();
        assert_eq!(starts(&run(&drift, 240.0)), [0.0]);
    }

    /// The drive jumps at 60, 120 and 180 s, the recorded valve at 60 s alone.
    #[test]
    fn jumps_without_a_recorded_command_are_steps() {
        let mut series = run(&[(0.0, 90e3), (60.0, 120e3), (120.0, 70e3), (180.0, 140e3)], 240.0);
        let speed = series[&Channel::ShaftSpeed].clone();
        let flow = speed.values.iter().map(|rpm| 1e-6 * rpm).collect();
        series.insert(Channel::CompressorFlow, Series { values: flow, ..speed.clone() });
        let valve = speed.t_s.iter().map(|t_s| if *t_s < 60.0 { 0.5 } else { 0.7 }).collect();
        series.insert(Channel::ValveCommand, Series { values: valve, ..speed });
        let mut warnings = Vec::new();
        let steps = find_steps(&series, &[Channel::ValveCommand], false, &mut warnings);
        let starts_s: Vec<f64> = steps.iter().map(|step| step.start_s.round()).collect();
        assert_eq!(starts_s[..2], [0.0, 60.0]);
        assert!((starts_s[2] - 120.0).abs() <= 1.0 && (starts_s[3] - 180.0).abs() <= 1.0, "{starts_s:?}");
        let [ReadWarning::StepsFound(found)] = warnings.as_slice() else { panic!("{warnings:?}") };
        assert_eq!(
            found.shown,
            [(Channel::ValveCommand, 1), (Channel::ShaftSpeed, 3), (Channel::CompressorFlow, 3)]
        );
    }

    /// Both commands have their first values long before the start at 100 s; the second point begins at 160 s.
    #[test]
    fn the_start_from_standstill_is_a_step_although_its_commands_were_given_before() {
        let mut series = run(&[(0.0, 0.0), (100.0, 90e3), (160.0, 120e3)], 220.0);
        let speed = series[&Channel::ShaftSpeed].clone();
        let flow = speed.values.iter().map(|rpm| 1e-6 * rpm).collect();
        series.insert(Channel::CompressorFlow, Series { values: flow, ..speed.clone() });
        let p3 = speed.t_s.iter().map(|t_s| if *t_s < 160.0 { 150e3 } else { 200e3 }).collect();
        series.insert(Channel::P3Command, Series { values: p3, ..speed.clone() });
        let valve = vec![0.5; speed.t_s.len()];
        series.insert(Channel::ValveCommand, Series { values: valve, ..speed });
        let commands = [Channel::P3Command, Channel::ValveCommand];
        let mut warnings = Vec::new();
        let steps = drop_rest_steps(find_steps(&series, &commands, false, &mut warnings), &series);
        let starts_s: Vec<f64> = steps.iter().map(|step| step.start_s.round()).collect();
        assert!(starts_s.len() == 2 && (starts_s[0] - 100.0).abs() <= 1.0, "{starts_s:?}");
        assert_eq!(starts_s[1], 160.0);
        assert_eq!(warnings, [], "commands and readings agree");
    }

    #[test]
    fn corrections_of_a_speed_controller_after_a_jump_are_not_jumps() {
        let found = starts(&run(&[(0.0, 125e3), (60.0, 78e3), (66.0, 80e3), (120.0, 83e3)], 180.0));
        assert_eq!(found.len(), 3, "{found:?}");
        assert!((found[1] - 60.0).abs() <= 1.0 && (found[2] - 120.0).abs() <= 1.0, "{found:?}");
    }

    #[test]
    fn rest_before_and_after_is_no_step() {
        let found = starts(&run(&[(0.0, 0.0), (1200.0, 80e3), (1320.0, 120e3), (1440.0, 0.0)], 1600.0));
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] - 1200.0).abs() <= 1.0 && (found[1] - 1320.0).abs() <= 1.0, "{found:?}");
    }

    #[test]
    fn a_jump_in_a_gap_is_found_behind_it() {
        let mut series = run(&[(0.0, 90e3), (60.0, 120e3)], 120.0);
        let speed = series.get_mut(&Channel::ShaftSpeed).unwrap();
        let kept: Vec<(f64, f64)> = speed
            .t_s
            .iter()
            .copied()
            .zip(speed.values.iter().copied())
            .filter(|(t, _)| !(50.0..75.0).contains(t))
            .collect();
        (speed.t_s, speed.values) = kept.into_iter().unzip();
        let found = starts(&series);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[1] - 75.0).abs() <= 1.0, "{found:?}");
    }

    fn series(value: impl Fn(usize) -> f64) -> Series {
        Series {
            t_s: (0..3000).map(|row| row as f64 / 10.0).collect(),
            values: (0..3000).map(value).collect(),
        }
    }

    #[test]
    fn noise_and_resolution_make_a_position_and_steps_and_ramps_do_not() {
        let noise = |row: usize| 0.7 * (1.0 + 1e-3 * (row as f64 * 12.9898).sin());
        assert!(reversal_share(&series(noise)).is_some_and(|share| share > 0.1));
        // The last digit changes occasionally.
        assert!(reversal_share(&series(|row| if row % 60 < 30 { 0.7 } else { 0.701 })).is_some());
        assert_eq!(reversal_share(&series(|row| if row % 600 < 300 { 0.7 } else { 0.5 })), None);
        let saw = |row: usize| 0.5 + 0.001 * (row % 300) as f64;
        assert_eq!(reversal_share(&series(saw)), None);
    }
}
