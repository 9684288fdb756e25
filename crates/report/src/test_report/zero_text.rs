//! The isothermal zero, as text.

use crate::formatting::display::Display;
use mapper_core::{Channel, half_width_95};
use mapper_identify::{IsothermalZero, ZeroOutcome};
use std::fmt::Write;

/// Columns of [`zero_rows`].
pub const ZERO_HEADS: [&str; 4] = ["sensor", "subtracted", "known within +/-", "unit"];

/// A sentence with the result or the reason for its absence; `None` if no zero was requested.
pub fn zero_words(zero: &ZeroOutcome) -> Option<String> {
    match zero {
        ZeroOutcome::NotRequested => None,
        ZeroOutcome::Refused(reason) => {
            Some(format!("No isothermal zero: {reason}. The declared offsets stand."))
        }
        ZeroOutcome::Found(zero) => Some(format!(
            "At rest, from {:.0} to {:.0} s, all sensors of a kind should read the same; the differences are subtracted. Half \
             widths of 95 % intervals.",
            zero.start_s, zero.end_s
        )),
    }
}

/// A row for each sensor with an offset; none without a zero.
pub fn zero_rows(zero: &ZeroOutcome, display: &Display) -> Vec<[String; 4]> {
    let ZeroOutcome::Found(zero) = zero else { return Vec::new() };
    let row = |(channel, offset): (&Channel, &f64)| {
        let shown = |value: f64| display.difference(*channel, value).unwrap_or(0.0);
        let half = shown(half_width_95(offset_sigma(zero, *channel)));
        // Two significant digits of the half width.
        let decimals = if half > 0.0 && half.is_finite() {
            (1.0 - half.log10().floor()).clamp(0.0, 6.0) as usize
        } else {
            2
        };
        let unit = display.difference_unit(*channel).to_owned();
        [channel.to_string(), format!("{:+.decimals$}", shown(*offset)), format!("{half:.decimals$}"), unit]
    };
    zero.offsets.iter().map(row).collect()
}

fn offset_sigma(zero: &IsothermalZero, channel: Channel) -> f64 {
    zero.left_sigma.get(&channel).copied().unwrap_or(f64::NAN)
}

/// Offsets subtracted from the readings with their uncertainties, or the reason for their absence; empty if no zero was requested.
pub fn zero_text(zero: &ZeroOutcome) -> String {
    match zero {
        ZeroOutcome::NotRequested => String::new(),
        ZeroOutcome::Refused(reason) => {
            format!("\nno isothermal zero: {reason}. The declared offsets stand.\n")
        }
        ZeroOutcome::Found(zero) => {
            let mut text = format!(
                "\nisothermal zero from {:.0} to {:.0} s, subtracted from the readings (+/- 95 %):\n",
                zero.start_s, zero.end_s
            );
            for (channel, offset) in &zero.offsets {
                let half = half_width_95(offset_sigma(zero, *channel));
                // Writing to a String cannot fail.
                let _ = writeln!(text, "  {channel:<6} {offset:+.2} +/- {half:.2} {}", channel.unit());
            }
            text
        }
    }
}
