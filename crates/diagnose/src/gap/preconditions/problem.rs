//! Conditions that prevent a diagnosis, reported instead of a wrong cause.

use crate::gap::residuals::study::PredictError;
use mapper_core::{Channel, step_number};
use mapper_observe::plausible::Implausible;

/// Condition that prevents a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Problem {
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    #[error(
        "the recording has {steps} step(s) and too few jumps of P3 or valve: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps { steps: usize },
    #[error(
        "too few channels are measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; record at least N, P2 and T2"
    )]
    TooFewOutputs { present: String },
    /// `percent`: signed, of the nominal value, for the channel that deviates most.
    #[error(
        "{channel} deviates by {percent:.0} % from the nominal machine under the recorded P3, T3 and valve, in at least half of the steps: the recording is of another machine, or a scale is wrong; check machine and map of the campaign"
    )]
    OtherMachine { channel: Channel, percent: f64 },
    #[error(transparent)]
    Implausible(#[from] Implausible),
    #[error("{channel} ({}) drives the model and is not recorded: record it and map its column", .channel.info().description)]
    NoDriver { channel: Channel },
    #[error(
        "the valve opening of step {} is not recorded, but it drives the model: map the commanded or measured opening as `valve_command`, or give it among `constants`; without it, `mapper transient` diagnoses the compressor side from its measured neighbours",
        step_number(*step)
    )]
    NoValve { step: usize },
    /// Medians of a step.
    #[error(
        "measured P3 is {measured_pa:.0} Pa where {commanded_pa:.0} Pa is commanded: the two do not belong together; check the channel map and the units"
    )]
    NotCommanded { measured_pa: f64, commanded_pa: f64 },
    #[error(
        "the baseline has {baseline} step(s), the recording under diagnosis {recorded}, but only equal steps can be compared: record a baseline of the same plan"
    )]
    OtherSteps { baseline: usize, recorded: usize },
    #[error(
        "step {} of the baseline differs: its {what} is {baseline:.3} {unit}, that of the recording under diagnosis {recorded:.3} {unit} (allowed difference {within:.3} {unit}); record a baseline of the same plan",
        step_number(*step)
    )]
    OtherStep {
        step: usize,
        what: &'static str,
        baseline: f64,
        recorded: f64,
        unit: &'static str,
        within: f64,
    },
}

/// Why a recording cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum GapError {
    /// The recording does not fit the campaign, or required data are missing.
    #[error(transparent)]
    Recording(#[from] Problem),
    #[error(
        "the nominal model cannot follow this recording: {0}; check that the recording is of this machine"
    )]
    Predict(#[from] PredictError),
}
