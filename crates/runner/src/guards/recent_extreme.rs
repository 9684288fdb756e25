//! The lowest value within a time, in constant time per sample.

use std::collections::VecDeque;

/// Longest window, s: bounds the memory.
const WINDOW_MAX_S: f64 = 600.0;
/// Minimum spacing of the kept values, s. It bounds the memory for fast rigs; a lower value is always kept.
const SPACING_S: f64 = 0.05;

/// Times and values of which each is lower than all later ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RecentExtreme {
    rising: VecDeque<(f64, f64)>,
}

impl RecentExtreme {
    /// Adds a value, and returns the lowest one of the last `window_s`, this one included.
    pub(crate) fn lowest(&mut self, t_s: f64, value: f64, window_s: f64) -> f64 {
        let mut kept_since_s = t_s;
        while let Some((then_s, _)) = self.rising.back().filter(|(_, then)| *then >= value) {
            kept_since_s = *then_s;
            self.rising.pop_back();
        }
        let near = self.rising.back().is_some_and(|(then_s, _)| t_s - then_s < SPACING_S);
        if !near || kept_since_s < t_s {
            self.rising.push_back((t_s, value));
        }
        let window_s = window_s.min(WINDOW_MAX_S);
        while self.rising.front().is_some_and(|(then_s, _)| t_s - then_s > window_s) {
            self.rising.pop_front();
        }
        self.rising.front().map_or(value, |(_, lowest)| lowest.min(value))
    }
}

#[cfg(test)]
mod tests {
    use super::RecentExtreme;

    /// Against a search through all values.
    #[test]
    fn it_is_the_lowest_of_the_window() {
        let value = |i: u32| f64::from(i * 7919 % 101);
        let mut fast = RecentExtreme::default();
        for i in 0..500_u32 {
            let expected = (i.saturating_sub(20)..=i).map(value).fold(f64::INFINITY, f64::min);
            assert_eq!(fast.lowest(0.1 * f64::from(i), value(i), 2.0 + 1e-9), expected, "{i}");
        }
    }
}
