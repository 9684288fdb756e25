//! Checks readings against the possible range of a turbocharger on a gas stand.

use mapper_core::{Channel, Dimension, plausible};

/// Values of a pressure in kPa labelled Pa. Bound: inlet to three stages of boost.
const KPA_LABELLED_PA: std::ops::Range<f64> = 30.0..2_000.0;
/// Values of a pressure in bar labelled Pa. Bound: the same range.
const BAR_LABELLED_PA: std::ops::Range<f64> = 0.3..30.0;
/// Values of a temperature in degC labelled K. Bound: inlet to the outlet of a compressor.
const DEGC_LABELLED_K: std::ops::Range<f64> = 0.0..200.0;
/// Values of a speed in krpm or 1/s labelled rpm. Bound: idle of the largest to the limit of the smallest machines.
const KRPM_LABELLED_RPM: std::ops::Range<f64> = 5.0..1_000.0;
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
