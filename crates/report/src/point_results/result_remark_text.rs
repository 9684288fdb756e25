//! Sentences of the remarks on results.

use crate::formatting::significant_digits;
use crate::message::Message;
use mapper_core::unit_factors::ICE_POINT_K;
use mapper_core::{Dimension, Method, ResultRemark, half_width_95, probability_text};

impl Message for ResultRemark {
    fn message(&self) -> String {
        match self {
            ResultRemark::RecordingIncomplete { file: Some(file), reason } => format!("{file}: {reason}"),
            ResultRemark::RecordingIncomplete { file: None, reason }
            | ResultRemark::FormatNotWritten { reason } => reason.clone(),
            ResultRemark::ConventionalMapping { usual, missing } => {
                let named =
                    missing.iter().map(|channel| format!("{channel} ({})", channel.info().description));
                format!(
                    "the recording has no {}, which `{usual}` needs: the efficiencies are those of conventional mapping (`{}`), in which \
                     heat that the housing takes or gives counts as work; no heat-transfer coefficient is identified",
                    named.collect::<Vec<_>>().join(", "),
                    Method::Steady
                )
            }
            ResultRemark::HeldFixed { parameters } => format!(
                "held fixed as declared (`identification.joint`): {}; if the declaration is wrong, all efficiencies and intervals are wrong",
                parameters.join(", ")
            ),
            ResultRemark::UnknownAmbientPressure { pressure_pa, sigma_pa } => format!(
                "the ambient pressure is unknown: it counts as {:.1} kPa with a standard uncertainty of {:.0} kPa, which the intervals include; \
                 write what the barometer read or the altitude of the stand as `ambient_pressure` in the channel map",
                1e-3 * pressure_pa,
                1e-3 * sigma_pa
            ),
            ResultRemark::UnusedRest { start_s, end_s } => format!(
                "from {start_s:.0} to {end_s:.0} s, before the first step, the machine rests and its sensors read alike: \
                 `zero: {{soak: {:.0} min}}` in the campaign subtracts what they read differently there, which leaves less of the declared \
                 offsets in the intervals",
                (end_s - start_s) / 60.0
            ),
            ResultRemark::CellContradicts { channel, reading, reference, common_sigma } => {
                let (sensors, instrument, unit, scale, zero) = match channel.info().dimension {
                    Dimension::Pressure => ("pressure sensors", "declared barometer", "kPa", 1e-3, 0.0),
                    _ => ("thermometers", "cell's thermometer", "degC", 1.0, ICE_POINT_K),
                };
                let unit_of_difference = if unit == "kPa" { "kPa" } else { "K" };
                format!(
                    "at rest all {sensors} together read {:.2} {unit}, and the {instrument} {:.2} {unit}: one of them is wrong by {:+.2} \
                     {unit_of_difference}; every interval contains an error of {:.2} {unit_of_difference} of all {sensors}; check the {instrument} \
                     and the calibration of the {sensors}",
                    scale * (reading - zero),
                    scale * (reference - zero),
                    scale * (reading - reference),
                    scale * half_width_95(*common_sigma)
                )
            }
            ResultRemark::PeriodicError { channel, period_s, amplitude } => format!(
                "{channel} has a periodic error at rest, {} {} with a period of {period_s:.0} s as recorded: pick-up of the mains that the sampling \
                 folds down, for example; it counts as noise of this sensor, so that it is taken for no fault; check screen, earth and filter",
                significant_digits(*amplitude, 2),
                channel.unit()
            ),
            ResultRemark::Corrected { causes, probability } => format!(
                "corrected for {}, which the diagnosis of this recording names with {}: without this correction the efficiencies differ",
                causes.join(" + "),
                probability_text(*probability)
            ),
            ResultRemark::WidenedByGap { causes, largest_sigma } => format!(
                "the rig departs from its model, and the cause is not certain ({}): the efficiencies are not corrected, and every interval is widened by the possible effect of the cause, up to +/- {:.1} points",
                if causes.is_empty() { "not in the effect library".to_owned() } else { causes.join(" or ") },
                100.0 * half_width_95(*largest_sigma)
            ),
            ResultRemark::DriftSubtracted { reason } => {
                format!("the drift of a sensor was subtracted: {reason}")
            }
            ResultRemark::NoMap { reason } => format!("there is no map: {reason}"),
            ResultRemark::MapNotFitted { reason } => format!("the map is not fitted: {reason}"),
            ResultRemark::NothingToCompare { run } => format!("{run} has no map to compare this one with"),
            ResultRemark::Other { message, .. } if !message.is_empty() => message.clone(),
            other => other.code().to_owned(),
        }
    }
}
