//! Requirements on every effect, alone and with others.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{CHANNELS, Channel};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{self, Effect, EffectError, Rig};
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{Simulator, Watch};
use mapper_physics::simulation::steady;
use proptest::prelude::*;
use std::sync::Arc;

/// The nominal machine with some area before the wheel: without it, effects there would not show.
fn nominal() -> Rig {
    let mut model = Model::nominal();
    model.params.compressor.alpha_area_ratio = 0.1;
    Rig::new(model)
}

/// 110 -> 70 krpm, P3 behind its command; the valve closes from 0.9 to 0.7 at the start: all readings every second for a minute.
fn readings(rig: &Rig) -> Vec<f64> {
    let at = |speed_rpm: f64| {
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
        steady::hold_speed(&Model::nominal(), speed_rpm, &boundary).unwrap().boundary
    };
    let (from, to) = (at(110e3), at(70e3));
    let start = steady::settle_under(&rig.model, &from).unwrap().state;
    // The actuator as a table that resolves its lag.
    let times: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.05).collect();
    let p3_pa = |t_s: f64| {
        to.p3_pa
            + (from.p3_pa - to.p3_pa)
                * if t_s == 0.0 { 1.0 } else { (-t_s / rig.instruments.p3_lag_s.max(1e-9)).exp() }
    };
    let valve = rig.instruments.valve;
    let opening = |t_s: f64| {
        let left = if valve.lag_s > 0.0 { 0.2 * (-t_s / valve.lag_s).exp() } else { 0.0 };
        valve.reached(to.valve_opening_ratio + 0.5 * valve.play_ratio + left)
    };
    let row = |t_s: &f64| BoundaryConditions { p3_pa: p3_pa(*t_s), valve_opening_ratio: opening(*t_s), ..to };
    let rows = times.iter().map(row).collect();
    let inputs = mapper_physics::simulation::steady::InterpolatedInputs::new(times, rows).unwrap();
    let measured: Vec<Channel> = CHANNELS[..15].iter().map(|row| row.channel).collect();
    let mut followers: Vec<ChannelFollower> =
        measured.iter().map(|channel| ChannelFollower::new(*rig.instruments.path(*channel))).collect();
    let mut simulator = Simulator::new(&rig.model, 0.0, start, 1e-9, Watch::default());
    let mut readings = Vec::new();
    simulator
        .run_to(
            60.0,
            &inputs,
            (0..=60).map(f64::from),
            |t_s, state, outputs| {
                use mapper_physics::simulation::steady::Inputs;
                let boundary = inputs.at(t_s);
                let prepared = rig.model.prepare(&boundary);
                for (channel, follower) in measured.iter().zip(&mut followers) {
                    let value = rig.instruments.at_sensor(*channel, &prepared, state, outputs).unwrap();
                    readings.push(follower.read(t_s, value));
                }
            },
            |_| {},
        )
        .unwrap();
    readings
}

fn neutral(effect: &dyn Effect) -> Vec<f64> {
    effect.info().parameters.iter().map(|parameter| parameter.neutral).collect()
}

fn stepped(effect: &dyn Effect, share: f64) -> Vec<f64> {
    effect
        .info()
        .parameters
        .iter()
        .map(|parameter| parameter.neutral + share * parameter.typical_step)
        .collect()
}

fn with(effects: &[(&Arc<dyn Effect>, Vec<f64>)]) -> Rig {
    let mut rig = nominal();
    for (effect, values) in effects {
        effect::add(&mut rig, effect.as_ref(), values).unwrap();
    }
    rig
}

/// Largest difference over all readings, relative to each reading.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max)
}

#[test]
fn ids_are_unique_and_every_entry_is_whole() {
    let catalogue = mapper_effects::catalogue();
    assert!(catalogue.len() >= 20);
    for effect in &catalogue {
        let info = effect.info();
        assert_eq!(catalogue.iter().filter(|other| other.info().id == info.id).count(), 1);
        assert!(info.id.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'));
        assert!(!info.description.is_empty() && !info.equation.is_empty() && !info.source.is_empty());
        assert!(info.shows_in(info.submodel.name()) && !info.also_shows_in.contains(&info.submodel));
        for parameter in &info.parameters {
            let stepped = parameter.neutral + parameter.typical_step;
            assert!((parameter.low..=parameter.high).contains(&parameter.neutral), "{}", info.id);
            assert!((parameter.low..=parameter.high).contains(&stepped) && parameter.typical_step != 0.0);
        }
        assert!(mapper_effects::find(&info.id).is_some());
    }
}

#[test]
fn at_neutral_nothing_changes_and_away_from_it_something_does() {
    let without = readings(&nominal());
    for effect in mapper_effects::catalogue() {
        let id = &effect.info().id;
        // To the bit: effects only multiply by 1 or add 0.
        assert_eq!(readings(&with(&[(&effect, neutral(effect.as_ref()))])), without, "{id}");
        // A sensor cannot detect a change of a ten thousandth.
        let change = apart(&readings(&with(&[(&effect, stepped(effect.as_ref(), 1.0))])), &without);
        assert!(change > 1e-4, "{id} moves readings by {change:e} only");
    }
}

/// Diagnosis uses finite differences around neutral: half the step must give half the change.
#[test]
fn changes_are_smooth_in_every_parameter_around_neutral() {
    let without = readings(&nominal());
    // Readings every second do not show a valve that lags by milliseconds.
    let is_smooth =
        |effect: &&Arc<dyn Effect>| !["inner_node", "slow_valve"].contains(&effect.info().id.as_ref());
    for effect in mapper_effects::catalogue().iter().filter(is_smooth) {
        let change = |share: f64| {
            let values = readings(&with(&[(effect, stepped(effect.as_ref(), share))]));
            let differences: Vec<f64> = values.iter().zip(&without).map(|(a, b)| (a - b) / b).collect();
            differences.iter().map(|difference| difference * difference).sum::<f64>().sqrt()
        };
        let ratio = change(0.01) / change(0.005);
        // At one percent of a typical step, the error of the next order has that size. The probe's time constant goes with
        // d^2 over a Nusselt number of 2 and a part with sqrt(d): its order lies between 1.5 and 2.
        let right = if effect.info().id == "tip_diameter" { 2.8..4.0 } else { 1.9..2.1 };
        assert!(right.contains(&ratio), "{}: {ratio}", effect.info().id);
    }
}

#[test]
fn all_at_once_make_a_machine_that_runs() {
    let catalogue = mapper_effects::catalogue();
    let all: Vec<_> = catalogue.iter().map(|effect| (effect, stepped(effect.as_ref(), 0.3))).collect();
    assert!(readings(&with(&all)).iter().all(|reading| reading.is_finite()));
}

#[test]
fn values_that_mean_nothing_are_refused_and_leave_the_rig_alone() {
    let area_split = mapper_effects::find("area_split").unwrap();
    let mut rig = nominal();
    for (values, expected) in [
        (vec![], "0 values"),
        (vec![0.1, 0.2], "2 values"),
        (vec![-0.1], "not between 0 and 0.6"),
        (vec![f64::NAN], "NaN"),
    ] {
        let error: EffectError = effect::add(&mut rig, area_split.as_ref(), &values).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert_eq!(rig.model.params, nominal().model.params);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// The order of two effects does not matter.
    #[test]
    fn two_effects_commute(first in any::<prop::sample::Index>(), second in any::<prop::sample::Index>()) {
        let catalogue = mapper_effects::catalogue();
        let (a, b) = (first.get(&catalogue), second.get(&catalogue));
        prop_assume!(a.info().id != b.info().id);
        let values = |effect: &Arc<dyn Effect>| stepped(effect.as_ref(), 0.5);
        let one = with(&[(a, values(a)), (b, values(b))]);
        let other = with(&[(b, values(b)), (a, values(a))]);
        // Except for rounding of a product.
        prop_assert!(apart(&readings(&one), &readings(&other)) < 1e-9);
    }
}

/// Reading over true value.
type Equation = fn(f64) -> f64;

/// Each fault of a sensor changes its own reading by its equation, and no other.
#[test]
fn a_fault_of_a_sensor_changes_its_reading_alone() {
    let without = readings(&nominal());
    let of = |channel: Channel| CHANNELS[..15].iter().position(|row| row.channel == channel).unwrap();
    let cases: [(&str, f64, Channel, Equation); 8] = [
        ("p1_offset", 300.0, Channel::P1, |x| x + 300.0),
        ("turbine_flow_gain", 1.02, Channel::TurbineFlow, |x| 1.02 * x),
        // At an opening of 0.7.
        ("t1_with_valve", 2.0, Channel::T1, |x| x + 1.4),
        ("t1_offset", 0.8, Channel::T1, |x| x + 0.8),
        ("t2_offset", -1.5, Channel::T2, |x| x - 1.5),
        ("tc_offset", 2.0, Channel::Tc, |x| x + 2.0),
        ("p2_offset", -700.0, Channel::P2, |x| x - 700.0),
        ("flowmeter_gain", 1.03, Channel::CompressorFlow, |x| 1.03 * x),
    ];
    for (id, value, channel, equation) in cases {
        let faulty = readings(&with(&[(&mapper_effects::find(id).unwrap(), vec![value])]));
        for (i, (read, before)) in faulty.iter().zip(&without).enumerate() {
            let expected = if i % 15 == of(channel) { equation(*before) } else { *before };
            assert!((read - expected).abs() <= 1e-12 * expected.abs(), "{id}, reading {i}: {read}");
        }
    }
}

/// A probe that conducts along its stem reads its share of the way to the housing; a flow meter with a lag reads a rising flow late.
#[test]
fn a_stem_and_a_lag_follow_their_equations() {
    let stem = mapper_effects::find("stem_conduction").unwrap();
    let rig = with(&[(&stem, vec![0.1])]);
    let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..Default::default() };
    let at = steady::hold_speed(&rig.model, 110e3, &boundary).unwrap();
    let outputs = rig.model.prepare(&at.boundary).evaluate(&at.state);
    assert!((outputs.t2_probe_k - (0.9 * outputs.t2_k + 0.1 * at.state.tc_k)).abs() < 1e-9);
    let lag = mapper_effects::find("flowmeter_lag").unwrap();
    let rig = with(&[(&lag, vec![2.0])]);
    let mut meter = ChannelFollower::new(*rig.instruments.path(Channel::CompressorFlow));
    let readings = (0..600).map(|i| meter.read(f64::from(i) * 0.1, f64::from(i) * 1e-4));
    assert!((readings.last().unwrap() - (599e-4 - 2e-3)).abs() < 1e-12);
}
