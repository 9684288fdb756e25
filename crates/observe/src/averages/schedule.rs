//! Segments of a step for averaging readings: short after the jump, long while only the temperature of the metal changes.

/// Difference of equal times, s. Source: recordings store nanoseconds.
pub(crate) const TIME_ROUNDING_S: f64 = 1e-9;

/// Rule for cutting a step into segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Start of the first segment after that of the step, s.
    pub first_s: f64,
    /// Segment lengths: pairs of an end time, from the start of the step, and the length that applies until then, s. The last length applies
    /// without limit.
    pub lengths_s: &'static [(f64, f64)],
    /// Segments shorter than this are merged with the previous one, s ...
    pub shortest_s: f64,
    /// ... and so are those shorter than this share of their nominal length.
    pub shortest_ratio: f64,
}

impl Schedule {
    /// Starts and ends of the segments from `start_s` to `end_s`, without gaps. Each is at least as long as the sample interval `interval_s`.
    /// The list is empty if the step is shorter than the shortest segment.
    pub fn segments(&self, start_s: f64, end_s: f64, interval_s: f64) -> Vec<(f64, f64)> {
        let whole_s = end_s - start_s;
        let mut segments = Vec::new();
        let mut at_s = self.first_s;
        while whole_s - at_s > TIME_ROUNDING_S {
            let row = self.lengths_s.iter().find(|(until_s, _)| at_s < until_s - TIME_ROUNDING_S);
            let length_s = row.or(self.lengths_s.last()).map_or(whole_s, |(_, l)| *l).max(interval_s);
            let shortest_s = self.shortest_s.max(self.shortest_ratio * length_s);
            if whole_s - at_s < shortest_s {
                break;
            }
            let mut next_s = (at_s + length_s).min(whole_s);
            if whole_s - next_s < shortest_s {
                next_s = whole_s;
            }
            segments.push((start_s + at_s, start_s + next_s));
            at_s = next_s;
        }
        segments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: Schedule = Schedule {
        first_s: 5.0,
        lengths_s: &[(15.0, 10.0), (35.0, 20.0), (95.0, 30.0), (f64::INFINITY, 60.0)],
        shortest_s: 5.0,
        shortest_ratio: 0.0,
    };

    #[test]
    fn a_step_of_two_minutes_has_five_segments_without_gaps() {
        let edges = [(105.0, 115.0), (115.0, 135.0), (135.0, 165.0), (165.0, 195.0), (195.0, 220.0)];
        assert_eq!(SLOW.segments(100.0, 220.0, 0.1), edges);
        assert!(SLOW.segments(100.0, 104.0, 0.1).is_empty());
        // Three seconds more than a whole segment belong to it.
        assert_eq!(SLOW.segments(0.0, 38.0, 0.1), [(5.0, 15.0), (15.0, 38.0)]);
    }

    #[test]
    fn no_segment_is_shorter_than_a_sample_or_than_its_share() {
        let fast = Schedule {
            first_s: 0.0,
            lengths_s: &[(1.0, 0.1), (f64::INFINITY, 10.0)],
            shortest_s: 0.0,
            shortest_ratio: 0.5,
        };
        let segments = fast.segments(7.0, 24.0, 0.25);
        assert_eq!(segments.first().map(|s| s.0), Some(7.0));
        assert_eq!(segments.last().map(|s| s.1), Some(24.0));
        assert!(segments.windows(2).all(|pair| pair[0].1 == pair[1].0));
        assert!(segments.iter().all(|(from_s, to_s)| to_s - from_s > 0.24));
    }
}
