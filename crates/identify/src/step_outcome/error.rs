//! Errors that stop identification altogether, and reasons why a single step gives no point.

use crate::needs::names;
use mapper_core::{Channel, Method, step_number};

/// Why a recording cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// Channels that the method needs are missing.
    #[error(
        "the {method} method needs {}; the recording has none of them. Name their fields in the channel map{}",
        names(missing),
        without_the_housing(missing)
    )]
    MissingChannels {
        /// The requested method.
        method: Method,
        /// The missing channels.
        missing: Vec<Channel>,
    },
    /// The recording has no steps to identify.
    #[error(
        "the recording has no steps: it has no step markers, and its command channels never change. Map P3_command and valve_command"
    )]
    NoSteps,
    /// A value of the configuration is out of range.
    #[error("{name} = {value} is not usable: {expected}")]
    Config {
        /// Name of the value.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range.
        expected: &'static str,
    },
}

/// Why a single step gives no point at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The step has no duration.
    #[error("step {} runs from {start_s} s to {end_s} s, which is not a valid time span", step_number(*step))]
    NoDuration {
        /// Position of the step, from 0.
        step: usize,
        /// Start of the step, s.
        start_s: f64,
        /// End of the step, s.
        end_s: f64,
    },
    /// A quantity that every point needs was never measured in the step.
    #[error(
        "step {} ({start_s:.1} s to {end_s:.1} s) has no usable sample of {channel}, so its place on the map is unknown",
        step_number(*step)
    )]
    NoState {
        /// Position of the step, from 0.
        step: usize,
        /// Start of the step, s.
        start_s: f64,
        /// End of the step, s.
        end_s: f64,
        /// The missing quantity.
        channel: Channel,
    },
}

/// Advice if only the housing temperature is missing.
fn without_the_housing(missing: &[Channel]) -> &'static str {
    match missing {
        [Channel::Tc] => "; without it the method `steady` gives conventional efficiencies",
        _ => "",
    }
}
