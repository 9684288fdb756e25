//! What an experiment would show: predictions of jumps and of a soak at rest, and how far they separate causes.

use crate::gap::best_fit::coordinate::{coordinates, effect_neighbours, nuisance_neighbours};
use crate::gap::best_fit::fit::{Fit, effect_changes};
use crate::gap::best_fit::normal::misfit_increases;
use crate::gap::findings::experiment::{AllowedJump, AlsoChanged, AtRest, Experiment};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::true_inputs::{Actuators, SETTLING_S};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::{Channel, OperatingPoint, Recording, SAMPLE_INTERVAL_S, Series, StepKind, StepMarker};
use mapper_identify::BLOCK_S;
use mapper_numerics::least_squares::descent::FINE;
use mapper_observe::averages::Table;
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Duration of the first step of a script, and maximum simulated time at a target, s. Bound: housings settle within minutes.
pub(crate) const SETTLED_HOUSINGS_S: f64 = 300.0;
/// Minimum simulated time at a target, s. Bound: the probe settles within it.
const MIN_DWELL_S: f64 = 10.0;

/// The rig of a recording, for steps that are only simulated.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedRig {
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

/// A study of simulated steps, whose recording contains only inputs. The machine has settled at `rest`; `driven` is an input that departs from the
/// campaign's value, at the given times.
pub(crate) fn simulated_steps(
    rig: SimulatedRig,
    steps: Vec<StepMarker>,
    rest: &OperatingPoint,
    interval_s: f64,
    driven: impl Fn(&[f64]) -> Option<(Channel, Series)>,
) -> Option<Study> {
    let end_s = steps.last()?.end_s;
    let t_s: Vec<f64> = (0..(end_s / interval_s) as usize).map(|i| interval_s * i as f64).collect();
    // Initial guess of the start under the campaign's inputs.
    let boundary =
        BoundaryConditions { valve_opening_ratio: rest.valve_opening_ratio, ..rig.declared.nominal };
    let held = hold_speed(&rig.model, rest.speed_rpm, &boundary).ok()?.state;
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
    // Only the changed input is recorded: the others come from the campaign.
    let measured =
        OUTPUTS.into_iter().filter(|channel| *channel != Channel::P3 && rig.channels.contains(channel));
    let recording = Recording {
        series: measured.map(series).chain(driven(&t_s)).collect(),
        steps,
        ..Recording::default()
    };
    let table = Table::new(&recording)?;
    Some(Study::with_actuators(&recording, table, rig.declared, rig.model, rig.effects, rig.actuators))
}

/// A study of a simulated experiment: the settled start, then the step. Effects that began in the recording act.
fn simulated_experiment(recorded: &Study, experiment: &Experiment, interval_s: f64) -> Option<Study> {
    let jump = &experiment.jump;
    let dwell_s = jump.dwell_s.clamp(MIN_DWELL_S, SETTLED_HOUSINGS_S);
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
        marker(0, 0.0, SETTLING_S, jump.from_p3_pa, jump.from),
        marker(1, SETTLING_S, SETTLING_S + dwell_s, jump.to_p3_pa, jump.to),
    ];
    let added = if let AlsoChanged::Sensor(channel) = experiment.also { Some(channel) } else { None };
    let rig = SimulatedRig {
        declared: recorded.declared.clone(),
        model: recorded.nominal.model.clone(),
        effects: recorded.effects.clone(),
        channels: recorded.table.columns.keys().copied().chain(added).collect(),
        actuators: recorded.actuators,
    };
    let driven = |t_s: &[f64]| experiment.driven(t_s, SETTLING_S);
    let mut study = simulated_steps(rig, steps, &jump.from, interval_s, driven)?;
    study.catalogue = recorded.catalogue;
    study.nuisances.clone_from(&recorded.nuisances);
    Some(study)
}

/// The hypothesis of a fit with an unknown initial state.
fn with_unknown_start(study: &Study, fit: &Fit) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    for (nuisance, sigmas) in study.nuisances.iter().zip(&mut hypothesis.nuisances) {
        if nuisance.kind.is_start() {
            *sigmas = 0.0;
        }
    }
    hypothesis
}

/// Separation of the predictions of each two candidates before a refit, in squared sigmas of the noise; `None` if the model cannot run the step.
pub(crate) fn approximate_separation(
    recorded: &Study,
    experiment: &Experiment,
    fits: &[&Fit],
) -> Option<Vec<Vec<f64>>> {
    if let AlsoChanged::Soak(soak) = experiment.also {
        return apart_at_rest(recorded, &soak, fits);
    }
    let study = simulated_experiment(recorded, experiment, BLOCK_S)?;
    let linearised = Linearised::of_noise_alone(&study).ok()?;
    let predictions = fits
        .iter()
        .map(|fit| {
            let mut values = study.predict(&with_unknown_start(&study, fit)).ok()?.values;
            linearised.whiten(&study, &mut values);
            Some(values)
        })
        .collect::<Option<Vec<Vec<f64>>>>()?;
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    Some(predictions.iter().map(|a| predictions.iter().map(|b| distance(a, b)).collect()).collect())
}

/// Separation after a refit of each candidate to the experiment: entry `k`, `j` is the misfit increase of `j` if `k` is true, squared sigmas.
///
/// It is `D'D - D'J (L + J'J)^-1 J'D`, whitened, with the difference `D` of the predictions, the derivatives `J` of the prediction of `j` with respect to
/// its nuisances and parameters, and their precision `L` from the recording.
pub(crate) fn separation(recorded: &Study, experiment: &Experiment, fits: &[&Fit]) -> Option<Vec<Vec<f64>>> {
    if let AlsoChanged::Soak(soak) = experiment.also {
        return apart_at_rest(recorded, &soak, fits);
    }
    let study = simulated_experiment(recorded, experiment, SAMPLE_INTERVAL_S)?;
    let nominal = Linearised::new(&study).ok()?;
    let mut predicted = Vec::new();
    for fit in fits {
        let hypothesis = with_unknown_start(&study, fit);
        let here = nominal.at(&study, &hypothesis).ok()?;
        let mut values = here.base.values.clone();
        nominal.whiten(&study, &mut values);
        let coordinates = coordinates(&study.effects, &hypothesis);
        let mut columns = here.columns.clone();
        columns.extend(effect_changes(&study, &nominal, &hypothesis, &here.base, &coordinates, FINE));
        predicted.push((values, columns, precision(&study, fit)));
    }
    misfit_increases(&predicted)
}

/// Precision of a fit from the recording, without its initial state.
fn precision(study: &Study, fit: &Fit) -> DMatrix<f64> {
    let mut precision = fit.precision.clone();
    for (index, nuisance) in study.nuisances.iter().enumerate() {
        if nuisance.kind.is_start() {
            precision.row_mut(index).fill(0.0);
            precision.column_mut(index).fill(0.0);
            precision[(index, index)] = 1.0;
        }
    }
    precision
}

/// The recorded jumps, used if no others are declared as allowed.
pub(crate) fn recorded_jumps(study: &Study, points: &[OperatingPoint]) -> Vec<AllowedJump> {
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
pub(crate) fn recorded_points(study: &Study, hypothesis: &Hypothesis) -> Vec<OperatingPoint> {
    let points = study.points(hypothesis).unwrap_or_default();
    let steps = study.steps.iter().zip(points);
    steps
        .map(|(step, point)| OperatingPoint {
            speed_rpm: point.speed_rpm,
            valve_opening_ratio: step.marker.valve_opening_ratio,
        })
        .collect()
}

/// Misfit increase of each fit (column) after refitting to a soak, if another fit (row) were true, in squared sigmas.
pub(crate) fn apart_at_rest(recorded: &Study, soak: &AtRest, fits: &[&Fit]) -> Option<Vec<Vec<f64>>> {
    let sensors: Vec<(Channel, f64)> = AtRest::CHANNELS
        .into_iter()
        .zip(soak.left_sigma_k)
        .filter(|(channel, _)| recorded.table.column(*channel).is_some())
        .collect();
    if sensors.len() < 2 {
        return None;
    }
    let predicted = fits
        .iter()
        .map(|fit| {
            let here = offsets(recorded, &sensors, &fit.hypothesis)?;
            let mut columns = changes(recorded, &sensors, &fit.hypothesis, &here)?;
            columns.push(sensors.iter().map(|(_, sigma)| 1.0 / sigma).collect());
            let known = fit.precision.nrows();
            let mut precision = DMatrix::zeros(columns.len(), columns.len());
            precision.view_mut((0, 0), (known, known)).copy_from(&fit.precision);
            // The common temperature of all sensors is unknown.
            precision[(known, known)] = UNINFORMATIVE.powi(-2);
            Some((here, columns, precision))
        })
        .collect::<Option<Vec<_>>>()?;
    misfit_increases(&predicted)
}

/// Offsets of the sensors, in units of their remaining uncertainty.
fn offsets(study: &Study, sensors: &[(Channel, f64)], hypothesis: &Hypothesis) -> Option<Vec<f64>> {
    sensors.iter().map(|(channel, sigma)| Some(study.offset_at_end(hypothesis, *channel)? / sigma)).collect()
}

/// Changes of these offsets for one sigma of each nuisance and for a unit of each effect coordinate.
fn changes(
    study: &Study,
    sensors: &[(Channel, f64)],
    hypothesis: &Hypothesis,
    here: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let coordinates = coordinates(&study.effects, hypothesis);
    nuisance_neighbours(hypothesis, FINE)
        .chain(effect_neighbours(hypothesis, &coordinates, FINE))
        .map(|(moved, step)| {
            let there = offsets(study, sensors, &moved)?;
            Some(there.iter().zip(here).map(|(there, here)| (there - here) / step).collect())
        })
        .collect()
}
