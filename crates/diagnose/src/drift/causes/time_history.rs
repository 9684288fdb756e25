//! Time histories of a drift.

use serde::Serialize;

/// Ramp or step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeHistoryKind {
    /// Grows at a constant rate from its onset.
    Ramp,
    /// Jumps at its onset, then stays constant.
    Step,
}

/// A time history with its onset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeHistory {
    /// Ramp or step.
    pub kind: TimeHistoryKind,
    /// Onset, campaign time, s.
    pub onset_s: f64,
}

impl TimeHistory {
    /// Value at a time, for a rate of 1 per hour or a step of 1.
    pub fn at(self, t_s: f64) -> f64 {
        match self.kind {
            TimeHistoryKind::Ramp => (t_s - self.onset_s).max(0.0) / 3600.0,
            TimeHistoryKind::Step => f64::from(u8::from(t_s >= self.onset_s)),
        }
    }

    /// Mean value between two times, s.
    pub fn mean(self, start_s: f64, end_s: f64) -> f64 {
        let length_s = end_s - start_s;
        let after_s = (end_s - self.onset_s).clamp(0.0, length_s.max(0.0));
        if length_s <= 0.0 {
            return self.at(start_s);
        }
        match self.kind {
            TimeHistoryKind::Step => after_s / length_s,
            TimeHistoryKind::Ramp if after_s < length_s => 0.5 * after_s * after_s / length_s / 3600.0,
            TimeHistoryKind::Ramp => self.at(0.5 * (start_s + end_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_the_integrals() {
        for kind in [TimeHistoryKind::Ramp, TimeHistoryKind::Step] {
            for onset_s in [0.0, 130.0, 150.0, 300.0] {
                let history = TimeHistory { kind, onset_s };
                let parts = 10_000;
                let sum: f64 = (0..parts)
                    .map(|part| history.at(100.0 + 100.0 * (f64::from(part) + 0.5) / f64::from(parts)))
                    .sum();
                // The step falls within one of the 10 000 parts.
                assert!((history.mean(100.0, 200.0) - sum / f64::from(parts)).abs() < 1e-4, "{history:?}");
            }
        }
    }
}
