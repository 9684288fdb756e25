//! Plausibility check of the first readings, before anything is written. A wrong word order, unit or scale in the readings is also wrong in
//! the setpoints.

use crate::Controller;
use mapper_core::{Channel, measurable};

/// Readings that no sensor can deliver.
#[derive(Debug, thiserror::Error)]
#[error(
    "{channel} reads {} {unit} from {source_text}; plausible are {} to {} {unit}{}. {remedy}. No setpoint was written",
    format_short(*.value),
    format_short(*.low),
    format_short(*.high),
    describe_others(.others)
)]
pub(crate) struct ImplausibleReading {
    /// The first implausible channel.
    pub(crate) channel: Channel,
    value: f64,
    unit: &'static str,
    low: f64,
    high: f64,
    source_text: String,
    /// The others.
    others: Vec<Channel>,
    remedy: String,
}

fn describe_others(others: &[Channel]) -> String {
    match others {
        [] => String::new(),
        _ => {
            let symbols: Vec<_> = others.iter().map(|channel| channel.symbol()).collect();
            format!("; {} are implausible too", symbols.join(", "))
        }
    }
}

/// Four significant digits; a power of ten for very large or small values.
pub fn format_short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e7).contains(&size) => {
            // Digits before the decimal point are never rounded away.
            let decimals = (3.0 - size.log10().floor()).max(0.0);
            let text = format!("{value:.0$}", decimals as usize);
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        }
        _ => format!("{value:.3e}"),
    }
}

/// Whether a sensor can read this value, SI. NaN passes: the guards count how long it lasts.
pub fn is_plausible(channel: Channel, value: f64) -> bool {
    !value.is_finite() || measurable(channel.info().dimension).contains(&value)
}

/// Checks the first readings, SI.
pub(crate) fn check(
    controller: &impl Controller,
    readings: impl Iterator<Item = (Channel, f64)>,
) -> Result<(), Box<ImplausibleReading>> {
    let mut implausible = readings.filter(|(channel, value)| !is_plausible(*channel, *value));
    let Some((channel, value)) = implausible.next() else { return Ok(()) };
    let range = measurable(channel.info().dimension);
    Err(Box::new(ImplausibleReading {
        channel,
        value,
        unit: channel.unit(),
        low: *range.start(),
        high: *range.end(),
        source_text: controller.describe_source(channel),
        others: implausible.map(|(channel, _)| channel).collect(),
        remedy: controller.remedy(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_with_few_digits() {
        for (value, expected) in [
            (128_426_750.014_884_53, "1.284e8"),
            (2.26e-27, "2.260e-27"),
            (101_325.25, "101325"),
            (298.15, "298.1"),
            (-1000.0, "-1000"),
            (5e6, "5000000"),
            (0.5, "0.5"),
            (0.0, "0"),
        ] {
            assert_eq!(format_short(value), expected);
        }
    }
}
