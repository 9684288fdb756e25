//! Interface to the identification method: it predicts the error of a step from the forecast of its signals.
//!
//! The planner does not depend on the identification crate; the caller passes an implementation.

pub use mapper_core::{MethodResult, MethodResults};
pub use mapper_physics::operating_point::forecast::ForecastRow;

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
