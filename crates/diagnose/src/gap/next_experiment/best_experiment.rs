//! Next step: the experiments that best distinguish the remaining candidates, or the sensor that would.

use crate::gap::best_fit::fit::Fit;
use crate::gap::findings::experiment::{AllowedJump, AlsoChanged, Experiment};
use crate::gap::findings::report::{JumpPoint, Kind, MAX_EQUIVALENT, MAX_REFITTED, Next, Place, Suggestion};
use crate::gap::next_experiment::odds::{Odds, entropy_bit, odds};
use crate::gap::next_experiment::outlook::{
    SETTLED_HOUSINGS_S, approximate_separation, recorded_jumps, recorded_points, separation,
};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::Study;
use mapper_core::unit_factors::{ICE_POINT_K, PERCENT, RPM_PER_KRPM, S_PER_MIN};
use mapper_core::{Channel, OperatingPoint};
use mapper_inference::interval::COVERAGE;
use mapper_numerics::parallel;
use mapper_physics::rig::effect::Submodel;

/// Thousandths in 1, the decimals of a script. Source: a definition.
const THOUSANDTHS: f64 = 1e3;

/// Share of the open probability above which the first cause is settled.
pub(crate) const SETTLED: f64 = COVERAGE;

/// Open candidates, best first, with their probabilities.
pub(crate) struct Rivals<'a> {
    /// At least two fits; the first is the best.
    pub fits: Vec<&'a Fit>,
    /// One probability per fit.
    pub probabilities: Vec<f64>,
}

/// Suggested next step and the alternatives.
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

/// A sensor that measures a part directly.
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
