//! Plausible readings of jumps, surge and standstill stay good; jumps faster than the sensor's lag are bad while they last.

use mapper_core::{Channel, ChannelColumn, Element, ElementColumn, Quality, Reaction, SampleBatch, Trip};
use mapper_runner::{CommandedState, PlausibilityWatch, ReadingBounds};

const INTERVAL_S: f64 = 0.1;
const RUNNING: CommandedState =
    CommandedState { running: true, step_since_s: None, aim: None, valve: None, jumped_s: None };

/// A steady point: pressure ratio 1.8, efficiency 70 %.
const STEADY: [(Channel, f64); 8] = [
    (Channel::ShaftSpeed, 110e3),
    (Channel::CompressorFlow, 0.08),
    (Channel::P1, 100e3),
    (Channel::T1, 298.0),
    (Channel::P2, 180e3),
    (Channel::T2, 376.0),
    (Channel::Tc, 360.0),
    (Channel::P3, 175e3),
];

fn watch(t2_lag_s: f64) -> PlausibilityWatch {
    PlausibilityWatch::new(ReadingBounds {
        wheel_diameter_m: Some(0.052),
        t2_lag_s: (t2_lag_s, 2.0 * t2_lag_s),
        noise_k: [0.1, 0.1, 0.3],
    })
}

/// Judges the steady point with some channels changed at each time; returns the times of the bad readings of a channel, and the trip.
fn judge_samples(
    watch: &mut PlausibilityWatch,
    seconds: f64,
    of: Channel,
    changed: impl Fn(f64) -> Vec<(Channel, f64)>,
) -> (Vec<f64>, Option<Trip>) {
    let (mut bad_s, mut trip) = (Vec::new(), None);
    for sample in 0..(seconds / INTERVAL_S).round() as u32 {
        let t_s = INTERVAL_S * f64::from(sample);
        let changed = changed(t_s);
        let value = |(channel, usual)| {
            let found = changed.iter().find(|(other, _)| *other == channel);
            found.map_or(usual, |(_, value)| *value)
        };
        let mut batch = SampleBatch {
            t_s: vec![t_s],
            columns: STEADY.map(|row| ChannelColumn { channel: row.0, values: vec![value(row)] }).to_vec(),
            ..SampleBatch::default()
        };
        trip = trip.or(watch.judge(&mut batch, &RUNNING));
        if batch.provenance_of(of).is_some_and(|from| from.quality[0] == Quality::Bad) {
            bad_s.push(t_s);
        }
    }
    (bad_s, trip)
}

#[test]
fn an_impossible_jump_is_bad_until_the_reading_returns() {
    let at = |t2_k: f64| vec![(Channel::T2, t2_k)];
    // A probe with a lag of 2 s in a gas that jumps by 100 K.
    let follows = |t_s: f64| at(376.0 + 100.0 * (1.0 - (-(t_s - 5.0).max(0.0) / 2.0).exp()));
    assert_eq!(judge_samples(&mut watch(2.0), 20.0, Channel::T2, follows), (vec![], None));
    // An interference of two samples makes only these two bad.
    let spike = |t_s: f64| at(if (4.95..5.15).contains(&t_s) { 480.0 } else { 376.0 });
    let (bad_s, trip) = judge_samples(&mut watch(2.0), 20.0, Channel::T2, spike);
    assert_eq!((bad_s.len(), trip), (2, None));
    // A lasting shift stays bad, although the gas may be as hot, and ends the run.
    let shift = |t_s: f64| at(if t_s < 4.95 { 376.0 } else { 440.0 });
    let (bad_s, trip) = judge_samples(&mut watch(2.0), 20.0, Channel::T2, shift);
    assert_eq!(bad_s.len(), 150);
    let trip = trip.unwrap();
    assert!(trip.reaction == Reaction::Safe && (6.9..7.2).contains(&trip.t_s), "{trip:?}");
    // A probe without inertia may jump.
    assert_eq!(judge_samples(&mut watch(0.0), 20.0, Channel::T2, shift), (vec![], None));
    // The housing has a lag without any declaration.
    let housing = |t_s: f64| vec![(Channel::Tc, if t_s < 4.95 { 360.0 } else { 400.0 })];
    assert!(judge_samples(&mut watch(0.0), 20.0, Channel::Tc, housing).1.is_some());
}

/// One of three T2 probes fails: out of range, colder than isentropic compression, or faster than its lag. The rig's combined reading
/// stays right without it. The failed probe loses its readings, the others keep theirs, and the run continues with a note.
#[test]
fn each_of_several_sensors_is_checked_separately() {
    for wrong_k in [5.0, 1e12, 330.0, 470.0] {
        let (mut watch, mut trips, mut read) = (watch(2.0), Vec::new(), [0; 3]);
        for sample in 0..100_u32 {
            let t_s = INTERVAL_S * f64::from(sample);
            let value_k = |number| if number == 3 && t_s > 2.95 { wrong_k } else { 376.0 };
            let element = |number| ElementColumn {
                element: Element { channel: Channel::T2, number },
                values: vec![value_k(number)],
            };
            let mut batch = SampleBatch {
                t_s: vec![t_s],
                columns: STEADY.map(|row| ChannelColumn { channel: row.0, values: vec![row.1] }).to_vec(),
                elements: [1, 2, 3].map(element).to_vec(),
                ..SampleBatch::default()
            };
            trips.extend(watch.judge(&mut batch, &RUNNING));
            assert!(batch.provenance.is_empty(), "{wrong_k} K at {t_s} s: {:?}", batch.provenance);
            let values = batch.elements.iter().map(|one| one.values[0]);
            read.iter_mut().zip(values).for_each(|(read, value)| *read += u32::from(value.is_finite()));
        }
        assert_eq!(read, [100, 100, 30], "{wrong_k} K");
        let noted = trips.iter().all(|trip| trip.reaction == Reaction::Note && trip.reason.contains("T2/3"));
        assert!(noted && !trips.is_empty(), "{wrong_k} K: {trips:?}");
    }
}

#[test]
fn surge_jumps_and_standstill_are_plausible() {
    // Deep surge: flow reverses in each cycle of half a second, pressure swings by a fifth.
    let surge = |t_s: f64| {
        let swing = (2.0 * std::f64::consts::PI * 2.1 * t_s).sin();
        vec![
            (Channel::CompressorFlow, 0.02 + 0.08 * swing),
            (Channel::P2, 170e3 + 34e3 * swing),
            (Channel::T2, 385.0 + 15.0 * swing),
        ]
    };
    assert_eq!(judge_samples(&mut watch(0.0), 30.0, Channel::CompressorFlow, surge), (vec![], None));
    // From standstill: no pressure ratio, and a slightly negative reading of the flow meter.
    let rest = |t_s: f64| {
        let drives = t_s / 30.0;
        vec![
            (Channel::ShaftSpeed, 50e3 * drives),
            (Channel::CompressorFlow, 0.03 * drives - 2e-4),
            (Channel::P2, 100e3 * (1.0 + 0.16 * drives * drives)),
            (Channel::T2, 297.5 + 18.0 * drives * drives),
            (Channel::Tc, 296.0),
        ]
    };
    assert_eq!(judge_samples(&mut watch(0.5), 30.0, Channel::CompressorFlow, rest), (vec![], None));
    // The shaft drops from 110 to 50 krpm within a second; the probe, of 4 s, stays hot.
    let drop = |t_s: f64| {
        let left = (-(t_s - 5.0).max(0.0) / 0.4).exp();
        let probe = (-(t_s - 5.0).max(0.0) / 4.0).exp();
        vec![
            (Channel::ShaftSpeed, 50e3 + 60e3 * left),
            (Channel::P2, 115e3 + 65e3 * left),
            (Channel::T2, 313.0 + 63.0 * probe),
        ]
    };
    assert_eq!(judge_samples(&mut watch(4.0), 30.0, Channel::T2, drop), (vec![], None));
    // And back: the probe lags behind the pressure.
    let rise = |t_s: f64| {
        let left = (-(t_s - 5.0).max(0.0) / 0.4).exp();
        let probe = (-(t_s - 5.0).max(0.0) / 4.0).exp();
        vec![
            (Channel::ShaftSpeed, 110e3 - 60e3 * left),
            (Channel::P2, 180e3 - 65e3 * left),
            (Channel::T2, 376.0 - 63.0 * probe),
            (Channel::Tc, 330.0),
        ]
    };
    assert_eq!(judge_samples(&mut watch(4.0), 30.0, Channel::T2, rise), (vec![], None));
}
