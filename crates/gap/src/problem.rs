//! What forbids a diagnosis: a clear word instead of a confident culprit.

use mapper_core::{Channel, step_number};
use mapper_observe::plausible::Implausible;

/// What forbids a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Nothing measured.
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    /// No steps.
    #[error(
        "the recording has {steps} step(s), and no jump of P3 or valve is seen: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps {
        /// Steps found.
        steps: usize,
    },
    /// Too few outputs.
    #[error(
        "too little is measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; at least N, P2 and T2 are needed"
    )]
    TooFewOutputs {
        /// What is there.
        present: String,
    },
    /// Far from what the nominal machine does under the recorded inputs.
    #[error(
        "{channel} lies {percent:.0} % off what the nominal machine gives under the recorded P3, T3 and valve, at half of the steps or more: this is a recording of another machine, or a scale is wrong; check machine and map of the campaign"
    )]
    OtherMachine {
        /// The channel that is farthest off.
        channel: Channel,
        /// By how much, % of the nominal value (signed).
        percent: f64,
    },
    /// Readings that no running machine has.
    #[error(transparent)]
    Implausible(#[from] Implausible),
    /// A driver is missing altogether.
    #[error("{channel} ({}) drives the model and is not recorded; without it no cause can be identified", .channel.info().description)]
    NoDriver {
        /// The channel.
        channel: Channel,
    },
    /// Nobody knows how far the valve was open.
    #[error(
        "the recording does not say how far the valve was open at step {}, and the model is driven with that: map it as `valve_command`, as commanded or as measured, or give it among `constants`; without it `mapper transient` diagnoses the compressor side from its measured neighbours",
        step_number(*step)
    )]
    NoValve {
        /// Place, from 0, of the first step of which it is not known.
        step: usize,
    },
    /// Measured P3 is nowhere near its command.
    #[error(
        "measured P3 is {measured_pa:.0} Pa where {commanded_pa:.0} Pa is commanded: the two do not belong together; check the channel map and the units"
    )]
    NotCommanded {
        /// Median of the measured P3 in a step, Pa.
        measured_pa: f64,
        /// Its command, Pa.
        commanded_pa: f64,
    },
    /// The healthy recording has another number of steps.
    #[error(
        "the healthy recording has {healthy} step(s), the one under diagnosis {recorded}: only the same steps can be compared; record a healthy run of the same plan"
    )]
    OtherSteps {
        /// In the healthy one.
        healthy: usize,
        /// In the one under diagnosis.
        recorded: usize,
    },
    /// One of its steps is another one.
    #[error(
        "step {} of the healthy recording is another one: {what} {healthy:.3} {unit}, where the recording under diagnosis has {recorded:.3} {unit} (more than {within:.3} apart); record a healthy run of the same plan",
        step_number(*step)
    )]
    OtherStep {
        /// Place of the step, from 0.
        step: usize,
        /// What differs.
        what: &'static str,
        /// In the healthy one.
        healthy: f64,
        /// In the one under diagnosis.
        recorded: f64,
        /// Unit of both.
        unit: &'static str,
        /// By how much they may differ.
        within: f64,
    },
}
