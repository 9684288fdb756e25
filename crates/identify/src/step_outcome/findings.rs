//! Collects the warnings and remarks about a point.

use crate::IdentifyConfig;
use mapper_core::{PoorFit, Verdict, Warning};

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
}
