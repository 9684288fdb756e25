//! The minimum of a signal over a sliding window, in constant time per sample.

use std::collections::VecDeque;

/// Longest window, s. It limits the memory.
const WINDOW_MAX_S: f64 = 600.0;
/// Minimum spacing of the stored values, s. It limits the memory for fast rigs; a lower value is always stored.
const SPACING_S: f64 = 0.05;

/// Candidates for the minimum: each value is lower than all later ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RecentMinimum {
    increasing: VecDeque<(f64, f64)>,
}

impl RecentMinimum {
    /// Adds a value, and returns the lowest one of the last `window_s`, this one included.
    pub(crate) fn update(&mut self, t_s: f64, value: f64, window_s: f64) -> f64 {
        let mut kept_since_s = t_s;
        while let Some((then_s, _)) = self.increasing.back().filter(|(_, earlier)| *earlier >= value) {
            kept_since_s = *then_s;
            self.increasing.pop_back();
        }
        let is_close = self.increasing.back().is_some_and(|(then_s, _)| t_s - then_s < SPACING_S);
        if !is_close || kept_since_s < t_s {
            self.increasing.push_back((t_s, value));
        }
        let window_s = window_s.min(WINDOW_MAX_S);
        while self.increasing.front().is_some_and(|(then_s, _)| t_s - then_s > window_s) {
            self.increasing.pop_front();
        }
        self.increasing.front().map_or(value, |(_, lowest)| lowest.min(value))
    }
}

#[cfg(test)]
mod tests {
    use super::RecentMinimum;

    /// Compared with a search through all values.
    #[test]
    fn it_returns_the_minimum_of_the_window() {
        let value = |i: u32| f64::from(i * 7919 % 101);
        let mut fast = RecentMinimum::default();
        for i in 0..500_u32 {
            let expected = (i.saturating_sub(20)..=i).map(value).fold(f64::INFINITY, f64::min);
            assert_eq!(fast.update(0.1 * f64::from(i), value(i), 2.0 + 1e-9), expected, "{i}");
        }
    }
}
