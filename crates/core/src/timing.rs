//! How long the parts of a campaign take.

use serde::{Deserialize, Serialize};

/// How long the steps of a campaign last, jump included. All steps last equally long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dwell {
    /// This long, s, > 0.
    Fixed(f64),
    /// As long as warm-up, steps and cool-down together may take, s, > 0.
    TimeBudget(f64),
    /// As long as the efficiencies need to reach this forecast standard error (rms over the points, fraction, > 0).
    RequiredSigmaEta(f64),
}

impl Dwell {
    /// Usual time at a point, s: two minutes (Burke et al.).
    pub const USUAL_S: f64 = 120.0;

    /// The dwell, s, if the campaign states it; `None` if the planner chooses it.
    pub fn fixed_s(self) -> Option<f64> {
        match self {
            Dwell::Fixed(dwell_s) => Some(dwell_s),
            Dwell::TimeBudget(_) | Dwell::RequiredSigmaEta(_) => None,
        }
    }

    /// The dwell, s, or the usual one as long as the planner has not chosen it.
    pub fn fixed_or_usual_s(self) -> f64 {
        self.fixed_s().unwrap_or(Self::USUAL_S)
    }
}

/// Durations of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Time at the first point before its step begins, s, >= 0.
    pub warm_up_s: f64,
    /// Time without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Time at each point.
    pub dwell: Dwell,
}
