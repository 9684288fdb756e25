//! Errors that stop identification altogether, and reasons why a single step gives no point.

use mapper_core::{Channel, Method, step_number};

/// Why a recording cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum IdentifyError {
    #[error(
        "the {method} method needs {}; the recording has none of them. Name their fields in the channel map{}",
        names(missing),
        without_the_housing(missing)
    )]
    MissingChannels { method: Method, missing: Vec<Channel> },
    #[error(
        "the recording has no steps: it has no step markers, and its command channels never change. Map P3_command and valve_command, or give the whole file if it was cut"
    )]
    NoSteps,
    #[error("{name} = {value} is not usable: {expected}")]
    Config { name: &'static str, value: f64, expected: &'static str },
}

/// Why a single step gives no point at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StepError {
    #[error("step {} runs from {start_s} s to {end_s} s, which is not a valid time span", step_number(*step))]
    NoDuration { step: usize, start_s: f64, end_s: f64 },
    #[error(
        "step {} ({start_s:.1} s to {end_s:.1} s) has no usable sample of {channel}, so its place on the map is unknown",
        step_number(*step)
    )]
    NoState { step: usize, start_s: f64, end_s: f64, channel: Channel },
}

/// Advice if only the housing temperature is missing.
fn without_the_housing(missing: &[Channel]) -> &'static str {
    match missing {
        [Channel::Tc] => "; without it the method `steady` gives conventional efficiencies",
        _ => "",
    }
}

/// Symbols with descriptions.
fn names(channels: &[Channel]) -> String {
    let named = |channel: &Channel| format!("{channel} ({})", channel.info().description);
    channels.iter().map(named).collect::<Vec<_>>().join(", ")
}
