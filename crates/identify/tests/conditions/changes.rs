//! Errors of readings, alone and combined, that leave a recording plausible.

use mapper_core::{Channel, Recording};

/// A change of a recording.
pub struct Change {
    pub name: &'static str,
    pub apply: fn(&mut Recording),
}

const TEMPERATURES: [Channel; 8] = {
    use Channel::{T1, T2, T3, T4, TAmb, TOil, Tc, Tt};
    [T1, T2, Tc, T3, T4, Tt, TOil, TAmb]
};
const ABSOLUTE_PRESSURES: [Channel; 4] = [Channel::P1, Channel::P2, Channel::P3, Channel::P4];

/// Adds an error, which depends on the share of the run (0 to 1) and on the reading.
fn add(recording: &mut Recording, channels: &[Channel], error: impl Fn(f64, f64) -> f64) {
    let (first, last) = (recording.steps[0].start_s, recording.steps[recording.steps.len() - 1].end_s);
    for channel in channels {
        let Some(series) = recording.series.get_mut(channel) else { continue };
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            *value += error((t_s - first) / (last - first), *value);
        }
    }
}

/// Moves the rise of temperatures over T1 by a share of it.
fn rise(recording: &mut Recording, channels: &[Channel], ratio: f64) {
    let t1 = recording.series[&Channel::T1].clone();
    let mean_k = t1.values.iter().sum::<f64>() / t1.values.len() as f64;
    add(recording, channels, |_, value| ratio * (value - mean_k));
}

/// The T2 probe conducts: it reads a share of the way from the gas to the housing.
fn stem(recording: &mut Recording, ratio: f64) {
    let housing = recording.series[&Channel::Tc].clone();
    let series = recording.series.get_mut(&Channel::T2).unwrap();
    for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
        *value += ratio * (housing.interpolate(*t_s).unwrap() - *value);
    }
}

fn barometer(recording: &mut Recording, error_pa: f64) {
    add(recording, &ABSOLUTE_PRESSURES, |_, _| error_pa);
}

fn offset(recording: &mut Recording, channels: &[Channel], error: f64) {
    add(recording, channels, |_, _| error);
}

fn gain(recording: &mut Recording, channels: &[Channel], ratio: f64) {
    add(recording, channels, |_, value| ratio * value);
}

/// A gain that is right at the ice point.
fn gain_celsius(recording: &mut Recording, channels: &[Channel], ratio: f64) {
    add(recording, channels, |_, value| ratio * (value - 273.15));
}

fn drift(recording: &mut Recording, channels: &[Channel], error: f64) {
    add(recording, channels, |share, _| share * error);
}

/// A temperature in degF that is taken for one in degC.
fn fahrenheit(recording: &mut Recording, channel: Channel) {
    add(recording, &[channel], |_, value| 0.8 * (value - 273.15) + 32.0);
}

fn swap(recording: &mut Recording, one: Channel, other: Channel) {
    let of_one = recording.series.remove(&one).unwrap();
    let of_other = recording.series.insert(other, of_one).unwrap();
    recording.series.insert(one, of_other);
}

const fn change(name: &'static str, apply: fn(&mut Recording)) -> Change {
    Change { name, apply }
}

#[rustfmt::skip]
pub const CHANGES: &[Change] = {
    use Channel::{CompressorFlow, P1, P2, ShaftSpeed, T1, T2, T3, T4, Tc, TurbineFlow};
    &[
        change("none", |_| {}),
        change("P1 and P2 +1 kPa", |r| offset(r, &[P1, P2], 1e3)),
        change("P1 and P2 +2 kPa", |r| offset(r, &[P1, P2], 2e3)),
        change("P1 and P2 +5 kPa", |r| offset(r, &[P1, P2], 5e3)),
        change("all pressures -1.5 kPa", |r| barometer(r, -1.5e3)),
        change("P1 +500 Pa", |r| offset(r, &[P1], 500.0)),
        change("P2 +1.5 kPa", |r| offset(r, &[P2], 1.5e3)),
        change("P2 +2 % of reading", |r| gain(r, &[P2], 0.02)),
        change("P1 and P2 drift by 2 kPa", |r| drift(r, &[P1, P2], 2e3)),
        change("all temperatures +3 % of reading in K", |r| gain(r, &TEMPERATURES, 0.03)),
        change("all temperatures +3 % of reading in degC", |r| gain_celsius(r, &TEMPERATURES, 0.03)),
        change("all temperatures +2 K", |r| offset(r, &TEMPERATURES, 2.0)),
        change("all temperatures +5 K", |r| offset(r, &TEMPERATURES, 5.0)),
        change("T1 +1.5 K", |r| offset(r, &[T1], 1.5)),
        change("T2 +1 % of reading in K", |r| gain(r, &[T2], 0.01)),
        change("T2 -2 K", |r| offset(r, &[T2], -2.0)),
        change("T2 drifts by 3 K", |r| drift(r, &[T2], 3.0)),
        change("Tc +3 K", |r| offset(r, &[Tc], 3.0)),
        change("rise of T2 -2 %", |r| rise(r, &[T2], -0.02)),
        change("rise of T2 +3 %", |r| rise(r, &[T2], 0.03)),
        change("rises of T2 and Tc -3 %", |r| rise(r, &[T2, Tc], -0.03)),
        change("rises of T2 and Tc +4 %", |r| rise(r, &[T2, Tc], 0.04)),
        change("10 % stem conduction", |r| stem(r, 0.1)),
        change("15 % stem conduction", |r| stem(r, 0.15)),
        change("flow +3 %", |r| gain(r, &[CompressorFlow], 0.03)),
        change("speed +1 %", |r| gain(r, &[ShaftSpeed], 0.01)),
        change("all pressures +2 kPa, all temperatures +2 K", |r| { barometer(r, 2e3); offset(r, &TEMPERATURES, 2.0) }),
        change("all pressures +1 kPa, rise of T2 -2 %", |r| { barometer(r, 1e3); rise(r, &[T2], -0.02) }),
        change("10 % stem conduction, T1 +1.5 K", |r| { stem(r, 0.1); offset(r, &[T1], 1.5) }),
        change("flow +3 %, all pressures -2 kPa", |r| { gain(r, &[CompressorFlow], 0.03); barometer(r, -2e3) }),
        change("10 % stem conduction, all pressures +1 kPa", |r| { stem(r, 0.1); barometer(r, 1e3) }),
        change("T1 +1 % of reading in K", |r| gain(r, &[T1], 0.01)),
        change("Tc drifts by 4 K", |r| drift(r, &[Tc], 4.0)),
        change("P2 +0.5 % of reading", |r| gain(r, &[P2], 0.005)),
        change("P2 +1.325 kPa", |r| offset(r, &[P2], 1325.0)),
        change("flow +7.3 %", |r| gain(r, &[CompressorFlow], 0.0732)),
        change("m_c and m_t +2 %", |r| gain(r, &[CompressorFlow, TurbineFlow], 0.02)),
        change("T3 in degF", |r| fahrenheit(r, T3)),
        change("T3 and T4 swapped", |r| swap(r, T3, T4)),
        change("T1 and T2 swapped", |r| swap(r, T1, T2)),
        change("T2 -2 K, P2 +1.5 kPa", |r| { offset(r, &[T2], -2.0); offset(r, &[P2], 1.5e3) }),
    ]
};
