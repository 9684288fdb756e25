//! Predicted outcome of an experiment that was not run: the candidates' predictions, and their separation after refitting each.

use crate::gap::best_fit::coordinate::coordinates;
use crate::gap::best_fit::first_step::is_start;
use crate::gap::best_fit::fit::{Fit, effect_changes};
use crate::gap::best_fit::normal::misfit;
use crate::gap::findings::experiment::{AllowedJump, AlsoChanged, Experiment};
use crate::gap::next_experiment::at_rest::apart_at_rest;
use crate::gap::residuals::actuators::Actuators;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::{Channel, OperatingPoint, Recording, Series, StepKind, StepMarker};
use mapper_identify::DECLARED_INTERVAL_S;
use mapper_observe::averages::time_table::Table;
use mapper_observe::declared::Declared;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Time at the start point before a jump that is also simulated, s.
const HOLD_S: f64 = 30.0;
/// Sample interval of the first pass, s.
pub(crate) const COARSE_S: f64 = 0.5;
/// Maximum time at the target that is simulated, s; longer dwells are cut.
const MAX_S: f64 = 600.0;

/// Properties that simulated steps share with a recording.
#[derive(Debug, Clone)]
pub struct Alike {
    /// Declared tolerances and noise.
    pub declared: Declared,
    /// The nominal machine.
    pub model: Model,
    /// Candidate effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Channels that would be measured.
    pub channels: Vec<Channel>,
    /// Response of the actuators.
    pub actuators: Actuators,
}

/// Simulated steps prepared like a recording that contains only inputs. `rest` is the initial state; `driven` is an input that departs from
/// the campaign's value, at the given times.
pub(crate) fn imagined_steps(
    like: Alike,
    steps: Vec<StepMarker>,
    rest: &OperatingPoint,
    interval_s: f64,
    driven: impl Fn(&[f64]) -> Option<(Channel, Series)>,
) -> Option<Study> {
    let end_s = steps.last()?.end_s;
    let t_s: Vec<f64> = (0..(end_s / interval_s) as usize).map(|i| interval_s * i as f64).collect();
    // Initial guess of the start; the inputs are the campaign's.
    let boundary =
        BoundaryConditions { valve_opening_ratio: rest.valve_opening_ratio, ..like.declared.nominal };
    let held = hold_speed(&like.model, rest.speed_rpm, &boundary).ok()?.state;
    let level = |channel: Channel| match channel {
        Channel::ShaftSpeed => rest.speed_rpm,
        Channel::P2 => held.p2_pa,
        Channel::Tc => held.tc_k,
        Channel::Tt => held.tt_k,
        Channel::T2 => held.t2_tip_k,
        _ => 0.0,
    };
    let series =
        |channel: Channel| (channel, Series { t_s: t_s.clone(), values: vec![level(channel); t_s.len()] });
    // Inputs come from the campaign except for the changed one; the channels the rig measured are measured again.
    let measured =
        OUTPUTS.into_iter().filter(|channel| *channel != Channel::P3 && like.channels.contains(channel));
    let recording = Recording {
        series: measured.map(series).chain(driven(&t_s)).collect(),
        steps,
        ..Recording::default()
    };
    let table = Table::new(&recording)?;
    Some(Study::with_actuators(&recording, table, like.declared, like.model, like.effects, like.actuators))
}

/// A simulated experiment prepared like a recording, with the settled start and its dwell. Effects that began in the recording are active.
fn imagined(recorded: &Study, experiment: &Experiment, interval_s: f64) -> Option<Study> {
    let jump = &experiment.jump;
    let dwell_s = jump.dwell_s.clamp(10.0, MAX_S);
    let marker = |index: usize, from: f64, to: f64, p3_pa: f64, point: OperatingPoint| StepMarker {
        index,
        kind: StepKind::Repeat,
        start_s: from,
        end_s: to,
        from: None,
        to: Some(point),
        p3_pa,
        valve_opening_ratio: point.valve_opening_ratio,
    };
    let steps = vec![
        marker(0, 0.0, HOLD_S, jump.from_p3_pa, jump.from),
        marker(1, HOLD_S, HOLD_S + dwell_s, jump.to_p3_pa, jump.to),
    ];
    let added = if let AlsoChanged::Sensor(channel) = experiment.also { Some(channel) } else { None };
    let like = Alike {
        declared: recorded.declared.clone(),
        model: recorded.nominal.model.clone(),
        effects: recorded.effects.clone(),
        channels: recorded.table.columns.keys().copied().chain(added).collect(),
        actuators: recorded.actuators,
    };
    let driven = |t_s: &[f64]| experiment.driven(t_s, HOLD_S);
    let mut study = imagined_steps(like, steps, &jump.from, interval_s, driven)?;
    study.catalogue = recorded.catalogue;
    study.nuisances.clone_from(&recorded.nuisances);
    Some(study)
}

/// A fit's hypothesis with a new, unknown start.
fn refound(study: &Study, fit: &Fit) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    for (nuisance, sigmas) in study.nuisances.iter().zip(&mut hypothesis.nuisances) {
        if is_start(nuisance.kind) {
            *sigmas = 0.0;
        }
    }
    hypothesis
}

/// First-pass separation of two candidates' predictions of an experiment, in squared sigmas of the noise alone.
///
/// `None` if the model cannot run the step.
pub fn apart_at_first_sight(
    recorded: &Study,
    experiment: &Experiment,
    fits: &[&Fit],
) -> Option<Vec<Vec<f64>>> {
    if let AlsoChanged::Soak(soak) = experiment.also {
        return apart_at_rest(recorded, &soak, fits);
    }
    let study = imagined(recorded, experiment, COARSE_S)?;
    let linearised = Linearised::of_noise_alone(&study).ok()?;
    let predictions: Option<Vec<Vec<f64>>> = fits
        .iter()
        .map(|fit| {
            let mut values = study.predict(&refound(&study, fit)).ok()?.values;
            linearised.whiten(&study, &mut values);
            Some(values)
        })
        .collect();
    let predictions = predictions?;
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    Some(predictions.iter().map(|a| predictions.iter().map(|b| distance(a, b)).collect()).collect())
}

/// Separation after refitting each rival to the experiment: entry `k`, `j` is the misfit increase of `j` if `k` is true, squared sigmas.
///
/// `D` is the difference of the predictions and `J` the derivatives of `j`'s prediction with respect to its nuisances and parameters. `L`
/// is their precision from the recording. Result: `D'D - D'J (L + J'J)^-1 J'D`, all whitened.
pub fn apart(recorded: &Study, experiment: &Experiment, fits: &[&Fit]) -> Option<Vec<Vec<f64>>> {
    if let AlsoChanged::Soak(soak) = experiment.also {
        return apart_at_rest(recorded, &soak, fits);
    }
    let study = imagined(recorded, experiment, DECLARED_INTERVAL_S)?;
    let nominal = Linearised::new(&study).ok()?;
    let mut predicted = Vec::new();
    for fit in fits {
        let hypothesis = refound(&study, fit);
        let here = nominal.at(&study, &hypothesis).ok()?;
        let mut values = here.base.values.clone();
        nominal.whiten(&study, &mut values);
        let coordinates = coordinates(&study.effects, &hypothesis);
        let mut columns = here.columns.clone();
        columns.extend(effect_changes(&study, &nominal, &hypothesis, &here.base, &coordinates));
        predicted.push((values, columns, precision(&study, fit)));
    }
    let mut rows = Vec::new();
    for (truth, ..) in &predicted {
        let mut row = Vec::new();
        for (values, columns, precision) in &predicted {
            let difference: Vec<f64> = truth.iter().zip(values).map(|(a, b)| a - b).collect();
            row.push(misfit(&difference, columns, precision)?);
        }
        rows.push(row);
    }
    Some(rows)
}

/// Precision of a fit from the recording; the new start is as uncertain as the first one was.
fn precision(study: &Study, fit: &Fit) -> DMatrix<f64> {
    let mut precision = fit.precision.clone();
    for (index, nuisance) in study.nuisances.iter().enumerate() {
        if is_start(nuisance.kind) {
            precision.row_mut(index).fill(0.0);
            precision.column_mut(index).fill(0.0);
            precision[(index, index)] = 1.0;
        }
    }
    precision
}

/// The recorded jumps, used if no others are declared as allowed.
pub fn recorded_jumps(study: &Study, points: &[OperatingPoint]) -> Vec<AllowedJump> {
    let pairs = study.steps.windows(2).zip(points.windows(2));
    pairs
        .map(|(steps, points)| AllowedJump {
            from: points[0],
            to: points[1],
            from_p3_pa: steps[0].marker.p3_pa,
            to_p3_pa: steps[1].marker.p3_pa,
            dwell_s: steps[1].marker.end_s - steps[1].marker.start_s,
        })
        .collect()
}

/// Operating points at the end of the recorded steps, for a hypothesis.
pub fn recorded_points(study: &Study, hypothesis: &Hypothesis) -> Vec<OperatingPoint> {
    let points = study.points(hypothesis).unwrap_or_default();
    let steps = study.steps.iter().zip(points);
    steps
        .map(|(step, point)| OperatingPoint {
            speed_rpm: point.speed_rpm,
            valve_opening_ratio: step.marker.valve_opening_ratio,
        })
        .collect()
}
