//! Interface to the identification method: it predicts the error of a step from the forecast of its signals.
//!
//! The planner does not depend on the identification crate; the caller passes an implementation.

pub use mapper_physics::operating_point::forecast::ForecastRow;

/// Expected result of the method for one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodResult {
    /// Efficiency without noise, fraction.
    pub eta: f64,
    /// Standard error from declared noise and offsets, fraction.
    pub sigma_eta: f64,
    /// Heat-transfer coefficient without noise, W/(m2 K).
    pub h_w_m2k: f64,
    /// Standard error, W/(m2 K).
    pub sigma_h_w_m2k: f64,
}

/// Expected results of the method for all steps of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodResults {
    /// One result for each step, on a machine with the declared parameters.
    pub steps: Vec<Option<MethodResult>>,
    /// Standard error of each efficiency that the method reports after such a recording, fraction.
    pub reported_sigma_eta: Vec<Option<f64>>,
    /// Efficiency error (rms, one sigma, fraction) that remains if the method has to identify the model parameters from these steps
    /// instead of relying on their declared values.
    pub parameter_error_eta: f64,
    /// Largest such error at which points can still be good, fraction.
    pub max_parameter_error_eta: f64,
}

/// An identification method, for planning.
pub trait PredictedMethod: std::fmt::Debug + Sync {
    /// Predicts the result of a single step from the rows of its window, which are `interval_s` apart. `None` if the method has no
    /// result, or if it identifies all steps together.
    fn predict_step(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult>;

    /// Predicts the results of all steps of a campaign, each given from its jump to its end. `None` if the method identifies each
    /// step separately, or if its fit does not converge.
    fn predict_campaign(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults>;

    /// Predicts the reading of conventional mapping at a settled point: apparent efficiency and its standard error, fractions.
    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)>;
}
