//! Collects the warnings and remarks about a point, and says why an efficiency is uncertain: too small a signal, offsets, or noise.

use crate::IdentifyConfig;
use mapper_core::{EstimateUncertainty, EtaSignal, PoorFit, Verdict, Warning, WideInterval};

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
    pub(crate) fn remark(&mut self, warning: Warning) {
        self.warnings.push(warning);
    }

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

    pub(crate) fn doubt(&mut self, warning: Warning) {
        self.warn(self.doubts, warning);
        self.verdict = self.verdict.doubted();
    }

    /// Remarks that no interval includes undeclared errors.
    pub(crate) fn remark_undeclared(&mut self, config: &IdentifyConfig) {
        if config.declared.is_empty() {
            self.remark(Warning::NothingDeclared);
        }
    }

    /// Adds a doubt about the readings themselves, before all others.
    pub(crate) fn doubt_first(&mut self, warning: Warning) {
        self.warn(0, warning);
        self.verdict = self.verdict.doubted();
    }

    /// Refuses an efficiency above that of an ideal compression.
    pub(crate) fn refuse_impossible(&mut self, eta: f64) {
        if eta > 1.0 {
            self.refuse(Warning::PoorFit(PoorFit::Eta { eta }));
        }
    }

    pub(crate) fn refuse(&mut self, warning: Warning) {
        self.warn(self.doubts, warning);
        self.verdict = Verdict::Unusable;
    }

    /// Adds a doubt in order: short displays show only the first warning, which must be the reason for the verdict.
    fn warn(&mut self, place: usize, doubt: Warning) {
        self.warnings.insert(place, doubt);
        self.doubts += 1;
    }
}

/// Marks an efficiency as doubtful or unusable if its interval is too wide. `dt2_k`: change of T2 in the window; `shared`: whether shared parameters
/// contribute to its errors.
pub(crate) fn judge_interval(
    eta: EstimateUncertainty,
    dt2_k: f64,
    shared: bool,
    config: &IdentifyConfig,
    findings: &mut Findings,
) {
    let limits = &config.thresholds;
    let (eta_sigma, needed_dt2_k) = (eta.combined_standard_error(), limits.dt2_k);
    let warning = match dt2_k.abs() < needed_dt2_k {
        true => Warning::SmallGradient { dt2_k, needed_dt2_k, eta_sigma },
        false => wide_interval(eta, EtaSignal::Transient { dt2_k, shared }),
    };
    if eta_sigma > limits.unusable_sigma_eta {
        findings.refuse(warning);
    } else {
        findings.doubt(warning);
    }
}

/// The dominant origin of a wide interval.
pub(crate) fn wide_interval(eta: EstimateUncertainty, signal: EtaSignal) -> Warning {
    let (eta_noise_sigma, eta_bias_sigma) = (eta.noise_standard_error, eta.bias_standard_error);
    let interval = WideInterval { eta_noise_sigma, eta_bias_sigma, signal };
    match eta_bias_sigma >= eta_noise_sigma {
        true => Warning::OffsetsDominate(interval),
        false => Warning::NoiseDominates(interval),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Bound, Channel};

    #[test]
    fn doubts_come_before_remarks_whatever_was_found_first() {
        let (mut findings, mut other) = (Findings::new(), Findings::new());
        let [spikes, dead, no_jump] = [
            Warning::Outliers { count: 2 },
            Warning::DeadChannel { channel: Channel::T2, reading: 0.0 },
            Warning::FromConvectionLaw { convection_origin: None },
        ];
        let (law, bound) =
            (Warning::OffTheLaw { h_deviation_ratio: 0.1 }, Warning::AtBound(Bound::Eta { eta: 1.5 }));
        findings.remark(spikes.clone());
        findings.doubt(law.clone());
        other.remark(no_jump.clone());
        other.refuse(bound.clone());
        findings.take(other);
        findings.doubt_first(dead.clone());
        assert_eq!(findings.warnings, [dead, law, bound, spikes, no_jump]);
        assert_eq!(findings.verdict, Verdict::Unusable);
    }

    #[test]
    fn each_cause_has_its_own_code() {
        let table = [
            (0.05, 0.01, 0.2, "small_gradient"),
            (0.01, 0.05, 0.2, "small_gradient"),
            (0.01, 0.05, -39.0, "offsets_dominate"),
            (0.05, 0.01, -39.0, "noise_dominates"),
        ];
        for (noise_standard_error, bias_standard_error, dt2_k, expected) in table {
            let eta = EstimateUncertainty { noise_standard_error, bias_standard_error };
            let mut findings = Findings::new();
            judge_interval(eta, dt2_k, false, &IdentifyConfig::default(), &mut findings);
            assert_eq!(findings.warnings[0].code(), expected);
        }
    }
}
