//! What a plausible reading of a turbocharger on a gas stand is, in one table for all checks.

use crate::{Channel, Dimension};
use std::ops::{Range, RangeInclusive};

/// Plausible readings of a channel, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausible {
    /// Readings of a running machine, from a car's turbocharger (wheels of 30 mm) to a ship's (of 300 mm).
    pub running: RangeInclusive<f64>,
    /// Any single reading, including standstill, spikes and faults of the meter: a value outside is invalid.
    pub any: RangeInclusive<f64>,
}

/// The plausible readings of a channel.
///
/// | | running | why | any |
/// |---|---|---|---|
/// | shaft speed | 1e3..6e5 rpm | idle of the largest machines to a wheel of 20 mm at a tip speed of 630 m/s | 0..1e7 |
/// | flows | 1e-4..20 kg/s | leakage of a small machine at idle to engines of 10 MW | -100..100 |
/// | P1 | 30..600 kPa | absolute; throttled inlet at altitude to the outlet of an upstream stage | 100..1e9 |
/// | other pressures | 50 kPa..2 MPa | absolute; gauge readings at part load are lower; up to three stages of boost | 100..1e9 |
/// | relative humidity | 0..1.05 | saturated air, with the error of a hygrometer | any |
/// | T1, ambient, dew point | 220..390 K | arctic cell to the outlet of an upstream stage without a cooler | 100..3000 |
/// | T2 | 220..700 K | limit of compressor wheels | 100..3000 |
/// | compressor housing | 220..800 K | above the limit of aluminium | 100..3000 |
/// | oil, water | 220..480 K | oil burns above, and water boils at 18 bar | 100..3000 |
/// | turbine side | 220..1600 K | above the limit of turbine materials | 100..3000 |
pub fn plausible(channel: Channel) -> Plausible {
    let running = match channel {
        Channel::ShaftSpeed => 1e3..=6e5,
        Channel::CompressorFlow | Channel::TurbineFlow | Channel::OilFlow | Channel::WaterFlow => 1e-4..=20.0,
        Channel::P1 => 3e4..=6e5,
        Channel::P2 | Channel::P3 | Channel::P4 | Channel::P3Command => 5e4..=2e6,
        Channel::T1 | Channel::TAmb | Channel::DewPoint => 220.0..=390.0,
        Channel::T2 => 220.0..=700.0,
        Channel::Tc => 220.0..=800.0,
        Channel::T3 | Channel::T4 | Channel::Tt | Channel::T3Command => 220.0..=1600.0,
        Channel::TOil | Channel::TOilOut | Channel::TOilCommand | Channel::TWater | Channel::TWaterOut => {
            220.0..=480.0
        }
        Channel::ValveCommand => 0.0..=10.0,
        Channel::RelativeHumidity => 0.0..=1.05,
    };
    let any = match channel.info().dimension {
        Dimension::RotationalSpeed => 0.0..=1e7,
        Dimension::MassFlow => -100.0..=100.0,
        Dimension::Pressure => 100.0..=1e9,
        Dimension::Temperature => 100.0..=3000.0,
        Dimension::Ratio => f64::MIN..=f64::MAX,
    };
    Plausible { running, any }
}

/// Readings of a correctly wired and scaled sensor, standstill included, in the unit of the dimension. A value
/// outside means a wrong byte order, unit or scale, or a defective sensor. Narrower than [`Plausible::any`], which allows spikes; wider
/// than [`Plausible::running`], since a stand may be at rest.
pub fn measurable(dimension: Dimension) -> RangeInclusive<f64> {
    match dimension {
        // Noise around 0.
        Dimension::RotationalSpeed => -1e3..=1e6,
        Dimension::MassFlow => -1.0..=20.0,
        Dimension::Pressure => 1e3..=5e6,
        Dimension::Temperature => 200.0..=1600.0,
        Dimension::Ratio => -0.1..=10.0,
    }
}

/// Whether a reading of a sensor is possible. While the machine runs, shaft speed and flow may still be zero, because a rig starts from rest.
pub fn is_possible(channel: Channel, value: f64, running: bool) -> bool {
    let from_rest = matches!(channel.info().dimension, Dimension::RotationalSpeed | Dimension::MassFlow);
    value.is_finite()
        && measurable(channel.info().dimension).contains(&value)
        && (!running || from_rest || plausible(channel).running.contains(&value))
}

/// Whether the readings of a whole log, from `low` to `high` without its spikes, are possible for a channel. Speed and flow are 0 at rest, but
/// not all the time; a channel that is always 0 is dead, and its unit may be right.
pub fn is_plausible_range(channel: Channel, low: f64, high: f64) -> bool {
    let running = plausible(channel).running;
    let (min, max) = (*running.start(), *running.end());
    match channel.info().dimension {
        Dimension::RotationalSpeed | Dimension::MassFlow => {
            high <= max && (high >= min || high == 0.0 && low == 0.0)
        }
        _ => low >= min && high <= max,
    }
}

/// Values of a pressure in kPa labelled Pa. Bound: inlet to three stages of boost.
const KPA_LABELLED_PA: Range<f64> = 30.0..2_000.0;
/// Values of a pressure in bar labelled Pa. Bound: the same range.
const BAR_LABELLED_PA: Range<f64> = 0.3..30.0;
/// Values of a temperature in degC labelled K. Bound: inlet to the outlet of a compressor.
const DEGC_LABELLED_K: Range<f64> = 0.0..200.0;
/// Values of a speed in krpm or 1/s labelled rpm. Bound: idle of the largest to the limit of the smallest machines.
const KRPM_LABELLED_RPM: Range<f64> = 5.0..1_000.0;
/// Maximum flow, kg/s. Bound: the largest turbochargers, of ships.
const MAX_FLOW_KG_S: f64 = 20.0;

/// Whether a single value is finite and possible on any rig; other values count as lost.
pub fn is_reading(channel: Channel, value: f64) -> bool {
    value.is_finite() && plausible(channel).any.contains(&value)
}

/// The median reading of a channel is impossible for a running machine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the median of {channel} is {value:.4} {unit}, which is impossible for a running machine ({low} to {high} {unit}). {remedy}",
    unit = .channel.unit(),
    remedy = remedy(*.channel, *.value),
    low = plausible(*.channel).running.start(),
    high = plausible(*.channel).running.end()
)]
pub struct Implausible {
    /// The channel.
    pub channel: Channel,
    /// Median, SI.
    pub value: f64,
}

/// Checks the median reading of a channel, SI.
///
/// # Errors
/// [`Implausible`] with the likely cause and the remedy.
pub fn check_running(channel: Channel, median: f64) -> Result<(), Implausible> {
    if plausible(channel).running.contains(&median) {
        return Ok(());
    }
    Err(Implausible { channel, value: median })
}

/// Likely cause of an implausible reading, and the remedy.
fn remedy(channel: Channel, value: f64) -> &'static str {
    match channel.info().dimension {
        Dimension::Pressure if KPA_LABELLED_PA.contains(&value) => {
            "It looks like kPa labelled Pa; correct the unit in the channel map"
        }
        Dimension::Pressure if BAR_LABELLED_PA.contains(&value) => {
            "It looks like bar labelled Pa; correct the unit in the channel map"
        }
        Dimension::Temperature if DEGC_LABELLED_K.contains(&value) => {
            "It looks like degC labelled K; correct the unit in the channel map"
        }
        Dimension::RotationalSpeed if KRPM_LABELLED_RPM.contains(&value) => {
            "It looks like krpm or 1/s labelled rpm; correct the unit in the channel map"
        }
        Dimension::MassFlow if value > MAX_FLOW_KG_S => {
            "It looks like g/s or kg/h labelled kg/s; correct the unit in the channel map"
        }
        Dimension::MassFlow => "No flow is measured; check unit and sensor",
        _ => "Check unit and sensor; the channel map has the unit of each field",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_readings_pass_and_each_wrong_unit_is_named() {
        for (channel, value) in [
            (Channel::ShaftSpeed, 90e3),
            (Channel::CompressorFlow, 0.12),
            (Channel::P2, 180e3),
            (Channel::T3, 1173.0),
        ] {
            assert_eq!(check_running(channel, value), Ok(()));
        }
        for (channel, value, named) in [
            (Channel::ShaftSpeed, 90.0, "krpm"),
            (Channel::CompressorFlow, 120.0, "g/s"),
            (Channel::CompressorFlow, 0.0, "No flow"),
            (Channel::P2, 180.0, "kPa"),
            (Channel::P2, 1.8, "bar"),
            (Channel::T2, 85.0, "degC"),
            (Channel::T2, f64::NAN, "Check unit"),
        ] {
            let message = check_running(channel, value).unwrap_err().to_string();
            assert!(message.contains(named), "{message}");
        }
    }
}
