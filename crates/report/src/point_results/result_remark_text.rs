//! Sentences of the remarks on results.

use crate::message::Message;
use mapper_core::{Method, ResultRemark, half_width_95, probability_text};

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
