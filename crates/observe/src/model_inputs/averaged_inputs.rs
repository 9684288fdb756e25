//! Recorded boundary conditions as model inputs: averaged in quiet segments, unaveraged after jumps.
//!
//! In contrast to [`smoothed_inputs`](crate::model_inputs::smoothed_inputs), these keep the noise of means, which is independent between
//! segments, and follow a step of an input sensor. The search for drift needs both properties.

use crate::averages::{BEFORE_S, INPUT_CHANNELS, Schedule, TIME_ROUNDING_S, Table, boundary_condition};
use crate::model_inputs::lagged_command::{
    LaggedCommand, Response, commanded_s, levels_of_step, measured_valve_response, settled, valve_areas_m2,
};
use mapper_core::{Channel, Recording, StepMarker};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::{mean, median};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::steady::{Inputs, InputsError, InterpolatedInputs};
use std::collections::BTreeMap;

/// Time after a jump for which readings are not averaged, s. Bound: actuators need some tenths.
const RAW_S: f64 = 3.0;
/// Maximum lag that is attributed to the valve, s. Bound: pneumatic and electric actuators of this size need 0.1 to 1 s, flow meters up
/// to several seconds.
const MAX_VALVE_LAG_S: f64 = 1.5;
/// Openings closer than this are one command. Bound: the read-back of a command varies in its last digits.
const SAME_OPENING_RATIO: f64 = 1e-3;
/// Maximum play that is sought. Bound: a drive with more is broken.
const MAX_PLAY_RATIO: f64 = 0.1;
/// Intervals of the coarse search for play. Bound: half a per cent apart, a quarter of the play of a worn positioner.
const PLAYS: u32 = 20;
/// Tolerance of the play. Bound: a tenth of what moves an output by its noise.
const PLAY_TOLERANCE: f64 = 1e-4;
/// Logarithm of the likelihood of Laplacian deviations that play must gain. Bound: one of ten thousand recordings without play gains as much.
const MIN_PLAY_GAIN: f64 = 9.2;
/// Averaging times after the raw readings. Each is at least as long as the time step of the model. Bound: a speed-control loop corrects
/// P3 by a per cent within ten seconds of the jump, and the means must follow this.
const AFTER_JUMP: Schedule = Schedule {
    first_s: RAW_S,
    lengths_s: &[(8.0, 0.5), (20.0, 1.0), (50.0, 5.0), (f64::INFINITY, 10.0)],
    shortest_s: 0.1,
    shortest_ratio: 0.5,
};
/// Averaging times without a previous jump. Bound: only the temperature of the metal changes.
const AT_REST: Schedule =
    Schedule { first_s: 0.0, lengths_s: &[(f64::INFINITY, 10.0)], shortest_s: 0.1, shortest_ratio: 0.5 };

/// Boundary conditions between jumps, never interpolated across a jump.
#[derive(Debug, Clone, PartialEq)]
pub struct AveragedInputs {
    starts_s: Vec<f64>,
    levels: Vec<InterpolatedInputs>,
}

impl Inputs for AveragedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let level = self.level(t_s);
        self.levels[level].at(t_s)
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        let level = self.level(t_s);
        let next_s = self.starts_s.get(level + 1).copied().unwrap_or(f64::INFINITY);
        self.levels[level].next_kink_s(t_s).min(next_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        let level = self.level(t_s);
        self.levels[level].is_constant_after(t_s)
    }
}

impl AveragedInputs {
    /// The inputs of a recording during `steps` (rising in time, each with the commands it holds). `nominal` replaces channels that are not
    /// recorded, and the valve has the play and the dead band of `declared_valve`.
    pub fn read(
        recording: &Recording,
        (nominal, declared_valve): (&BoundaryConditions, Response),
        steps: &[StepMarker],
    ) -> Result<AveragedInputs, InputsError> {
        let mut inputs = AveragedInputs { starts_s: Vec::new(), levels: Vec::new() };
        let levels: Vec<_> = steps.iter().map(|step| levels_of_step(recording, step)).collect();
        let valve = valve_response(recording, nominal, declared_valve);
        let command =
            LaggedCommand::new(levels.iter().flatten().copied().collect(), Response::lag(0.0), valve);
        for (index, (step, levels)) in steps.iter().zip(&levels).enumerate() {
            let next_s = steps.get(index + 1).map_or(step.end_s, |next| next.start_s);
            let mut nodes =
                Nodes { recording, nominal, command: &command, t_s: Vec::new(), rows: Vec::new() };
            let changed_s = (index > 0).then(|| commanded_s(levels, step));
            nodes.add_level(step.start_s, next_s, changed_s);
            inputs.starts_s.push(step.start_s);
            inputs.levels.push(InterpolatedInputs::new(nodes.t_s, nodes.rows)?);
        }
        Ok(inputs)
    }

    fn level(&self, t_s: f64) -> usize {
        self.starts_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1)
    }
}

/// Response of the valve, from the recording, with its declared dead band and the play that repeats of an opening show. It is immediate if it is
/// unknown or slower than any undeclared valve, which indicates a lag of the flow meter.
fn valve_response(recording: &Recording, nominal: &BoundaryConditions, declared: Response) -> Response {
    let Some(table) = Table::new(recording) else { return declared };
    let declared = Response { play: shown_play(&table, recording, nominal, declared), ..declared };
    let slowest_s = declared.lag_s.max(MAX_VALVE_LAG_S);
    measured_valve_response(&table, recording, (nominal.p1_pa, 0.0), declared)
        .filter(|valve| valve.lag_s < slowest_s)
        .unwrap_or(declared)
}

/// Play with which the areas that flow and pressures show at the ends of the steps agree best, relative to the predicted openings, between repeats of
/// one command; the declared play unless more is better than chance.
fn shown_play(table: &Table, recording: &Recording, nominal: &BoundaryConditions, declared: Response) -> f64 {
    let Some(areas_m2) = valve_areas_m2(table, (nominal.p1_pa, 0.0)) else { return declared.play };
    let areas_m2: Vec<Option<f64>> =
        recording.steps.iter().map(|step| settled(table, step, &areas_m2)).collect();
    let spread = |more: f64| {
        let valve = Response { play: declared.play + more, ..declared };
        let command = LaggedCommand::of_recording(recording, Response::lag(0.0), valve);
        let mut differences: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        for (step, area_m2) in recording.steps.iter().zip(&areas_m2) {
            let Some(area_m2) = area_m2.filter(|area_m2| *area_m2 > 0.0) else { continue };
            let command_key = (step.valve_opening_ratio / SAME_OPENING_RATIO).round() as i64;
            let predicted = command.valve_opening_ratio(step.end_s - TIME_ROUNDING_S);
            differences.entry(command_key).or_default().push((area_m2 / predicted).ln());
        }
        // Absolute deviations, because areas at low pressure ratios scatter more.
        let deviations = differences.values().filter(|repeats| repeats.len() > 1).flat_map(|repeats| {
            let middle = median(repeats).unwrap_or(0.0);
            repeats.iter().map(move |difference| (difference - middle).abs())
        });
        deviations.fold((0, 0.0), |(count, sum), deviation| (count + 1, sum + deviation))
    };
    let coarse = (0..=PLAYS).map(|i| MAX_PLAY_RATIO * f64::from(i) / f64::from(PLAYS));
    let Some(coarse) = coarse.min_by(|a, b| spread(*a).1.total_cmp(&spread(*b).1)) else {
        return declared.play;
    };
    let apart = MAX_PLAY_RATIO / f64::from(PLAYS);
    let best = minimise((coarse - apart).max(0.0), coarse + apart, PLAY_TOLERANCE, |more| spread(more).1);
    let (count, without) = spread(0.0);
    let gained = f64::from(count) * (without / best.value.max(f64::MIN_POSITIVE)).ln();
    if count > 0 && gained > MIN_PLAY_GAIN { declared.play + best.at } else { declared.play }
}

struct Nodes<'a> {
    recording: &'a Recording,
    nominal: &'a BoundaryConditions,
    command: &'a LaggedCommand,
    t_s: Vec<f64>,
    rows: Vec<BoundaryConditions>,
}

impl Nodes<'_> {
    /// Adds the nodes from one jump to the next; its last command was sent at `changed_s`.
    fn add_level(&mut self, start_s: f64, end_s: f64, changed_s: Option<f64>) {
        let raw_end_s = changed_s.map_or(start_s, |changed_s| (changed_s + RAW_S).min(end_s));
        if changed_s.is_some() {
            let t_s = self
                .recording
                .series
                .get(&Channel::P3)
                .map(|series| series.slice(start_s, raw_end_s - BEFORE_S).0.to_vec())
                .unwrap_or_default();
            // The first node is at the jump itself, where the valve starts to move.
            let mut times = vec![start_s];
            times.extend(t_s.into_iter().filter(|t| *t > start_s));
            for t_s in times {
                // Quantities that do not jump keep the mean of the whole segment.
                let mut row = self.means(start_s, raw_end_s);
                row.valve_opening_ratio = self.command.valve_opening_ratio(t_s);
                for channel in [Channel::P3, Channel::P4] {
                    let reading =
                        self.recording.series.get(&channel).and_then(|series| series.interpolate(t_s));
                    if let (Some(reading), Some(value)) = (reading, boundary_condition(&mut row, channel)) {
                        *value = reading;
                    }
                }
                self.push(t_s, row);
            }
        }
        // The schedule after a jump begins with the end of its ramp.
        let (schedule, from_s) = match changed_s {
            Some(changed_s) => (AFTER_JUMP, changed_s),
            None => (AT_REST, start_s),
        };
        for (low_s, high_s) in schedule.segments(from_s, end_s, 0.0) {
            let row = self.means(low_s, high_s - BEFORE_S);
            self.push(0.5 * (low_s + high_s), row);
        }
    }

    fn push(&mut self, t_s: f64, row: BoundaryConditions) {
        if self.t_s.last().is_none_or(|last| *last < t_s) {
            self.t_s.push(t_s);
            self.rows.push(row);
        }
    }

    fn means(&self, start_s: f64, end_s: f64) -> BoundaryConditions {
        let valve_opening_ratio = self.command.valve_opening_ratio(0.5 * (start_s + end_s));
        let mut row = BoundaryConditions { valve_opening_ratio, ..*self.nominal };
        if let Some(p3_pa) = self.recording.series.get(&Channel::P3Command).and_then(|c| c.held(start_s)) {
            row.p3_pa = p3_pa;
        }
        for channel in INPUT_CHANNELS.into_iter().chain([Channel::TAmb]) {
            let (Some(series), Some(value)) =
                (self.recording.series.get(&channel), boundary_condition(&mut row, channel))
            else {
                continue;
            };
            let values = series.slice(start_s, end_s).1;
            let middle = || series.interpolate(0.5 * (start_s + end_s));
            *value = mean(values).or_else(middle).unwrap_or(*value);
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Series, StepKind, StepMarker};
    use mapper_physics::laws::turbine;

    /// A loop that holds the speed trims P3 by 2 kPa within some seconds of the jump. The inputs follow to a hundredth of that: the
    /// interpolation error between two half-second means is 16 Pa (curvature 2 kPa / (2 s)^2, over 8 x 0.5^2 s^2).
    #[test]
    fn the_trim_of_a_speed_loop_is_followed() {
        let jump_s = 20.0;
        let p3_pa = |t_s: f64| match t_s - jump_s {
            since_s if since_s < 0.0 => 120e3,
            since_s => 200e3 + 2e3 * (1.0 - (-since_s / 2.0).exp()),
        };
        let t_s: Vec<f64> = (0..=800).map(|sample| 0.1 * f64::from(sample)).collect();
        let values = t_s.iter().map(|t_s| p3_pa(*t_s)).collect();
        let recording =
            Recording { series: [(Channel::P3, Series { t_s, values })].into(), ..Recording::default() };
        let nominal = BoundaryConditions::default();
        let steps = [(0.0, jump_s, 1.0, 120e3), (jump_s, 80.0, 0.7, 200e3)];
        let steps = steps.map(|(start_s, end_s, valve_opening_ratio, p3_pa)| StepMarker {
            index: 0,
            kind: StepKind::Point,
            start_s,
            end_s,
            from: None,
            to: None,
            p3_pa,
            valve_opening_ratio,
        });
        let inputs = AveragedInputs::read(&recording, (&nominal, Response::lag(0.0)), &steps).unwrap();
        for t_s in (0..590).map(|tenth| jump_s + 0.95 + 0.1 * f64::from(tenth)) {
            let off_pa = inputs.at(t_s).p3_pa - p3_pa(t_s);
            assert!(off_pa.abs() < 20.0, "{off_pa} Pa off {} s after the jump", t_s - jump_s);
        }
    }

    /// The orifice flow through a valve that moves at 0.5 1/s: the inputs have its opening, not the command.
    #[test]
    fn a_valve_that_takes_its_time_is_followed() {
        let opening =
            |t_s: f64, from: f64, to: f64| from + (to - from) * (0.5 * t_s / (to - from).abs()).min(1.0);
        let level = |t_s: f64| if ((t_s / 20.0) as u32).is_multiple_of(2) { (1.5, 0.5) } else { (0.5, 1.5) };
        let truth = |t_s: f64| {
            let (from, to) = level(t_s);
            if t_s < 20.0 { to } else { opening(t_s % 20.0, from, to) }
        };
        let t_s: Vec<f64> = (0..1600).map(|sample| 0.1 * f64::from(sample)).collect();
        let series = |value: &dyn Fn(f64) -> f64| Series {
            values: t_s.iter().map(|t_s| value(*t_s)).collect(),
            t_s: t_s.clone(),
        };
        let flow = |t_s: f64| turbine::flow_kg_s(2.4e-4 * truth(t_s), 160e3, 360.0, 100e3);
        let step = |index: usize| {
            let start_s = 20.0 * index as f64;
            StepMarker {
                index,
                kind: StepKind::Point,
                start_s,
                end_s: start_s + 20.0,
                from: None,
                to: None,
                p3_pa: 150e3,
                valve_opening_ratio: level(start_s + 1.0).1,
            }
        };
        let steps: Vec<StepMarker> = (0..8).map(step).collect();
        let recording = Recording {
            series: [
                (Channel::ShaftSpeed, series(&|_| 120e3)),
                (Channel::CompressorFlow, series(&flow)),
                (Channel::P2, series(&|_| 160e3)),
                (Channel::P3, series(&|_| 150e3)),
                (Channel::T2, series(&|_| 360.0)),
            ]
            .into(),
            steps,
            ..Recording::default()
        };
        let inputs = AveragedInputs::read(
            &recording,
            (&BoundaryConditions::default(), Response::lag(0.0)),
            &recording.steps,
        )
        .unwrap();
        for since_s in [0.5, 1.0, 1.5, 2.5, 10.0] {
            let off = inputs.at(40.0 + since_s).valve_opening_ratio - truth(40.0 + since_s);
            // A twentieth of the jump: the orifice flow resolves the opening no better while it moves.
            assert!(off.abs() < 0.05, "{off} off {since_s} s after the jump");
        }
    }
}
