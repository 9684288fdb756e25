//! Predictions of the residuals, and the state of each point.

use crate::gap::residuals::nuisance::{Circumstances, Hypothesis, OUTPUTS, RESPONSES_S};
use crate::gap::residuals::study::{PredictError, Prediction, Study};
use crate::gap::residuals::true_inputs::{
    LinearisedMachine, LinearisedSamples, MEASURED, MachineRun, Sample, SampleValues, SurroundingsHistory,
    TrueInputs, with_metal_held,
};
use crate::gap::structure::repeating_part;
use mapper_core::Channel;
use mapper_observe::averages::{estimate_state, mean_reading};
use mapper_observe::model_inputs::lagged_command::{LaggedCommand, Response};
use mapper_physics::rig::effect::{EffectError, Rig};
use mapper_physics::rig::instruments::{ChannelFollower, ChannelPath, Surroundings, ValveMotion};
use mapper_physics::simulation::driven::{DriveError, drive, settle};
use mapper_physics::simulation::model::{Outputs, PreparedModel, State};
use mapper_physics::simulation::steady::Inputs;
use std::sync::Arc;

/// Time before the end of a part at which its last inputs are read, s. Bound: shorter than any sample, longer than rounding.
const BEFORE_END_S: f64 = 1e-6;

struct Segment {
    first: usize,
    /// Start and end, s; infinite at both ends of the recording.
    from_s: f64,
    to_s: f64,
}

fn read_sample(prepared: &PreparedModel<'_>, state: &State, outputs: &Outputs) -> SampleValues {
    Sample::of(prepared, state, outputs).to_array()
}

impl Study {
    /// A hypothesis without the sensors of outputs.
    fn machine(&self, hypothesis: &Hypothesis) -> Hypothesis {
        let mut machine = hypothesis.clone();
        machine.effects.retain(|(index, _)| self.on_machine[*index]);
        for (sigmas, nuisance) in machine.nuisances.iter_mut().zip(&self.nuisances) {
            // One with another centre acts at its neutral value too.
            if !nuisance.kind.is_on_machine() {
                *sigmas = 0.0;
            }
        }
        machine
    }

    fn segments(&self, hypothesis: &Hypothesis) -> Vec<Segment> {
        let shares = |step: usize| {
            let effects = hypothesis.effects.iter();
            effects.map(move |(index, _)| self.histories[*index].at(step as f64))
        };
        let firsts: Vec<usize> = (0..self.steps.len().max(1))
            .filter(|step| *step == 0 || !shares(*step).eq(shares(step - 1)))
            .collect();
        let begin_s = |step: usize| self.steps[step].marker.start_s;
        firsts
            .iter()
            .enumerate()
            .map(|(place, first)| Segment {
                first: *first,
                from_s: if place == 0 { f64::NEG_INFINITY } else { begin_s(*first) },
                to_s: firsts.get(place + 1).map_or(f64::INFINITY, |next| begin_s(*next)),
            })
            .collect()
    }

    /// Drives the model of a hypothesis through the recording. `on_sample` receives the index of each of `times_s` and the model's state.
    pub(crate) fn drive(
        &self,
        hypothesis: &Hypothesis,
        times_s: &[f64],
        on_sample: impl FnMut(usize, &PreparedModel<'_>, &State, &Outputs),
    ) -> Result<(), PredictError> {
        self.drive_rigs(hypothesis, |step| self.rig(hypothesis, step), times_s, on_sample)
    }

    /// The same for a rig that differs from that of the hypothesis and changes with it.
    fn drive_rigs(
        &self,
        hypothesis: &Hypothesis,
        rig_in: impl Fn(usize) -> Result<(Rig, Circumstances), EffectError>,
        times_s: &[f64],
        mut on_sample: impl FnMut(usize, &PreparedModel<'_>, &State, &Outputs),
    ) -> Result<(), PredictError> {
        let mut state: Option<State> = None;
        let mut done = 0;
        for Segment { first, from_s, to_s } in self.segments(hypothesis) {
            let (rig, circumstances) = &rig_in(first)?;
            let inputs = self.true_inputs(circumstances);
            let start = match state {
                None => self.start(rig, &inputs, circumstances)?,
                Some(state) => state,
            };
            let sample = |index: usize, prepared: &PreparedModel<'_>, state: &State, outputs: &Outputs| {
                on_sample(done + index, prepared, state, outputs);
            };
            let until = times_s.partition_point(|t| *t <= to_s);
            let grid = self.grid.part(from_s, to_s);
            let mut ended = drive(&rig.model, &inputs, start, &grid, &times_s[done..until], sample)?;
            done = until;
            // An instantaneous probe has no state until a slow probe replaces it.
            if rig.model.params.t2_probe_diameter_m == 0.0 && to_s.is_finite() {
                let boundary = inputs.at(to_s - BEFORE_END_S);
                ended.t2_tip_k = rig.model.prepare(&boundary).evaluate(&ended).t2_k;
            }
            state = Some(ended);
        }
        Ok(())
    }

    /// Readings of the outputs of these rigs at `times_s`; `on_reading` receives the index of the time, of the output, and the reading.
    pub(crate) fn read(
        &self,
        hypothesis: &Hypothesis,
        rig_in: impl Fn(usize) -> Result<(Rig, Circumstances), EffectError>,
        times_s: &[f64],
        on_reading: impl FnMut(usize, usize, f64, &Circumstances),
    ) -> Result<(), PredictError> {
        let samples = self.samples(hypothesis, &rig_in, times_s)?;
        self.sense(&samples, hypothesis, rig_in, times_s, on_reading)
    }

    fn samples(
        &self,
        hypothesis: &Hypothesis,
        rig_in: impl Fn(usize) -> Result<(Rig, Circumstances), EffectError>,
        times_s: &[f64],
    ) -> Result<Vec<Sample>, PredictError> {
        let mut samples = Vec::with_capacity(times_s.len());
        self.drive_rigs(hypothesis, rig_in, times_s, |_, prepared, state, outputs| {
            samples.push(Sample::of(prepared, state, outputs));
        })?;
        Ok(samples)
    }

    fn sense(
        &self,
        samples: &[Sample],
        hypothesis: &Hypothesis,
        rig_in: impl Fn(usize) -> Result<(Rig, Circumstances), EffectError>,
        times_s: &[f64],
        mut on_reading: impl FnMut(usize, usize, f64, &Circumstances),
    ) -> Result<(), PredictError> {
        let mut followers =
            OUTPUTS.map(|channel| ChannelFollower::new(*self.nominal.instruments.path(channel)));
        let mut done = 0;
        for Segment { first, to_s, .. } in self.segments(hypothesis) {
            let (rig, circumstances) = &rig_in(first)?;
            let p3 = Response { lag_s: rig.instruments.p3_lag_s, ..self.actuators.p3 };
            let command = LaggedCommand::new(self.inputs.command.levels().to_vec(), p3, self.actuators.valve);
            let paths = OUTPUTS.map(|channel| *rig.instruments.path(channel));
            followers.iter_mut().zip(paths).for_each(|(follower, path)| follower.turn_to(path));
            let until = times_s.partition_point(|t| *t <= to_s);
            // No sample lies behind the end of the followed part.
            let followed = times_s.iter().zip(samples).enumerate().take(until).skip(done);
            for (index, (t_s, sample)) in followed {
                let t_s = *t_s;
                for (output, channel) in OUTPUTS.into_iter().enumerate() {
                    let seen = if channel == Channel::P3 {
                        command.p3_pa(t_s)
                    } else {
                        paths[output].at_sensor(sample.values[output], sample.surroundings(channel))
                    };
                    // T4 is T3' minus a temperature drop that is known only to a few per cent.
                    let seen = if channel == Channel::T4 {
                        seen - circumstances.t4_drop_ratio * sample.turbine_drop_k
                    } else {
                        seen
                    };
                    on_reading(index, output, followers[output].read(t_s, seen), circumstances);
                }
            }
            done = until;
        }
        Ok(())
    }

    /// Predicts the recording.
    pub fn predict(&self, hypothesis: &Hypothesis) -> Result<Prediction, PredictError> {
        let machine = self.machine(hypothesis);
        let samples = self.samples(&machine, |step| self.rig(&machine, step), &self.times_s)?;
        self.predict_from(hypothesis, Arc::new(MachineRun { machine, is_exact: true, samples }))
    }

    /// The same, with the run of another prediction if both have the same machine.
    pub(crate) fn predict_near(
        &self,
        hypothesis: &Hypothesis,
        other: &Prediction,
    ) -> Result<Prediction, PredictError> {
        if self.machine(hypothesis) == other.run.machine {
            self.predict_from(hypothesis, other.run.clone())
        } else {
            self.predict(hypothesis)
        }
    }

    /// The same, from the derivatives of a run: for small differences, or derivatives.
    pub(crate) fn predict_linearly(
        &self,
        hypothesis: &Hypothesis,
        near: &LinearisedMachine,
    ) -> Result<Prediction, PredictError> {
        let machine = self.machine(hypothesis);
        if machine == near.run.machine {
            return self.predict_from(hypothesis, near.run.clone());
        }
        let linear = near.linear.get_or_init(|| self.linearise(&near.run.machine));
        match linear.as_ref().map_or(Ok(None), |run| self.samples_of_other(run, &machine))? {
            Some(samples) => {
                self.predict_from(hypothesis, Arc::new(MachineRun { machine, is_exact: false, samples }))
            }
            None => self.predict(hypothesis),
        }
    }

    /// The derivatives of a run; `None` if it has none everywhere.
    fn linearise(&self, machine: &Hypothesis) -> Option<LinearisedSamples> {
        let mut driven: Option<(LinearisedSamples, State)> = None;
        for Segment { first, from_s, to_s } in self.segments(machine) {
            let (rig, circumstances) = self.rig(machine, first).ok()?;
            let inputs = self.true_inputs(&circumstances);
            let (mut run, start) = match driven {
                None => {
                    let start = self.start(&rig, &inputs, &circumstances).ok()?;
                    (LinearisedSamples::new(&rig.model, start), start)
                }
                Some(driven) => driven,
            };
            let end = run.drive(&rig.model, &inputs, start, &self.grid.part(from_s, to_s), read_sample)?;
            driven = Some((run, end));
        }
        driven.map(|(run, _)| run)
    }

    /// Samples of another machine; `None` if it has other states than the run.
    fn samples_of_other(
        &self,
        run: &LinearisedSamples,
        machine: &Hypothesis,
    ) -> Result<Option<Vec<Sample>>, PredictError> {
        let mut samples = Vec::with_capacity(self.times_s.len());
        let mut distance = None;
        for Segment { first, from_s, to_s } in self.segments(machine) {
            let (rig, circumstances) = self.rig(machine, first)?;
            if !run.fits(&rig.model) {
                return Ok(None);
            }
            let inputs = self.true_inputs(&circumstances);
            let mut from_run = match distance {
                None => run.distance_of_start(&self.start(&rig, &inputs, &circumstances)?),
                Some(distance) => distance,
            };
            let times_s = &self.times_s[samples.len()..self.times_s.partition_point(|t| *t <= to_s)];
            run.drive_other(
                (&rig.model, &inputs),
                (from_s, to_s),
                &mut from_run,
                times_s,
                read_sample,
                |sample| samples.push(Sample::from_array(sample)),
            )?;
            distance = Some(from_run);
        }
        Ok(Some(samples))
    }

    fn predict_from(
        &self,
        hypothesis: &Hypothesis,
        run: Arc<MachineRun>,
    ) -> Result<Prediction, PredictError> {
        let mut values = vec![0.0; self.measured.len()];
        let mut delay_s = [0.0; OUTPUTS.len()];
        let mut missed_ratio = [[0.0; RESPONSES_S.len()]; OUTPUTS.len()];
        let rig_in = |step| self.rig(hypothesis, step);
        self.sense(
            &run.samples,
            hypothesis,
            rig_in,
            &self.times_s,
            |index, output, reading, circumstances| {
                delay_s = circumstances.delay_s;
                missed_ratio = circumstances.missed_ratio;
                let Some((step, block, share)) = self.places[index] else { return };
                let Some(row) = self.rows[step][block][output] else { return };
                values[row as usize] += share * reading;
            },
        )?;
        let slopes = self.slopes(&values);
        for group in &self.groups {
            let delay_s = delay_s[group.output];
            if delay_s != 0.0 {
                for row in group.rows.clone() {
                    values[row] -= delay_s * slopes[row];
                }
            }
        }
        for (output, parts) in missed_ratio.iter().enumerate() {
            for (part, missed_ratio) in parts.iter().enumerate().filter(|(_, ratio)| **ratio != 0.0) {
                for (row, whole) in repeating_part(self, output, part) {
                    values[row] += missed_ratio * whole;
                }
            }
        }
        Ok(Prediction { values, slopes, run })
    }

    /// Settled state under the first inputs, shifted by the circumstances; metal that had not settled keeps its measured temperature.
    fn start(
        &self,
        rig: &Rig,
        inputs: &impl Inputs,
        circumstances: &Circumstances,
    ) -> Result<State, DriveError> {
        let start_s = self.grid.nodes_s().first().copied().unwrap_or(0.0);
        let boundary = inputs.at(start_s);
        // Not from the very start of the recording, where the machine may still be at standstill.
        let read = |channel: Channel| {
            let column = &self.table.column(channel)?[self.table.range(start_s, f64::INFINITY)];
            mean_reading(&column.iter().copied().filter(|v| v.is_finite()).take(20).collect::<Vec<_>>())
        };
        let guess = estimate_state(&boundary, read);
        let held = (!self.rested).then(|| with_metal_held(&rig.model));
        let mut start = settle(held.as_ref().unwrap_or(&rig.model), &boundary, guess)?;
        for (perturbation, by) in &circumstances.perturbations {
            perturbation.adjust_initial_state(&mut start, *by);
        }
        Ok(start)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PointState {
    pub speed_rpm: f64,
    /// Isentropic efficiency, fraction.
    pub efficiency: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: f64,
    /// Position on the speed line: 0 choke, 1 surge.
    pub surge_position_ratio: f64,
}

impl PointState {
    pub(crate) fn of(state: &State, outputs: &Outputs) -> PointState {
        PointState {
            speed_rpm: state.shaft_speed_rpm(),
            efficiency: outputs.efficiency,
            h_w_m2k: outputs.h_w_m2k,
            surge_position_ratio: outputs.surge_position_ratio,
        }
    }
}

impl Study {
    /// The inputs without the errors that these circumstances give their sensors.
    pub(crate) fn true_inputs<'a>(&'a self, circumstances: &'a Circumstances) -> TrueInputs<'a> {
        let depends = circumstances.paths.iter().any(ChannelPath::depends_on_surroundings);
        let history = depends.then(|| self.surroundings.get_or_init(|| self.surroundings_history()));
        let valve = circumstances.valve;
        let moved = (valve != ValveMotion::default()).then(|| self.inputs.command.with_valve(valve));
        TrueInputs { recorded: &self.inputs, moved, circumstances, history }
    }

    /// Walls and flows along the recording, as measured, or as the nominal machine has them; empty if that cannot follow.
    fn surroundings_history(&self) -> SurroundingsHistory {
        let mut history = SurroundingsHistory { t_s: self.times_s.clone(), rows: Vec::new() };
        let drive = self.drive(&self.nothing(), &self.times_s, |_, _, state, outputs| {
            history.rows.push([state.tc_k, outputs.flow_kg_s, state.tt_k, outputs.turbine_flow_kg_s]);
        });
        if drive.is_err() {
            return SurroundingsHistory::default();
        }
        for (place, channel) in MEASURED.into_iter().enumerate() {
            // Readings that never change belong to an experiment that is only planned.
            let column = self.table.column(channel).filter(|c| c.windows(2).any(|pair| pair[0] != pair[1]));
            for index in 0..history.rows.len() {
                let row = &mut history.rows[index][place];
                *row = column.and_then(|column| mean_near(self, column, index)).unwrap_or(*row);
                if [Channel::CompressorFlow, Channel::TurbineFlow].contains(&channel) {
                    *row = Surroundings::flow_ratio(&self.nominal.model.params, channel, *row);
                }
            }
        }
        history
    }

    /// For each step, its blocks' times after its start, s, and their position on the speed line (beyond 1: surge).
    pub(crate) fn surge_positions(
        &self,
        hypothesis: &Hypothesis,
    ) -> Result<Vec<Vec<(f64, f64)>>, PredictError> {
        let mut positions = vec![Vec::new(); self.steps.len()];
        self.drive(hypothesis, &self.times_s, |index, _, _, outputs| {
            if let Some((step, block, _)) = self.places[index] {
                let since_s = self.steps[step].blocks[block].since_jump_s;
                positions[step].push((since_s, outputs.surge_position_ratio));
            }
        })?;
        Ok(positions)
    }

    pub(crate) fn points(&self, hypothesis: &Hypothesis) -> Result<Vec<PointState>, PredictError> {
        Ok(self.points_with_others(hypothesis, &[])?.into_iter().map(|(point, _)| point).collect())
    }

    /// Model state at the end of each step, with efficiency and h of other hypotheses' models at the same speed, pressures and metal.
    pub(crate) fn points_with_others(
        &self,
        hypothesis: &Hypothesis,
        others: &[&Hypothesis],
    ) -> Result<Vec<(PointState, Vec<PointState>)>, PredictError> {
        let times_s: Vec<f64> = self
            .steps
            .iter()
            .map(|step| step.blocks.last().map_or(step.marker.end_s, |block| block.mean_s + block.spread_s))
            .collect();
        let mut rigs = Vec::with_capacity(times_s.len());
        for step in 0..times_s.len() {
            let of_step: Result<Vec<_>, _> = others.iter().map(|other| self.rig(other, step)).collect();
            rigs.push(of_step?);
        }
        let mut points = vec![(PointState::default(), Vec::new()); times_s.len()];
        self.drive(hypothesis, &times_s, |index, prepared, state, outputs| {
            let other_point = |(rig, _): &(Rig, Circumstances)| {
                let outputs = rig.model.prepare(prepared.boundary()).evaluate(state);
                PointState::of(state, &outputs)
            };
            points[index] = (PointState::of(state, outputs), rigs[index].iter().map(other_point).collect());
        })?;
        Ok(points)
    }
}

/// Mean of the readings that are nearer to one of a study's times than to the others.
fn mean_near(study: &Study, column: &[f64], index: usize) -> Option<f64> {
    let (t_s, times_s) = (study.times_s[index], &study.times_s);
    let half = |other: Option<&f64>, away_s: f64| 0.5 * (other.copied().unwrap_or(t_s + away_s) + t_s);
    let before = index.checked_sub(1).and_then(|before| times_s.get(before));
    let near = study.table.range(half(before, -1.0), half(times_s.get(index + 1), 1.0));
    let read: Vec<f64> = column[near].iter().copied().filter(|value| value.is_finite()).collect();
    (!read.is_empty()).then(|| read.iter().sum::<f64>() / read.len() as f64)
}
