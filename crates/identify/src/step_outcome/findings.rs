//! Collects the warnings and remarks about a point.

use crate::IdentifyConfig;
use mapper_core::{Verdict, Warning};

/// Stable codes of the warnings.
pub mod code {
    /// The step has no jump before it.
    pub const NO_TRANSIENT: &str = "no_transient";
    /// The window has too few complete samples.
    pub const TOO_FEW_SAMPLES: &str = "too_few_samples";
    /// Samples were lost (NaN, gaps).
    pub const LOST_SAMPLES: &str = "lost_samples";
    /// Outliers of the fit were removed.
    pub const OUTLIERS: &str = "outliers";
    /// Speed, flow or pressure ratio did not stabilise in time.
    pub const NOT_STABILISED: &str = "not_stabilised";
    /// The requested window does not fit into the step.
    pub const WINDOW_CUT: &str = "window_cut";
    /// The signal in the window is too small to separate efficiency from heat transfer.
    pub const SMALL_GRADIENT: &str = "small_gradient";
    /// Declared offsets make the efficiency uncertain, whatever the signal.
    pub const OFFSETS_DOMINATE: &str = "offsets_dominate";
    /// Noise makes the efficiency uncertain, although the signal is large enough.
    pub const NOISE_DOMINATES: &str = "noise_dominates";
    /// The residual is larger than noise.
    pub const POOR_FIT: &str = "poor_fit";
    /// The flow, and therefore h, changed within the window.
    pub const FLOW_MOVED: &str = "flow_moved";
    /// The best fit lies on a bound.
    pub const AT_BOUND: &str = "at_bound";
    /// The fit did not converge.
    pub const FIT_FAILED: &str = "fit_failed";
    /// Temperatures are still drifting (steady method).
    pub const NOT_SETTLED: &str = "not_settled";
    /// The efficiency includes heat transfer (steady method).
    pub const APPARENT: &str = "apparent";
    /// No compression: the efficiency is undefined.
    pub const NO_COMPRESSION: &str = "no_compression";
    /// No sensor uncertainty was declared.
    pub const NOTHING_DECLARED: &str = "nothing_declared";
    /// A channel is frozen or saturated.
    pub const FROZEN_CHANNEL: &str = "frozen_channel";
    /// A channel is outside the range of a running machine.
    pub const DEAD_CHANNEL: &str = "dead_channel";
    /// A channel has a wrong scale, an offset or a drift.
    pub const SCALED_CHANNEL: &str = "scaled_channel";
    /// Two channels are swapped.
    pub const SWAPPED_CHANNELS: &str = "swapped_channels";
    /// Channels contradict each other.
    pub const CONTRADICTED_CHANNEL: &str = "contradicted_channel";
    /// A channel has far more noise than declared.
    pub const NOISY_CHANNEL: &str = "noisy_channel";
    /// A channel lags the others.
    pub const LATE_CHANNEL: &str = "late_channel";
    /// Steps overlap, or share an index.
    pub const STEPS_CONTRADICT: &str = "steps_contradict";
    /// A noisy channel was stuck.
    pub const STUCK: &str = "stuck";
    /// The efficiency depends on an alpha_A that is not known well enough (dynamic method).
    pub const ASSUMED_ALPHA: &str = "assumed_alpha";
    /// The step is excluded from the shared parameters (joint method).
    pub const LEFT_OUT: &str = "left_out";
    /// The point's h is far from the convection law of the others (joint method).
    pub const OFF_THE_LAW: &str = "off_the_law";
    /// The joint model as a whole is doubtful.
    pub const MODEL_DOUBTED: &str = "model_doubted";
    /// The efficiencies differ from the nominal map by more than its declared tolerances (joint method).
    pub const OFF_THE_NOMINAL_MAP: &str = "off_the_nominal_map";
    /// The step has no transient of its own: its efficiency depends on the shared parameters (joint method).
    pub const THROUGH_THE_LAW: &str = "through_the_law";
    /// The recording is too short, or its gradients too small, to detect a wrong declaration.
    pub const RESTS_ON_DECLARATION: &str = "rests_on_declaration";
    /// The step did not reach its speed setpoint.
    pub const SPEED_NOT_REACHED: &str = "speed_not_reached";
    /// Part of the state at the step's end is not from its last seconds.
    pub const END_STATE: &str = "end_state";
}

/// Warnings with the resulting verdict.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Findings {
    pub(crate) verdict: Verdict,
    /// Doubts before remarks.
    pub(crate) warnings: Vec<Warning>,
    doubts: usize,
}

impl Findings {
    pub(crate) fn new() -> Self {
        Findings { verdict: Verdict::Good, warnings: Vec::new(), doubts: 0 }
    }

    /// Adds a remark, which does not affect the verdict.
    pub(crate) fn remark(&mut self, code: &str, message: impl Into<String>) {
        self.warnings.push(Warning { code: code.to_owned(), message: message.into() });
    }

    /// Adds the findings of another check.
    pub(crate) fn take(&mut self, other: Findings) {
        let mut doubts = other.warnings;
        self.warnings.extend(doubts.split_off(other.doubts));
        for doubt in doubts {
            self.warn(self.doubts, doubt);
        }
        self.verdict = match (self.verdict, other.verdict) {
            (Verdict::Unusable, _) | (_, Verdict::Unusable) => Verdict::Unusable,
            (Verdict::Doubtful, _) | (_, Verdict::Doubtful) => Verdict::Doubtful,
            _ => Verdict::Good,
        };
    }

    pub(crate) fn doubt(&mut self, code: &str, message: impl Into<String>) {
        self.warn(self.doubts, Warning { code: code.to_owned(), message: message.into() });
        self.verdict = self.verdict.doubted();
    }

    /// Remarks that no interval includes undeclared errors.
    pub(crate) fn remark_undeclared(&mut self, config: &IdentifyConfig) {
        if config.declared.is_empty() {
            let message = "no sensor uncertainty was declared: the interval holds noise alone";
            self.remark(code::NOTHING_DECLARED, message);
        }
    }

    /// Adds a doubt about the readings themselves, before all others.
    pub(crate) fn doubt_first(&mut self, code: &str, message: String) {
        self.warn(0, Warning { code: code.to_owned(), message });
        self.verdict = self.verdict.doubted();
    }

    pub(crate) fn refuse(&mut self, code: &str, message: impl Into<String>) {
        self.warn(self.doubts, Warning { code: code.to_owned(), message: message.into() });
        self.verdict = Verdict::Unusable;
    }

    /// Adds a doubt in order: short displays show only the first warning, which must be the reason for the verdict.
    fn warn(&mut self, place: usize, doubt: Warning) {
        self.warnings.insert(place, doubt);
        self.doubts += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubts_come_before_remarks_whatever_was_found_first() {
        let (mut findings, mut other) = (Findings::new(), Findings::new());
        findings.remark(code::OUTLIERS, "two samples are left out");
        findings.doubt(code::SMALL_GRADIENT, "T2 hardly moves");
        other.remark(code::THROUGH_THE_LAW, "no jump");
        other.refuse(code::AT_BOUND, "on a bound");
        findings.take(other);
        findings.doubt_first(code::DEAD_CHANNEL, "T2 is dead".to_owned());
        let codes: Vec<&str> = findings.warnings.iter().map(|warning| warning.code.as_str()).collect();
        let expected =
            [code::DEAD_CHANNEL, code::SMALL_GRADIENT, code::AT_BOUND, code::OUTLIERS, code::THROUGH_THE_LAW];
        assert_eq!(codes, expected);
        assert_eq!(findings.verdict, Verdict::Unusable);
    }
}
