//! How long the parts of a campaign take.

use serde::{Deserialize, Serialize};

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Time at the first point before its step begins, s, >= 0.
    pub warm_up_s: f64,
    /// Time without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Time at each point, jump included, s, > 0; the longest where each step's dwell is chosen.
    pub dwell_s: f64,
}
