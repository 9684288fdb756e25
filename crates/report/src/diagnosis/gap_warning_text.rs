//! Sentences of the limits of a diagnosis.

use crate::message::Message;
use mapper_diagnose::gap::{GapWarning, OffsetAtRest};

impl Message for GapWarning {
    fn message(&self) -> String {
        match self {
            GapWarning::ChannelNotRecorded { channel } => format!(
                "{channel} ({}) is not recorded: effects that show only there cannot be found",
                channel.info().description
            ),
            GapWarning::InputNotRecorded { channel } => {
                format!("{channel} is not recorded: the campaign's value is used")
            }
            GapWarning::GapsInRecording { gaps, missing_s } => format!(
                "the recording has {gaps} gap(s), {missing_s:.1} s in total; blocks without samples are omitted"
            ),
            GapWarning::AssumedNoise { channel, noise_sigma } => format!(
                "no noise is declared for {channel}: that of a typical sensor is used, {noise_sigma} {}",
                channel.unit()
            ),
            GapWarning::UncertainTimes { scatter_s } => format!(
                "the times of the samples are off by {:.0} ms, as P3 shows where it jumps: readings that change have accordingly less weight",
                1e3 * scatter_s
            ),
            GapWarning::BaselineRecording { warning } => {
                format!("the reference recording: {}", warning.message())
            }
            GapWarning::Drift { reason, subtracted: true } => {
                format!(
                    "drift while the recording was made: {reason} It was subtracted from the readings before the diagnosis."
                )
            }
            GapWarning::Drift { reason, subtracted: false } => format!(
                "drift while the recording was made: {reason} The diagnosis assumes a rig that does not change, so no cause is named."
            ),
            GapWarning::DriftNotSubtracted { reason } => {
                format!(
                    "a drift was found and not subtracted, because the residual without it is only noise: {reason}"
                )
            }
            GapWarning::RecordingIncomplete { reason } => reason.clone(),
            GapWarning::Other { message, .. } if !message.is_empty() => message.clone(),
            other => other.code().to_owned(),
        }
    }
}

/// What a sensor reads at rest.
impl Message for OffsetAtRest {
    fn message(&self) -> String {
        let OffsetAtRest { channel, offset, declared_sigma } = self;
        format!(
            "{channel} reads {:.2} {unit} too {} at rest, where {declared_sigma:.2} {unit} are declared",
            offset.abs(),
            if *offset > 0.0 { "high" } else { "low" },
            unit = channel.unit(),
        )
    }
}
