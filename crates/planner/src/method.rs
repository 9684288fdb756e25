//! The identification method as the planner sees it: a function from a forecast to an expected result.
//!
//! The planner does not depend on identification; whoever asks for a plan passes the method in use.

pub use mapper_physics::operating_point::forecast::ForecastRow;

/// What the method is expected to find in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodResult {
    /// Efficiency without noise, fraction.
    pub eta: f64,
    /// Its standard error from declared noise and offsets, fraction.
    pub sigma_eta: f64,
    /// Heat-transfer coefficient without noise, W/(m2 K).
    pub h_w_m2k: f64,
    /// Its standard error, W/(m2 K).
    pub sigma_h_w_m2k: f64,
}

/// What the method is expected to find in all steps of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodResults {
    /// One result for each step, on a machine that is as declared.
    pub steps: Vec<Option<MethodResult>>,
    /// Value of the declaration: by how much the efficiencies would be off (rms, one sigma, fraction) if the parameters that the method
    /// may find had to be found from these steps.
    pub resting_eta: f64,
    /// Largest such error with which points are good, fraction.
    pub max_resting_eta: f64,
}

/// An identification method, for planning.
pub trait PredictedMethod: std::fmt::Debug + Sync {
    /// The result of one step by itself, from the rows of its window, which lie `interval_s` apart; `None` if the method finds
    /// nothing there, or looks at all steps together.
    fn alone(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult>;

    /// The results of all steps of a campaign together, each given from its jump to its end; `None` if the method looks at each
    /// step by itself, or its fit does not converge.
    fn together(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults>;

    /// The result of conventional mapping at a settled point: apparent efficiency and its standard error, fractions.
    fn settled(&self, row: &ForecastRow) -> Option<(f64, f64)>;
}
