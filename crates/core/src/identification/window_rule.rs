//! The evaluated part of a step.

use serde::{Deserialize, Serialize};

/// Part of each step that is evaluated by the methods that use the transient.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowRule {
    /// From the time when speed, flow and pressure ratio have settled to the end of the step.
    #[default]
    Auto,
    /// From `start_s` to `end_s` after the jump; cut at the step's end.
    Fixed {
        /// Start after the jump, s.
        start_s: f64,
        /// End after the jump, s; after the start, within the dwell.
        end_s: f64,
    },
}

impl WindowRule {
    /// Earliest start of an automatic window after the last change of a command, s: the typical time in Burke et al.,
    /// and the time that probes of 1.5 mm need to follow.
    pub const EARLIEST_S: f64 = 10.0;
    /// Shortest useful window, s. A step that settles later uses a window of this length at its end, and is doubtful.
    pub const SHORTEST_S: f64 = 30.0;

    /// Fraction at the end of a step in which its operating point must have settled, for methods that evaluate the step from
    /// its jump on. The point's state is the mean of the last seconds, but an oscillating step may be steady for a moment only. Judgement.
    const SETTLED_END_RATIO: f64 = 0.25;

    /// Length of this part for a step of `dwell_s`, s: at most [`Self::SHORTEST_S`].
    pub fn settled_end_s(dwell_s: f64) -> f64 {
        (Self::SETTLED_END_RATIO * dwell_s).min(Self::SHORTEST_S)
    }

    /// Start and end of the window of a step that lasts `dwell_s`, s after its jump, if the operating point settles
    /// `settle_s` after the jump (`None`: never within the step).
    pub fn of_step_s(&self, settle_s: Option<f64>, dwell_s: f64) -> (f64, f64) {
        match *self {
            WindowRule::Fixed { start_s, end_s } => (start_s, end_s.min(dwell_s)),
            WindowRule::Auto => {
                let latest_s = (dwell_s - Self::SHORTEST_S).max(Self::EARLIEST_S);
                (settle_s.unwrap_or(latest_s).clamp(Self::EARLIEST_S, latest_s), dwell_s)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_steps() {
        let fixed = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
        // (rule, settles after, dwell, window): early, late and never settled; a short step; a cut one.
        let table = [
            (WindowRule::Auto, Some(4.0), 120.0, (10.0, 120.0)),
            (WindowRule::Auto, Some(25.0), 120.0, (25.0, 120.0)),
            (WindowRule::Auto, Some(110.0), 120.0, (90.0, 120.0)),
            (WindowRule::Auto, None, 120.0, (90.0, 120.0)),
            (WindowRule::Auto, None, 25.0, (10.0, 25.0)),
            (fixed, Some(25.0), 120.0, (10.0, 110.0)),
            (fixed, None, 90.0, (10.0, 90.0)),
        ];
        for (rule, settle_s, dwell_s, window_s) in table {
            assert_eq!(rule.of_step_s(settle_s, dwell_s), window_s, "{rule:?} {settle_s:?} {dwell_s}");
        }
    }
}
