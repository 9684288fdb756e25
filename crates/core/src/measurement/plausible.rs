//! Plausible readings, and the kinds of sensor faults.

use crate::{Channel, Dimension};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Range, RangeInclusive};

/// Plausible readings of a channel, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausible {
    /// Readings of a running machine, from a car's turbocharger (wheels of 30 mm) to a ship's (of 300 mm).
    pub running: RangeInclusive<f64>,
    /// Any single reading, including standstill, spikes and faults of the meter: a value outside is invalid.
    pub any: RangeInclusive<f64>,
}

/// Speeds of a running machine, rpm. Bound: idle of the largest machines to a wheel of 20 mm at a tip speed of 630 m/s.
const RUNNING_RPM: RangeInclusive<f64> = 1e3..=6e5;
/// Flows of a running machine, kg/s. Bound: leakage of a small machine at idle to engines of 10 MW.
const RUNNING_KG_S: RangeInclusive<f64> = 1e-4..=20.0;
/// P1, absolute, of a running machine, Pa. Bound: throttled inlet at altitude to the outlet of an upstream stage.
const RUNNING_P1_PA: RangeInclusive<f64> = 3e4..=6e5;
/// Other absolute pressures of a running machine, Pa. Bound: gauge readings at part load are lower; up to three stages of boost.
const RUNNING_PA: RangeInclusive<f64> = 5e4..=2e6;
/// T1, ambient and dew point, K. Bound: arctic cell to the outlet of an upstream stage without a cooler.
const RUNNING_AIR_K: RangeInclusive<f64> = 220.0..=390.0;
/// T2, K. Bound: limit of compressor wheels.
const RUNNING_T2_K: RangeInclusive<f64> = 220.0..=700.0;
/// Compressor housing, K. Bound: above the limit of aluminium.
const RUNNING_TC_K: RangeInclusive<f64> = 220.0..=800.0;
/// Turbine side, K. Bound: above the limit of turbine materials.
const RUNNING_TURBINE_K: RangeInclusive<f64> = 220.0..=1600.0;
/// Oil and water, K. Bound: oil burns above, and water boils at 18 bar.
const RUNNING_LIQUID_K: RangeInclusive<f64> = 220.0..=480.0;
/// Opening of a valve over its nominal area. Bound: a valve of three times the diameter.
const RUNNING_OPENING: RangeInclusive<f64> = 0.0..=10.0;
/// Relative humidity. Bound: saturated air, with the error of a hygrometer.
const RUNNING_HUMIDITY: RangeInclusive<f64> = 0.0..=1.05;
/// Coefficient of variation of a pressure. Bound: deep surge swings by less than its mean.
const RUNNING_VARIATION: RangeInclusive<f64> = 0.0..=1.0;
/// Any single reading of a speed, rpm. Bound: spikes of a pulse counter.
const ANY_RPM: RangeInclusive<f64> = 0.0..=1e7;
/// Any single reading of a flow, kg/s. Bound: spikes and reversed flow.
const ANY_KG_S: RangeInclusive<f64> = -100.0..=100.0;
/// Any single reading of a pressure, Pa. Bound: a lost supply to spikes.
const ANY_PA: RangeInclusive<f64> = 100.0..=1e9;
/// Any single reading of a temperature, K. Bound: an open thermocouple.
const ANY_K: RangeInclusive<f64> = 100.0..=3000.0;
/// Speeds that a correctly wired sensor reads, rpm. Bound: noise around 0 to beyond any wheel.
const MEASURABLE_RPM: RangeInclusive<f64> = -1e3..=1e6;
/// Flows that a correctly wired sensor reads, kg/s. Bound: the zero of a large meter to [`RUNNING_KG_S`].
const MEASURABLE_KG_S: RangeInclusive<f64> = -1.0..=20.0;
/// Pressures that a correctly wired sensor reads, Pa. Bound: a vacuum to beyond [`RUNNING_PA`].
const MEASURABLE_PA: RangeInclusive<f64> = 1e3..=5e6;
/// Temperatures that a correctly wired sensor reads, K. Bound: those of a running machine, and a colder store.
const MEASURABLE_K: RangeInclusive<f64> = 200.0..=1600.0;
/// Ratios that a correctly wired sensor reads. Bound: noise around 0 to [`RUNNING_OPENING`].
const MEASURABLE_RATIO: RangeInclusive<f64> = -0.1..=10.0;

/// The plausible readings of a channel.
pub fn plausible(channel: Channel) -> Plausible {
    let running = match channel {
        Channel::ShaftSpeed => RUNNING_RPM,
        Channel::CompressorFlow | Channel::TurbineFlow | Channel::OilFlow | Channel::WaterFlow => {
            RUNNING_KG_S
        }
        Channel::P1 => RUNNING_P1_PA,
        Channel::P2 | Channel::P3 | Channel::P4 | Channel::P3Command => RUNNING_PA,
        Channel::T1 | Channel::TAmb | Channel::DewPoint => RUNNING_AIR_K,
        Channel::T2 => RUNNING_T2_K,
        Channel::Tc => RUNNING_TC_K,
        Channel::T3 | Channel::T4 | Channel::Tt | Channel::T3Command => RUNNING_TURBINE_K,
        Channel::TOil | Channel::TOilOut | Channel::TOilCommand | Channel::TWater | Channel::TWaterOut => {
            RUNNING_LIQUID_K
        }
        Channel::ValveCommand => RUNNING_OPENING,
        Channel::RelativeHumidity => RUNNING_HUMIDITY,
        Channel::P1Variation | Channel::P2Variation => RUNNING_VARIATION,
    };
    let any = match channel.info().dimension {
        Dimension::RotationalSpeed => ANY_RPM,
        Dimension::MassFlow => ANY_KG_S,
        Dimension::Pressure => ANY_PA,
        Dimension::Temperature => ANY_K,
        Dimension::Ratio => f64::MIN..=f64::MAX,
    };
    Plausible { running, any }
}

/// Readings of a correctly wired and scaled sensor, standstill included, in the unit of the dimension. A value
/// outside means a wrong byte order, unit or scale, or a defective sensor. Narrower than [`Plausible::any`], which allows spikes; wider
/// than [`Plausible::running`], since a stand may be at rest.
pub fn measurable(dimension: Dimension) -> RangeInclusive<f64> {
    match dimension {
        Dimension::RotationalSpeed => MEASURABLE_RPM,
        Dimension::MassFlow => MEASURABLE_KG_S,
        Dimension::Pressure => MEASURABLE_PA,
        Dimension::Temperature => MEASURABLE_K,
        Dimension::Ratio => MEASURABLE_RATIO,
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

/// Form of the error of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A thermocouple reads a temperature between gas and wall: share of the difference.
    TowardsWall,
    /// The reading follows with a lag, s. T2 has two in series: a sheath of this diameter, m, as in eqs. 11 and 12, and the element in it.
    Lag,
    /// An error proportional to the reading; for temperatures, to the difference from 20 degC. Ratio.
    Gain,
    /// A constant error of every reading, in the channel's unit (K, Pa, kg/s, rpm).
    Offset,
    /// A drift from zero at the start of the run to the full size at its end: in the unit of the channel, but a ratio to the
    /// reading for flow and speed.
    Drift,
    /// An error proportional to the square of the flow, in the channel's unit at a flux of 120 kg/(s m2): dynamic pressure at a tap, gas that is
    /// not mixed at a probe.
    WithFlowSquared,
    /// An error proportional to the opening of the valve, in the channel's unit at opening 1: flow around a tap that changes with it.
    WithValve,
    /// The reading repeats one value for longer than noise allows, s.
    Frozen,
    /// No reading for much of the time: share of it.
    Silent,
    /// A reading that no machine can have.
    OutOfRange,
    /// A change that is faster than the sensor can follow.
    Jump,
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FaultKind::TowardsWall => "conduction along the probe",
            FaultKind::Lag => "lag",
            FaultKind::Gain => "gain error",
            FaultKind::Offset => "offset",
            FaultKind::Drift => "drift",
            FaultKind::WithFlowSquared => "error with flow squared",
            FaultKind::WithValve => "error with valve opening",
            FaultKind::Frozen => "frozen reading",
            FaultKind::Silent => "missing readings",
            FaultKind::OutOfRange => "impossible reading",
            FaultKind::Jump => "impossible jump",
        })
    }
}

/// Maximum time for which a channel of known noise can repeat one value, s. Bound: noise repeats a value in two or three samples of a coarse logger,
/// not for seconds.
pub const NOISY_REPEAT_S: f64 = 5.0;

/// Maximum time, s, and number of samples for which any channel can repeat one value while others change. Bound: a coarse digit repeats four of five
/// samples, and 20 of them in 1 % of cases only.
pub const COARSE_REPEAT_S: f64 = 20.0;
/// See [`COARSE_REPEAT_S`]. Bound: as there.
pub const COARSE_REPEAT_SAMPLES: usize = 20;

/// Movement below which a reading counts as constant after a jump of the setpoints, as a share of its declared noise. Bound: 200 samples of a working
/// sensor cover five standard deviations, and a tenth of them if its noise was declared ten times too large.
const BAND_NOISE_RATIO: f64 = 0.1;

/// Like [`BAND_NOISE_RATIO`], as a share of the reading (4 mK of 400 K, 2 Pa of 200 kPa). Bound: the noise of thermocouple and pressure amplifiers is
/// larger, and a jump of the setpoints moves a reading a hundred times as far.
const BAND_READING_RATIO: f64 = 1e-5;

/// A reading is frozen if it has stayed within its band since before a jump of the setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrozenLimit {
    /// Time after the jump, s, > 0.
    pub after_s: f64,
    /// Half width of the band, unit of the channel, >= 0.
    pub band: f64,
}

impl FrozenLimit {
    /// The limit of a channel with declared noise; `None` without noise, as an ideal sensor repeats its value.
    pub fn of_noise(noise_sigma: f64, after_s: f64) -> Option<FrozenLimit> {
        (noise_sigma > 0.0).then_some(FrozenLimit { after_s, band: BAND_NOISE_RATIO * noise_sigma })
    }

    /// Whether a reading has not moved from an earlier one.
    pub fn is_constant(&self, earlier: f64, reading: f64) -> bool {
        (reading - earlier).abs() <= self.band.max(BAND_READING_RATIO * earlier.abs())
    }
}

/// The runs of one value repeated to the last digit, as the places of their first and last reading; a value that does not repeat is a run of
/// one.
pub fn repeats(values: &[f64]) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    values.chunk_by(|a, b| a == b).map(move |run| {
        let found = (first, first + run.len() - 1);
        first += run.len();
        found
    })
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
