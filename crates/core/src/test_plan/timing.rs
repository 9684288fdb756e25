//! Durations of the parts of a campaign.

use serde::{Deserialize, Serialize};

/// Duration of the steps of a campaign, jump included. All steps have the same duration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dwell {
    /// This duration, s, > 0.
    Fixed(f64),
    /// Fills this total time of warm-up, steps and cool-down, s, > 0.
    TimeBudget(f64),
    /// The shortest duration with this forecast standard error of the efficiencies (rms over the points, fraction, > 0).
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

    /// The dwell, s, or the usual one until the planner has chosen it.
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
