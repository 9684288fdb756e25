//! The isothermal zero: offsets from a soak, and their remaining effect on the points.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::lab::{Machine, campaign, eighteen, measured};
use mapper_core::{Channel, DeclaredUncertainty, Event, EventKind, Method, Recording, Series, Verdict};
use mapper_identify::{
    IdentifyConfig, NoZero, NotZeroed, Suspect, ZeroSettings, expected_after_zero, identify,
    identify_recording, isothermal_zero, zeroed,
};
use mapper_physics::rig::sensor_fault::ExactReadings;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Puts a soak of `soak_s` at 298.15 K and 100 kPa before a campaign.
fn with_soak(recording: &Recording, soak_s: f64) -> Recording {
    let mut soaked = Recording::default();
    let count = (soak_s * 10.0) as u32;
    for (channel, series) in &recording.series {
        let rest = match channel {
            Channel::T1 | Channel::T2 | Channel::Tc => 298.15,
            Channel::P1 | Channel::P2 => 100e3,
            _ => 0.0,
        };
        let t_s =
            (0..count).map(|i| f64::from(i) * 0.1).chain(series.t_s.iter().map(|t| t + soak_s)).collect();
        let values = std::iter::repeat_n(rest, count as usize).chain(series.values.iter().copied()).collect();
        soaked.series.insert(*channel, Series { t_s, values });
    }
    soaked.steps = recording.steps.clone();
    for step in &mut soaked.steps {
        step.start_s += soak_s;
        step.end_s += soak_s;
    }
    soaked
}

/// Offsets of 0.25 K zeroed to 0.05 K, noise 0.1 K: efficiency at 50 krpm within 1.2 points in 95 % of the campaigns.
#[test]
fn a_soak_brings_low_speed_within_reach() {
    let clean = campaign(&eighteen(), 120.0, Machine::default());
    let soaked = with_soak(&clean.recording, 1800.0);
    let (mut within, mut held, mut without, mut count) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..8 {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (recording, declared) = measured(&soaked, 1.0, 1.0, &mut rng);
        let config = IdentifyConfig { method: Method::Joint, declared, ..IdentifyConfig::default() };
        let plain = identify(&recording, &config).unwrap();
        let zero = isothermal_zero(&recording, &config, &ZeroSettings::default()).unwrap();
        let (recording, config) = zeroed(recording, config, &zero);
        let points = identify(&recording, &config).unwrap();
        for ((point, plain), truth) in points.iter().zip(&plain).zip(&clean.truth) {
            if truth.speed_rpm > 55e3 {
                continue;
            }
            let off = (point.eta.unwrap() - truth.eta).abs();
            within += f64::from(u8::from(off < 0.012));
            held += f64::from(u8::from(
                point.eta_low.unwrap() <= truth.eta && truth.eta <= point.eta_high.unwrap(),
            ));
            without += (plain.eta.unwrap() - truth.eta).powi(2);
            count += 1.0;
        }
    }
    // 24 points, three of one campaign alike: 95 % of eight campaigns allows for one outside.
    assert!(
        within / count >= 0.85 && held / count >= 0.85,
        "within {}, held {}",
        within / count,
        held / count
    );
    // Without the zero they have the error of 0.25 K offsets: 7.2, 5.7 and 3.2 points for each kelvin.
    assert!((without / count).sqrt() > 0.012);
}

/// A thermocouple that reads 5 % towards a cell of 25 degC is right at rest, so that its error counts from there.
#[test]
fn a_loose_thermocouple_on_the_housing_stays_within_the_intervals_after_a_zero() {
    let clean = campaign(&eighteen(), 120.0, Machine::default());
    let mut soaked = with_soak(&clean.recording, 1800.0);
    for tc_k in &mut soaked.series.get_mut(&Channel::Tc).unwrap().values {
        *tc_k -= 0.05 * (*tc_k - 298.15);
    }
    let (mut held, mut count) = (0.0, 0.0);
    for seed in 20..24 {
        let (recording, declared) = measured(&soaked, 1.0, 1.0, &mut Pcg64::seed_from_u64(seed));
        let config = IdentifyConfig {
            method: Method::Joint,
            declared,
            housing_contact_sigma_ratio: 0.03,
            ..IdentifyConfig::default()
        };
        let zero = isothermal_zero(&recording, &config, &ZeroSettings::default()).unwrap();
        let (recording, config) = zeroed(recording, config, &zero);
        for (point, truth) in identify(&recording, &config).unwrap().iter().zip(&clean.truth) {
            let (low, high) = (point.eta_low.unwrap(), point.eta_high.unwrap());
            held += f64::from(u8::from((low..=high).contains(&truth.eta)));
            count += 1.0;
        }
    }
    // The points of a recording share their errors: one recording of four may lie on one side.
    assert!(held / count >= 0.75, "{held} of {count}");
}

#[test]
fn what_is_no_soak_is_refused() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let config = IdentifyConfig::default();
    let zero = |recording: &Recording| isothermal_zero(recording, &config, &ZeroSettings::default());
    assert!(matches!(zero(&clean.recording), Err(NoZero::NoSoak { .. })));
    let mut drifting = with_soak(&clean.recording, 300.0);
    for value in drifting.series.get_mut(&Channel::Tc).unwrap().values.iter_mut().take(3000).enumerate() {
        *value.1 += 0.001 * value.0 as f64;
    }
    let without_tc = zero(&drifting).unwrap();
    assert!(!without_tc.offsets.contains_key(&Channel::Tc) && without_tc.offsets.contains_key(&Channel::T1));
    for channel in [Channel::T1, Channel::T2, Channel::P1, Channel::P2] {
        drifting.series.remove(&channel);
    }
    assert!(matches!(zero(&drifting), Err(NoZero::Drifts { channel: Channel::Tc, .. })));
    let mut broken = with_soak(&clean.recording, 300.0);
    broken.series.get_mut(&Channel::T2).unwrap().values.iter_mut().for_each(|value| *value += 4.0);
    assert!(matches!(zero(&broken), Err(NoZero::Uneven { .. })));
}

/// The same with the rest of [`with_soak`] behind the run.
fn with_rest_behind(recording: &Recording, soak_s: f64) -> Recording {
    let mut rested = with_soak(recording, soak_s);
    let first = (soak_s * 10.0) as usize;
    for series in rested.series.values_mut() {
        let interval_s = series.t_s[1] - series.t_s[0];
        series.values.rotate_left(first);
        series.t_s = (0..series.t_s.len()).map(|i| i as f64 * interval_s).collect();
    }
    rested.steps.clone_from(&recording.steps);
    rested
}

/// The offsets of a zero that a script makes after the steps apply to the run, those of a rest without a zero do not.
#[test]
fn a_zero_between_steps_counts_like_one_before_them() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut rested = with_rest_behind(&clean.recording, 900.0);
    shift(&mut rested, Channel::T2, |_| 0.3);
    let zero = |recording: &Recording| isothermal_zero(recording, &usual(), &ZeroSettings::default());
    assert!(matches!(zero(&rested), Err(NoZero::NoSoak { .. })));
    let t_s = *rested.series[&Channel::T1].t_s.last().unwrap();
    rested.events.push(Event { t_s, kind: EventKind::SoakEnded, message: String::new() });
    let found = zero(&rested).unwrap();
    assert!((found.offsets[&Channel::T2] - found.offsets[&Channel::T1] - 0.3).abs() < 1e-9, "{found:?}");
}

/// Five sensors next to a barometer, a cell's thermometer and cold oil: one that is ten of its declared offsets off at rest is named, before the
/// run or behind it, and its points are doubtful. Sensors as declared are not named in any of forty recordings.
#[test]
fn a_sensor_that_reads_another_value_at_rest_is_named_and_no_sound_one() {
    let clean = campaign(&eighteen()[..6], 60.0, Machine::default());
    for (place, mut rested) in [with_soak(&clean.recording, 900.0), with_rest_behind(&clean.recording, 900.0)]
        .into_iter()
        .enumerate()
    {
        let t_s = rested.series[&Channel::T1].t_s.clone();
        let cell = Series { values: vec![298.15; t_s.len()], t_s };
        rested.series.extend([(Channel::TOil, cell.clone()), (Channel::TAmb, cell)]);
        let found = |recording: &Recording, declared| {
            let config = IdentifyConfig {
                method: Method::Steady,
                declared,
                barometer_pa: Some(100e3),
                ..IdentifyConfig::default()
            };
            identify_recording(recording, &config, None).unwrap()
        };
        for seed in 0..20 {
            let mut rng = Pcg64::seed_from_u64(seed);
            let (recording, declared) = measured(&rested, 1.0, 1.0, &mut rng);
            let sound = found(&recording, declared);
            assert!(sound.faults.is_empty(), "place {place}, seed {seed}: {:?}", sound.faults);
        }
        let faults = [
            (Channel::T1, -2.5),
            (Channel::T2, 2.5),
            (Channel::Tc, 3.0),
            (Channel::P1, -1500.0),
            (Channel::P2, 3000.0),
        ];
        for (seed, (channel, size)) in faults.into_iter().enumerate() {
            let mut rng = Pcg64::seed_from_u64(100 + seed as u64);
            let (mut recording, declared) = measured(&rested, 1.0, 1.0, &mut rng);
            recording.series.get_mut(&channel).unwrap().values.iter_mut().for_each(|value| *value += size);
            let found = found(&recording, declared);
            let [fault] = found.faults.as_slice() else { panic!("{channel}: {:?}", found.faults) };
            assert!(matches!(fault.suspect, Suspect::Sensor(of) if of.channels == [channel]), "{fault:?}");
            assert!((fault.value - size).abs() < 4.0 * fault.sigma && fault.at_rest.is_some(), "{fault:?}");
            // An apparent efficiency does not depend on the housing.
            let doubtful = |verdict| verdict != Verdict::Good || channel == Channel::Tc;
            assert!(found.points.iter().flatten().all(|point| doubtful(point.verdict)), "{channel}");
        }
    }
}

/// For a diagnosis one sensor may exceed its declared offset: three that read 25 degC determine its size. If two have opposite offsets,
/// neither can be identified.
#[test]
fn a_broken_sensor_is_held_against_the_others() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut broken = with_soak(&clean.recording, 1800.0);
    let declared = |sigma: f64| DeclaredUncertainty { offset_sigma: sigma, ..DeclaredUncertainty::default() };
    let channels = [Channel::T1, Channel::T2, Channel::Tc, Channel::TOil];
    let config = IdentifyConfig {
        declared: channels.map(|channel| (channel, declared(0.25))).into(),
        ..IdentifyConfig::default()
    };
    let mut shift = |channel: Channel, by_k: f64| {
        broken.series.get_mut(&channel).unwrap().values.iter_mut().for_each(|value| *value += by_k);
        isothermal_zero(&broken, &config, &ZeroSettings { allows_a_fault: true, ..ZeroSettings::default() })
    };
    let zero = shift(Channel::T2, 4.0).unwrap();
    assert!((zero.offsets[&Channel::T2] - 4.0).abs() < 1e-9, "{:?}", zero.offsets);
    assert!(zero.offsets[&Channel::T1].abs() < 1e-9 && zero.offsets[&Channel::Tc].abs() < 1e-9);
    assert!(matches!(shift(Channel::Tc, -4.0), Err(NoZero::Uneven { .. })));
}

/// Sensors compared with each other keep their common error: over draws of their offsets its spread equals the reported one.
#[test]
fn what_all_sensors_have_in_common_stays_as_uncertain_as_stated() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let soaked = with_soak(&clean.recording, 1800.0);
    let sigmas = [(Channel::T1, 0.25), (Channel::T2, 0.25), (Channel::Tc, 0.5)];
    let declared = |sigma: f64| DeclaredUncertainty { offset_sigma: sigma, ..DeclaredUncertainty::default() };
    let config = IdentifyConfig {
        declared: sigmas.map(|(channel, sigma)| (channel, declared(sigma))).into(),
        ..IdentifyConfig::default()
    };
    let mut rng = Pcg64::seed_from_u64(9);
    let draws = 60;
    let mut squares = 0.0;
    for _ in 0..draws {
        let mut recording = soaked.clone();
        let mut offsets = Vec::new();
        for (channel, sigma) in sigmas {
            let normal: f64 = StandardNormal.sample(&mut rng);
            offsets.push((channel, sigma * normal));
            let series = recording.series.get_mut(&channel).unwrap();
            series.values.iter_mut().for_each(|value| *value += sigma * normal);
        }
        let zero = isothermal_zero(&recording, &config, &ZeroSettings::default()).unwrap();
        let common = zero.common.iter().find(|common| common.channels.contains(&Channel::T1)).unwrap();
        // Every sensor keeps the same error.
        let left: Vec<f64> = offsets.iter().map(|(channel, off)| off - zero.offsets[channel]).collect();
        assert!(left.iter().all(|other| (other - left[0]).abs() < 1e-6), "{left:?}");
        squares += (left[0] / common.sigma).powi(2);
    }
    // Chi-square of 60 draws: three standard errors.
    let mean = squares / f64::from(draws);
    assert!((mean - 1.0).abs() < 3.0 * (2.0 / f64::from(draws)).sqrt(), "{mean}");
}

/// Offsets of a usual stand: T1 and T2 0.25 K, Tc 0.3 K, pressures 50 and 100 Pa; noise 0.
fn usual() -> IdentifyConfig {
    let declared = |sigma: f64| DeclaredUncertainty { offset_sigma: sigma, ..DeclaredUncertainty::default() };
    let sigmas = [
        (Channel::T1, 0.25),
        (Channel::T2, 0.25),
        (Channel::Tc, 0.3),
        (Channel::P1, 50.0),
        (Channel::P2, 100.0),
    ];
    let declared = sigmas.map(|(channel, sigma)| (channel, declared(sigma))).into();
    IdentifyConfig { declared, ..IdentifyConfig::default() }
}

fn shift(recording: &mut Recording, channel: Channel, by: impl Fn(f64) -> f64) {
    let series = recording.series.get_mut(&channel).unwrap();
    for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
        *value += by(*t_s);
    }
}

/// Five minutes after the housing was 3 K above the cell: T1, T2 and the pressures rest and are zeroed, Tc keeps its reading and its declared
/// offset, and the zero of T1 and T2 knows that a warm housing is near.
#[test]
fn what_rests_is_zeroed_before_the_housing_does() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut soaked = with_soak(&clean.recording, 300.0);
    shift(&mut soaked, Channel::T1, |_| 0.2);
    shift(&mut soaked, Channel::T2, |_| -0.2);
    shift(&mut soaked, Channel::Tc, |t_s| 3.0 * (-t_s / 600.0).exp());
    let config = usual();
    let zero = isothermal_zero(&soaked, &config, &ZeroSettings::default()).unwrap();
    assert!((zero.offsets[&Channel::T1] - zero.offsets[&Channel::T2] - 0.4).abs() < 1e-9, "{zero:?}");
    assert!(!zero.offsets.contains_key(&Channel::Tc) && zero.offsets.contains_key(&Channel::P2));
    assert!(zero.left_out.iter().any(|left| left.channel == Channel::Tc), "{zero:?}");
    assert!((0.05..0.25).contains(&zero.left_sigma[&Channel::T2]), "{zero:?}");
    let before = soaked.series[&Channel::Tc].clone();
    let (after, left) = zeroed(soaked, config.clone(), &zero);
    assert_eq!(after.series[&Channel::Tc], before);
    assert_eq!(left.declared[&Channel::Tc], config.declared[&Channel::Tc]);
    // The forecast expects the same.
    let expected = expected_after_zero(config, &ZeroSettings::default(), 300.0, ExactReadings::default());
    assert_eq!(expected.declared[&Channel::Tc].offset_sigma, 0.3);
    assert!(expected.declared[&Channel::T1].offset_sigma < 0.06, "{expected:?}");
    assert!(expected.thermometer_sigma_k > 0.0 && expected.barometer_sigma_pa > 0.0);
}

/// The air of the cell warms by 0.5 K during the soak, and every thermometer with it: their differences are still their offsets.
#[test]
fn a_cell_that_warms_is_no_drift_of_the_sensors() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut soaked = with_soak(&clean.recording, 600.0);
    for channel in [Channel::T1, Channel::T2] {
        shift(&mut soaked, channel, |t_s| 0.5 * (t_s / 600.0).min(1.0));
    }
    shift(&mut soaked, Channel::T2, |_| 0.3);
    let zero = isothermal_zero(&soaked, &usual(), &ZeroSettings::default()).unwrap();
    assert!((zero.offsets[&Channel::T2] - zero.offsets[&Channel::T1] - 0.3).abs() < 1e-6, "{zero:?}");
    assert!(zero.left_sigma[&Channel::T2] < 0.06, "{zero:?}");
}

/// After a hot run the housing is 40 K above the cell and T2 still 0.4 K above T1: no offset of T2, and the zero says so.
#[test]
fn gas_next_to_a_hot_housing_is_no_zero() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut soaked = with_soak(&clean.recording, 300.0);
    shift(&mut soaked, Channel::T2, |_| 0.4);
    shift(&mut soaked, Channel::Tc, |t_s| 40.0 * (-t_s / 600.0).exp());
    let zero = isothermal_zero(&soaked, &usual(), &ZeroSettings::default()).unwrap();
    assert!(!zero.offsets.contains_key(&Channel::T2) && zero.offsets.contains_key(&Channel::P1), "{zero:?}");
    let of_t2 = zero.left_out.iter().find(|left| left.channel == Channel::T2).unwrap();
    assert!(matches!(of_t2.reason, NotZeroed::NoGain { .. }), "{of_t2:?}");
}

/// All thermometers read 0.41 K too high, which no comparison of them shows: the cell's thermometer, known to 0.1 K, takes most of it away. Both
/// pressures read 2 kPa too high: the declared barometer contradicts them, and the interval of 95 % contains it.
#[test]
fn the_cell_shows_what_all_sensors_have_in_common() {
    let clean = campaign(&eighteen()[..2], 120.0, Machine::default());
    let mut soaked = with_soak(&clean.recording, 1800.0);
    for channel in [Channel::T1, Channel::T2, Channel::Tc] {
        shift(&mut soaked, channel, |_| 0.41);
    }
    for channel in [Channel::P1, Channel::P2] {
        shift(&mut soaked, channel, |_| 2000.0);
    }
    let t_s = soaked.series[&Channel::T1].t_s.clone();
    let cell = Series { values: vec![298.15; t_s.len()], t_s };
    soaked.series.insert(Channel::TAmb, cell);
    let mut config = IdentifyConfig { barometer_pa: Some(100e3), ..usual() };
    let of_cell = DeclaredUncertainty { offset_sigma: 0.1, ..DeclaredUncertainty::default() };
    config.declared.insert(Channel::TAmb, of_cell);
    let zero = isothermal_zero(&soaked, &config, &ZeroSettings::default()).unwrap();
    let contradicting: Vec<_> =
        zero.references.iter().filter(|reference| reference.contradiction().is_some()).collect();
    assert_eq!(contradicting.len(), 1, "{zero:?}");
    assert!((contradicting[0].contradiction().unwrap() - 2000.0).abs() < 1.0);
    let (after, left) = zeroed(soaked, config, &zero);
    for channel in [Channel::T1, Channel::T2, Channel::Tc] {
        let error_k = after.series[&channel].values[100] - 298.15;
        assert!((0.05..0.2).contains(&error_k), "{channel}: {error_k}");
    }
    assert!(left.thermometer_sigma_k < 0.1 && 1.96 * left.barometer_sigma_pa > 2000.0, "{left:?}");
}
