//! Time histories of a drift.

use serde::Serialize;

/// Steady change, or a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CourseKind {
    /// Grows steadily from the onset on.
    Ramp,
    /// Jumps at the onset and stays.
    Step,
}

/// A time history with its onset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Course {
    /// Ramp or step.
    pub kind: CourseKind,
    /// Onset, campaign time, s.
    pub onset_s: f64,
}

impl Course {
    /// Size at a time for a rate of 1 per hour, or a step of 1.
    pub fn at(self, t_s: f64) -> f64 {
        match self.kind {
            CourseKind::Ramp => (t_s - self.onset_s).max(0.0) / 3600.0,
            CourseKind::Step => f64::from(u8::from(t_s >= self.onset_s)),
        }
    }

    /// Mean size over a segment.
    pub fn mean(self, start_s: f64, end_s: f64) -> f64 {
        let length_s = end_s - start_s;
        let after_s = (end_s - self.onset_s).clamp(0.0, length_s.max(0.0));
        if length_s <= 0.0 {
            return self.at(start_s);
        }
        match self.kind {
            CourseKind::Step => after_s / length_s,
            CourseKind::Ramp if after_s < length_s => 0.5 * after_s * after_s / length_s / 3600.0,
            CourseKind::Ramp => self.at(0.5 * (start_s + end_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_the_integrals() {
        for kind in [CourseKind::Ramp, CourseKind::Step] {
            for onset_s in [0.0, 130.0, 150.0, 300.0] {
                let course = Course { kind, onset_s };
                let parts = 10_000;
                let sum: f64 = (0..parts)
                    .map(|part| course.at(100.0 + 100.0 * (f64::from(part) + 0.5) / f64::from(parts)))
                    .sum();
                // The step falls within one of the 10 000 parts.
                assert!((course.mean(100.0, 200.0) - sum / f64::from(parts)).abs() < 1e-4, "{course:?}");
            }
        }
    }
}
