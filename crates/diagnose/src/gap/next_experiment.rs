//! The next experiment: the outlook of each candidate, and the best of them.

use crate::gap::best_fit::coordinate::{coordinates, effect_neighbours, nuisance_neighbours};
use crate::gap::best_fit::fit::{Fit, effect_changes};
use crate::gap::best_fit::normal::misfit_increases;
use crate::gap::experiment::{AllowedJump, AlsoChanged, AtRest, Experiment};
use crate::gap::report::{JumpPoint, Kind, MAX_EQUIVALENT, MAX_REFITTED, Next, Place, Suggestion};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::true_inputs::{Actuators, SETTLING_S};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::unit_factors::{ICE_POINT_K, PERCENT, RPM_PER_KRPM, S_PER_MIN};
use mapper_core::{Channel, OperatingPoint, Recording, SAMPLE_INTERVAL_S, Series, StepKind, StepMarker};
use mapper_identify::BLOCK_S;
use mapper_inference::mixture::normal_points;
use mapper_inference::posterior::COVERAGE;
use mapper_numerics::least_squares::FINE;
use mapper_numerics::parallel;
use mapper_observe::averages::Table;
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Effect, Submodel};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use nalgebra::{DMatrix, SymmetricEigen};
use std::sync::Arc;

/// Duration of the first step of a script, and maximum simulated time at a target, s. Bound: housings settle within minutes.
pub(crate) const SETTLED_HOUSINGS_S: f64 = 300.0;
/// Minimum simulated time at a target, s. Bound: the probe settles within it.
const MIN_DWELL_S: f64 = 10.0;

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

/// A study of simulated steps with inputs alone, settled at `rest`; `driven` is an input that departs from the campaign's value.
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

/// Thousandths in 1, the decimals of a script. Source: a definition.
const THOUSANDTHS: f64 = 1e3;

/// Share of the open probability above which the first cause is settled.
pub(crate) const SETTLED: f64 = COVERAGE;

pub(crate) struct Rivals<'a> {
    /// At least two fits; the first is the best.
    pub fits: Vec<&'a Fit>,
    /// One probability per fit.
    pub probabilities: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Suggested {
    /// The first of `experiments`, or a sensor that the model does not include; `None` if no experiment helps.
    pub next: Option<Next>,
    /// Possible experiments, best first.
    pub experiments: Vec<Suggestion>,
}

/// Ranks experiments by how well they distinguish the rivals per minute.
///
/// A first pass scores every `allowed` experiment with the fitted candidates: `U = sum over k, j of p_k p_j d_kj^2 / minutes`. Here
/// `d_kj^2` is the misfit increase of a refitted `j` if `k` were true. The most promising of each kind are evaluated with every rival
/// refitted, and ranked by the expected share of the open question resolved per minute. Without allowed jumps, repeats of the
/// recorded jumps are used. Unrecorded model channels are tried with the most promising jump. If no experiment resolves enough, the
/// function names a sensor for the first candidate's part. `temperature` is the diagnosis'.
pub(crate) fn next(
    study: &Study,
    mut rivals: Rivals<'_>,
    allowed: &[Experiment],
    temperature: f64,
) -> Suggested {
    rivals.fits.truncate(1 + MAX_EQUIVALENT);
    rivals.probabilities.truncate(1 + MAX_EQUIVALENT);
    let Some(first) = rivals.fits.first() else { return Suggested::default() };
    let mut all = allowed.to_vec();
    let jumps_known = all.iter().any(|experiment| Kind::of(experiment) == Kind::Jump);
    if !jumps_known {
        let recorded = recorded_jumps(study, &recorded_points(study, &first.hypothesis));
        all.extend(recorded.into_iter().map(Experiment::jump));
    }
    let rate = |experiment: &Experiment, separation: &[Vec<f64>]| {
        gain(&rivals.probabilities, separation) / experiment.minutes()
    };
    let looks = parallel::map(&all, |experiment| {
        let separation = approximate_separation(study, experiment, &rivals.fits)?;
        Some((rate(experiment, &separation), *experiment))
    });
    let mut looks: Vec<(f64, Experiment)> = looks.into_iter().flatten().collect();
    looks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut close: Vec<Experiment> = Vec::new();
    for kind in Kind::ALL {
        let most = if kind == Kind::Jump { MAX_REFITTED } else { MAX_EQUIVALENT };
        let of_kind = looks.iter().map(|(_, experiment)| *experiment).filter(|e| Kind::of(e) == kind);
        close.extend(of_kind.take(most));
    }
    if let Some(jump) = close.first().filter(|experiment| experiment.also == AlsoChanged::Nothing) {
        let missing = OUTPUTS.into_iter().filter(|c| *c != Channel::P3 && study.table.column(*c).is_none());
        let jump = jump.jump;
        close.extend(missing.map(|channel| Experiment { jump, also: AlsoChanged::Sensor(channel) }));
    }
    let looked = parallel::map(&close, |experiment| {
        let separation = separation(study, experiment, &rivals.fits)?;
        let odds = odds(&rivals.probabilities, &separation, temperature, SETTLED);
        Some((*experiment, odds, rate(experiment, &separation)))
    });
    let mut looked: Vec<(Experiment, Odds, f64)> = looked.into_iter().flatten().collect();
    // Share resolved per minute; if several experiments resolve everything, the simplest comes first.
    let of_minute =
        |(experiment, odds, _): &(Experiment, Odds, f64)| odds.entropy_drop_bit / experiment.minutes();
    looked.sort_by(|a, b| of_minute(b).total_cmp(&of_minute(a)).then(b.2.total_cmp(&a.2)));
    let open_bit = entropy_bit(&rivals.probabilities);
    let answers = |odds: &Odds| odds.entropy_drop_bit / open_bit.max(f64::MIN_POSITIVE);
    let most = looked.iter().map(|(_, odds, _)| answers(odds)).fold(0.0, f64::max);
    // What resolves less settles nothing.
    looked.retain(|(_, odds, _)| answers(odds) >= 1.0 - SETTLED);
    let mut experiments: Vec<Suggestion> = Vec::new();
    for (experiment, odds, _) in &looked {
        let kind = Kind::of(experiment);
        let of_kind = experiments.iter().filter(|other| other.kind == kind).count();
        if experiments.len() < MAX_REFITTED && of_kind < MAX_EQUIVALENT {
            experiments.push(suggestion(kind, experiment, odds, open_bit));
        }
    }
    let next = experiments.first().map(Suggestion::as_next).or_else(|| {
        let (effect, _) = rivals.fits.iter().find_map(|fit| fit.hypothesis.effects.first())?;
        let among = if jumps_known { "allowed" } else { "recorded" };
        Some(Next::Sensor {
            sensor: sensor_for(study.effects[*effect].info().submodel).to_owned(),
            reason: format!(
                "none of the {} {among} steps resolves more than {:.0} % of the open question between the first candidates",
                all.len(),
                PERCENT * most
            ),
        })
    });
    Suggested { next, experiments }
}

fn suggestion(kind: Kind, experiment: &Experiment, odds: &Odds, open_bit: f64) -> Suggestion {
    let (from, to) = (experiment.jump.from, experiment.jump.to);
    let (t3_k, oil_temperature_k, sensor) = match experiment.also {
        AlsoChanged::T3 { from_k, to_k } => (Some([from_k, to_k]), None, None),
        AlsoChanged::Oil { from_k, to_k } => (None, Some([from_k, to_k]), None),
        AlsoChanged::Sensor(channel) => (None, None, Some(channel.symbol().to_owned())),
        AlsoChanged::Nothing | AlsoChanged::Soak(_) => (None, None, None),
    };
    Suggestion {
        kind,
        from: point(from),
        to: point(to),
        t3_k,
        oil_temperature_k,
        sensor,
        minutes: experiment.minutes(),
        probability_settled: odds.settles,
        expected_probability: odds.share,
        entropy_drop_bit: odds.entropy_drop_bit,
        entropy_bit: open_bit,
        script: script(experiment),
    }
}

/// Sequence lines that run a step, or campaign lines that begin with a soak.
fn script(experiment: &Experiment) -> Vec<String> {
    let place = |point: OperatingPoint| {
        format!(
            "point(\"{} krpm\", {})",
            round(point.speed_rpm / RPM_PER_KRPM),
            round(point.valve_opening_ratio)
        )
    };
    let celsius = |k: f64| round(k - ICE_POINT_K);
    let AllowedJump { from, to, dwell_s, .. } = experiment.jump;
    let change = match experiment.also {
        AlsoChanged::Nothing | AlsoChanged::Sensor(_) => None,
        AlsoChanged::Soak(soak) => {
            return vec![format!("zero: {{soak: {} min}}", round(soak.duration_s / S_PER_MIN))];
        }
        AlsoChanged::T3 { to_k, .. } => Some(format!("t3(\"{} degC\");", celsius(to_k))),
        AlsoChanged::Oil { to_k, .. } => Some(format!("oil(\"{} degC\");", celsius(to_k))),
    };
    let go = [format!("jump({}, \"{} s\");", place(to), round(dwell_s))];
    let start = [format!("jump({}, \"{SETTLED_HOUSINGS_S} s\");", place(from))];
    start.into_iter().chain(change).chain(go).collect()
}

/// Rounds to three decimals and removes floating-point residue.
fn round(value: f64) -> f64 {
    (THOUSANDTHS * value).round() / THOUSANDTHS
}

/// Suggestion for a gap outside the effect library: a suspected effect, or a sensor for the part with most of the gap.
pub(crate) fn sensor_near(places: &[Place]) -> Next {
    let place = places.first();
    let part = place.and_then(|place| Submodel::ALL.into_iter().find(|part| part.name() == place.submodel));
    let (sensor, lies) = match part {
        Some(part) => (sensor_for(part), format!("most of the gap lies in {}", part.name())),
        None => {
            ("a second thermocouple in the compressor housing, near the gas", "no part dominates".to_owned())
        }
    };
    Next::Sensor {
        sensor: sensor.to_owned(),
        reason: format!(
            "no effect of the library explains the whole gap, and {lies}: write a suspected effect in rhai and give it with --effect, or add this sensor"
        ),
    }
}

fn point(point: OperatingPoint) -> JumpPoint {
    JumpPoint { speed_rpm: point.speed_rpm, valve: point.valve_opening_ratio }
}

/// `sum p_k p_j d_kj^2`.
fn gain(probabilities: &[f64], separation: &[Vec<f64>]) -> f64 {
    let row = |(p, row): (&f64, &Vec<f64>)| -> f64 {
        row.iter().zip(probabilities).map(|(d2, q)| p * q * d2).sum::<f64>()
    };
    probabilities.iter().zip(separation).map(row).sum()
}

fn sensor_for(part: Submodel) -> &'static str {
    match part {
        Submodel::Actuator | Submodel::TurbineFlow => "a second, fast pressure sensor at the turbine inlet",
        Submodel::Shaft => "oil outlet temperature and oil flow, for the bearings' power",
        Submodel::CompressorFlow | Submodel::FlowMeter => "a second flow meter in the compressor's line",
        Submodel::P1Sensor => "a second pressure sensor at the compressor inlet",
        Submodel::P3Sensor => "a second pressure sensor at the turbine inlet",
        Submodel::T3Probe => "a rake of probes at the turbine inlet",
        Submodel::P4Sensor => "a second pressure sensor at the turbine outlet",
        Submodel::OilProbe => "a second probe in the oil supply",
        Submodel::SpeedSensor => "a second speed sensor",
        Submodel::Outlet | Submodel::P2Sensor => "a second pressure sensor at the compressor outlet",
        Submodel::CompressorGas => "a gas temperature probe between the wheel and the volute",
        Submodel::T1Probe => "a second probe at the compressor inlet",
        Submodel::T2Probe => "a second T2 probe of another diameter",
        Submodel::TcProbe | Submodel::CompressorHousing => {
            "a second thermocouple in the compressor housing, near the gas"
        }
        Submodel::TurbineHousing => "thermocouples on both sides of the bearing housing",
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Odds {
    /// Probability that the true cause reaches the requested share of the open causes' probability.
    pub settles: f64,
    /// Expected share of the true cause afterwards.
    pub share: f64,
    /// Expected reduction of the entropy of the open causes, bit, >= 0.
    pub entropy_drop_bit: f64,
}

/// Forecast for causes of `probabilities` (any sum above 0), `separation` in squared sigmas (row: true, column: rival; the smaller direction of
/// a pair counts). `temperature` divides log evidence, as in the diagnosis; `settled` is the requested share.
pub(crate) fn odds(probabilities: &[f64], separation: &[Vec<f64>], temperature: f64, settled: f64) -> Odds {
    let total: f64 = probabilities.iter().sum();
    let p: Vec<f64> = probabilities.iter().map(|p| p / total.max(f64::MIN_POSITIVE)).collect();
    let places = places(separation);
    let noise = normal_points(places.len());
    let (mut settles, mut share, mut left_bit) = (0.0, 0.0, 0.0);
    // Equal numbers of draws per cause, weighted, so that small probabilities are sampled too.
    for (truth, of_truth) in p.iter().enumerate() {
        let weight = of_truth / noise.len() as f64;
        for noise in &noise {
            let reading: Vec<f64> = places[truth].iter().zip(noise).map(|(x, noise)| x + noise).collect();
            let after = after(&p, &places, &reading, temperature);
            settles += if after[truth] >= settled { weight } else { 0.0 };
            share += weight * after[truth];
            left_bit += weight * entropy_bit(&after);
        }
    }
    // Rounding may push the sums slightly above 1.
    let (settles, share) = (settles.min(1.0), share.min(1.0));
    Odds { settles, share, entropy_drop_bit: (entropy_bit(&p) - left_bit).max(0.0) }
}

fn after(p: &[f64], places: &[Vec<f64>], reading: &[f64], temperature: f64) -> Vec<f64> {
    let d2 = |place: &Vec<f64>| place.iter().zip(reading).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let d2: Vec<f64> = places.iter().map(d2).collect();
    let nearest = d2.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> =
        p.iter().zip(&d2).map(|(p, d2)| p * (-0.5 * (d2 - nearest) / temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / total.max(f64::MIN_POSITIVE)).collect()
}

/// Entropy of probabilities, scaled to a sum of 1, bit.
pub(crate) fn entropy_bit(probabilities: &[f64]) -> f64 {
    let total: f64 = probabilities.iter().sum();
    let shares = probabilities.iter().map(|p| p / total.max(f64::MIN_POSITIVE));
    -shares.filter(|p| *p > 0.0).map(|p| p * p.log2()).sum::<f64>()
}

/// Points with the given squared distances (Torgerson 1952); the non-Euclidean part of the distances is dropped.
fn places(separation: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = separation.len();
    let d2 = DMatrix::from_fn(n, n, |i, j| if i == j { 0.0 } else { separation[i][j].min(separation[j][i]) });
    // Scalar products of the points relative to the first.
    let products = DMatrix::from_fn(n, n, |i, j| 0.5 * (d2[(0, i)] + d2[(0, j)] - d2[(i, j)]));
    let eigen = SymmetricEigen::new(products);
    (0..n)
        .map(|i| (0..n).map(|k| eigen.eigenvectors[(i, k)] * eigen.eigenvalues[k].max(0.0).sqrt()).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLED: f64 = 0.95;

    fn even(n: usize, d2: f64) -> Vec<Vec<f64>> {
        (0..n).map(|k| (0..n).map(|j| if k == j { 0.0 } else { d2 }).collect()).collect()
    }

    /// Normal distribution function, by Simpson's rule.
    fn below(x: f64) -> f64 {
        let (a, n) = (-9.0, 2000);
        let h = (x.clamp(-9.0, 9.0) - a) / f64::from(n);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let weight = |i: i32| if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
        (0..=n).map(|i| weight(i) * density(a + h * f64::from(i))).sum::<f64>() * h / 3.0
    }

    #[test]
    fn what_shows_nothing_settles_nothing_and_what_shows_all_settles_all() {
        let p = [0.6, 0.3, 0.1];
        let nothing = odds(&p, &even(3, 0.0), 1.0, SETTLED);
        // Without information the true cause keeps its own probability: sum of p^2.
        assert!((nothing.share - 0.46).abs() < 1e-12 && nothing.settles == 0.0);
        assert!(nothing.entropy_drop_bit < 1e-12);
        let all = odds(&p, &even(3, 200.0), 1.0, SETTLED);
        assert!(all.settles > 1.0 - 1e-9 && (all.entropy_drop_bit - entropy_bit(&p)).abs() < 1e-6);
        // Measured in bits, a question can be resolved partially.
        let some = odds(&p, &even(3, 4.0), 1.0, SETTLED);
        assert!(some.settles > 0.0 && some.settles < all.settles && some.share > 0.46);
    }

    /// Two causes: `P = sum p_k Phi((d^2/2 + logit p_k - logit 0.95) / d)`, and the mean log odds by Simpson's rule.
    #[test]
    fn draws_agree_with_the_closed_form_of_two_causes() {
        let logit = |p: f64| (p / (1.0 - p)).ln();
        for (p, d2) in [(0.5, 9.0), (0.8, 2.0), (0.3, 25.0), (0.9, 0.3)] {
            let d = f64::sqrt(d2);
            let settles: f64 =
                [p, 1.0 - p].iter().map(|p| p * below((0.5 * d2 + logit(*p) - logit(SETTLED)) / d)).sum();
            let drawn = odds(&[p, 1.0 - p], &even(2, d2), 1.0, SETTLED);
            // Halton's points miss a step by a few of 128.
            assert!((drawn.settles - settles).abs() < 0.03, "{p} {d2}: {} {settles}", drawn.settles);
            // Remaining entropy, integrated over the log odds.
            let left: f64 = [p, 1.0 - p]
                .iter()
                .map(|p| {
                    let h = 0.01;
                    (-800..=800)
                        .map(|i| {
                            let z = h * f64::from(i);
                            let after = 1.0 / (1.0 + (-(logit(*p) + 0.5 * d2 + d * z)).exp());
                            let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
                            p * h * density * entropy_bit(&[after, 1.0 - after])
                        })
                        .sum::<f64>()
                })
                .sum();
            let drop = entropy_bit(&[p, 1.0 - p]) - left;
            assert!((drawn.entropy_drop_bit - drop).abs() < 0.02, "{p} {d2}: {drawn:?} {drop}");
        }
    }

    /// The experiment separates one of three causes from the other two, but not these two from each other.
    #[test]
    fn a_pair_that_looks_alike_stays_open() {
        let separation = vec![vec![0.0, 0.0, 400.0], vec![0.0, 0.0, 400.0], vec![400.0, 400.0, 0.0]];
        let odds = odds(&[0.4, 0.4, 0.2], &separation, 1.0, SETTLED);
        assert!((odds.settles - 0.2).abs() < 1e-9, "{odds:?}");
        // One bit remains in four of five cases.
        assert!((odds.entropy_drop_bit - (entropy_bit(&[0.4, 0.4, 0.2]) - 0.8)).abs() < 1e-6);
    }
}
