//! Model state at one instant, in map coordinates.

use crate::gap::residuals::nuisance::Circumstances;
use crate::gap::residuals::study::{Hypothesis, PredictError, Study};
use crate::gap::residuals::true_inputs::{MEASURED, SurroundingsHistory, TrueInputs};
use mapper_core::Channel;
use mapper_physics::rig::effect::Rig;
use mapper_physics::rig::instruments::{ChannelPath, Surroundings, ValveMotion};
use mapper_physics::simulation::model::{Outputs, State};

/// Model state at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PointState {
    /// Shaft speed, rpm.
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
            if let Some((step, block)) = self.places[index] {
                let since_s = self.steps[step].blocks[block].since_jump_s;
                positions[step].push((since_s, outputs.surge_position_ratio));
            }
        })?;
        Ok(positions)
    }

    /// Model state at the end of each step.
    pub(crate) fn points(&self, hypothesis: &Hypothesis) -> Result<Vec<PointState>, PredictError> {
        Ok(self.points_with_others(hypothesis, &[])?.into_iter().map(|(point, _)| point).collect())
    }

    /// Model state at the end of each step, and the efficiency and h of other hypotheses' models at the same speed, pressures and metal
    /// temperatures.
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
