//! Expected verdicts of the points of a campaign, and changes of the campaign that improve them.

use serde::Serialize;

/// Expected verdicts of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VerdictForecast {
    /// Points that the campaign measures.
    pub points: usize,
    /// Points with the expected verdict `good`.
    pub good: usize,
    /// Points that are good even if the errors are larger than expected.
    pub good_low: usize,
    /// Points that are good if the errors are smaller than expected.
    pub good_high: usize,
    /// Whether the steps may contain too little information to check the declared parameters, which would make all points doubtful.
    pub near_limit: bool,
    /// Expected standard error of efficiency, root mean square over the points, fraction; `None` if the steps cannot check the declared parameters.
    pub eta_standard_error: Option<f64>,
    /// Expectation for a machine that is not as declared; `None` if nothing is searched for, or nothing can be determined.
    pub undeclared: Option<UndeclaredForecast>,
    /// Rig time, s.
    pub duration_s: f64,
}

/// Expected verdicts if alpha_A, probe and heating/cooling ratio differ from the declaration by one standard deviation of such machines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UndeclaredForecast {
    /// Points with the expected verdict `good`.
    pub good: usize,
    /// Expected standard error of efficiency, root mean square over the points, fraction.
    pub eta_standard_error: f64,
}

/// A change of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CampaignChange {
    /// `timing.dwell`, s.
    DwellS(f64),
    /// `zero.soak`, s.
    SoakS(f64),
}

/// A change of the campaign with the verdicts expected after it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Advice {
    /// The change.
    pub change: CampaignChange,
    /// Verdicts after the change.
    pub forecast: VerdictForecast,
}
