//! The isothermal zero, and several sensors of a channel.

use crate::document::{Describe, Document, Table};
use crate::formatting::Display;
use mapper_campaign::Campaign;
use mapper_core::{Channel, half_width_95};
use mapper_identify::ZeroOutcome;
use mapper_observe::FusedChannel;

/// A sentence with the result or the reason for its absence; `None` if no zero was requested.
pub(crate) fn zero_sentence(zero: &ZeroOutcome) -> Option<String> {
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

/// The sentence, and a row for each sensor with an offset; empty if no zero was requested.
pub(crate) fn zero_section(zero: &ZeroOutcome, display: &Display) -> Document {
    let mut document = Document::default();
    document.text(zero_sentence(zero).unwrap_or_default());
    let ZeroOutcome::Found(zero) = zero else { return document };
    let row = |(channel, offset): (&Channel, &f64)| {
        let shown = |value: f64| display.difference(*channel, value).unwrap_or(0.0);
        let half = shown(half_width_95(zero.left_sigma.get(channel).copied().unwrap_or(f64::NAN)));
        // Two significant digits of the half width.
        let decimals = if half > 0.0 && half.is_finite() {
            (1.0 - half.log10().floor()).clamp(0.0, 6.0) as usize
        } else {
            2
        };
        let unit = display.difference_unit(*channel).to_owned();
        [channel.to_string(), format!("{:+.decimals$}", shown(*offset)), format!("{half:.decimals$}"), unit]
    };
    let heads = ["sensor", "subtracted", "known within +/-", "unit"];
    document.table(Table::new(heads).with_texts([3]).rows(zero.offsets.iter().map(row)));
    // The gas of the turbine stays warm longer than a soak lasts.
    let hot_side = [Channel::T3, Channel::T4, Channel::Tt];
    let kept = zero.left_out.iter().filter(|left| !hot_side.contains(&left.channel));
    let kept = kept.map(|left| format!("{} keeps its declared offset: {}", left.channel, left.reason));
    document.list(kept);
    document
}

impl Describe for ZeroOutcome {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.section("Isothermal zero", zero_section(self, &Display::default()));
        document
    }
}

/// A line for each channel that has several sensors: their combination, and the omitted sensors with reasons.
impl Describe for [FusedChannel] {
    fn document(&self) -> Document {
        let mut body = Document::default();
        if !self.is_empty() {
            body.text("Fused by their declared uncertainty (one standard deviation).");
            body.list(self.iter().map(ToString::to_string));
        }
        let mut document = Document::default();
        document.section("Channels with several sensors", body);
        document
    }
}

/// The channels for which a campaign declares several sensors.
pub(crate) fn declared_sensors(campaign: &Campaign) -> Vec<String> {
    let several = campaign.sensors.iter().filter_map(|(channel, sensor)| {
        let fused = FusedChannel {
            channel: *channel,
            sensors: sensor.redundant.as_ref()?.elements.len(),
            left_out: Vec::new(),
            contradiction: None,
            declared: sensor.declared,
            probe_diameter_m: sensor.probe_diameter_m,
        };
        Some(fused.to_string())
    });
    several.collect()
}
