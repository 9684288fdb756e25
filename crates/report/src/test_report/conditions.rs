//! Declared conditions of rig and cell compared with the readings.

use crate::formatting::display::Display;
use crate::point_results::end_readings::at_end;
use mapper_campaign::Campaign;
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::mean;

/// Columns of [`condition_rows`].
pub const CONDITION_HEADS: [&str; 6] = ["condition", "declared", "mean", "min", "max", "unit"];

/// A row for each condition with readings: name, declared value, and mean, minimum and maximum of its readings at the ends of the steps.
pub fn condition_rows(
    campaign: Option<&Campaign>,
    recording: &Recording,
    display: &Display,
) -> Vec<[String; 6]> {
    let boundary = campaign.map(|campaign| &campaign.boundary);
    // A condition that follows the compressor's outlet has no single value.
    let follows = campaign.map(|campaign| campaign.follow_outlet).unwrap_or_default();
    let conditions = [
        (Channel::T1, "inlet temperature T1, total", boundary.map(|b| b.t1_k)),
        (Channel::P1, "inlet pressure P1", boundary.map(|b| b.p1_pa)),
        (
            Channel::T3,
            "turbine inlet temperature T3, total",
            boundary.map(|b| b.t3_k).filter(|_| !follows.turbine_inlet),
        ),
        (Channel::P4, "turbine outlet pressure P4", boundary.map(|b| b.p4_pa)),
        (Channel::TOil, "oil temperature", boundary.map(|b| b.oil_temperature_k).filter(|_| !follows.oil)),
        (Channel::TAmb, "ambient temperature", boundary.map(|b| b.ambient_temperature_k)),
    ];
    let rows = conditions.into_iter().filter_map(|(channel, name, declared)| {
        let read: Vec<f64> =
            recording.steps.iter().filter_map(|step| at_end(recording, step, channel)).collect();
        let average = mean(&read)?;
        let lowest = read.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = read.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let format = |value: f64| display.shown_reading(channel, value);
        Some([
            name.to_owned(),
            declared.map_or_else(|| "-".to_owned(), format),
            format(average),
            format(lowest),
            format(highest),
            display.unit_of(channel).to_owned(),
        ])
    });
    rows.collect()
}
