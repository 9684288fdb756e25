//! The identification method as the planner sees it: a function from a forecast to an expected result.
//!
//! The planner does not depend on identification; whoever asks for a plan passes the method in use.

pub use mapper_physics::forecast::ForecastRow;

/// What the method will find in a window.
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

/// An identification method, for planning.
pub trait PredictedMethod: std::fmt::Debug + Sync {
    /// What it makes of the rows of a window, which lie `interval_s` apart; `None` where it finds nothing.
    fn predict(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult>;

    /// What conventional mapping makes of a settled point: apparent efficiency and its standard error, fractions.
    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)>;
}
