//! When a cause acts: its onset and its shape.

/// Onset and shape of a cause along the positions of a recording: times, or numbers of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeHistory {
    /// Position of its onset; minus infinity if it acts throughout.
    pub onset: f64,
    /// Its shape from there on.
    pub shape: Shape,
}

/// Shape of a cause from its onset on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// At full size.
    Step,
    /// Grows by its full size in each of these lengths.
    Ramp(f64),
    /// At full size, then decays with this constant.
    Decay(f64),
}

impl TimeHistory {
    /// Acts throughout.
    pub const THROUGHOUT: TimeHistory = TimeHistory { onset: f64::NEG_INFINITY, shape: Shape::Step };

    /// Value at a position, as a share of the full size.
    pub fn at(self, position: f64) -> f64 {
        let since = position - self.onset;
        match self.shape {
            Shape::Step => f64::from(u8::from(position >= self.onset)),
            Shape::Ramp(length) => since.max(0.0) / length,
            Shape::Decay(constant) => {
                if since >= 0.0 {
                    (-since / constant).exp()
                } else {
                    0.0
                }
            }
        }
    }

    /// Mean value between two positions; the value at the first one if the second one is not after it.
    pub fn mean(self, start: f64, end: f64) -> f64 {
        let length = end - start;
        if length <= 0.0 {
            return self.at(start);
        }
        let acting = (end - self.onset).clamp(0.0, length);
        match self.shape {
            Shape::Step => acting / length,
            Shape::Ramp(full) if acting < length => 0.5 * acting * acting / length / full,
            Shape::Ramp(_) => self.at(0.5 * (start + end)),
            Shape::Decay(constant) => (self.at(end - acting) - self.at(end)) * constant / length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_the_integrals() {
        for shape in [Shape::Step, Shape::Ramp(3600.0), Shape::Decay(30.0)] {
            for onset in [0.0, 130.0, 150.0, 300.0] {
                let history = TimeHistory { onset, shape };
                let parts = 10_000;
                let sum: f64 = (0..parts)
                    .map(|part| history.at(100.0 + 100.0 * (f64::from(part) + 0.5) / f64::from(parts)))
                    .sum();
                // The step falls within one of the 10 000 parts.
                assert!((history.mean(100.0, 200.0) - sum / f64::from(parts)).abs() < 1e-4, "{history:?}");
            }
        }
    }

    #[test]
    fn what_acts_throughout_has_full_size_everywhere() {
        let history = TimeHistory::THROUGHOUT;
        assert_eq!([history.at(-1e9), history.at(0.0), history.mean(0.0, 9.0)], [1.0; 3]);
    }
}
