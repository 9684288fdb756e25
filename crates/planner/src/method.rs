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
    /// Standard error of the efficiency where nothing that the method can find by itself is as declared, fraction.
    pub open_sigma_eta: f64,
}

/// An identification method, for planning.
pub trait PredictedMethod: std::fmt::Debug + Sync {
    /// What it makes of the rows of a window, which lie `interval_s` apart; `None` where it finds nothing.
    fn predict(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult>;

    /// What it makes of the steps of a whole campaign, each from its jump to its end, where it looks at all of them together;
    /// one result for each step. `None` where it looks at each step for itself, or comes to no end. `as_declared`: whether the
    /// errors of a machine that is as declared are asked for too; else `sigma_eta` is `open_sigma_eta`.
    fn together(&self, _steps: &[&[ForecastRow]], _as_declared: bool) -> Option<Vec<Option<MethodResult>>> {
        None
    }

    /// What single steps are worth to a campaign of these steps; `None` for a method that looks at each step for itself.
    fn worth_to(&self, _steps: &[&[ForecastRow]]) -> Option<Box<dyn WorthOfStep>> {
        None
    }

    /// A tangent of the variances that campaigns of the same points make, at one whose steps tell `times` as much as these; `measures`:
    /// whether each step measures a point. `None` for a method that looks at each step for itself.
    fn tangent_at(
        &self,
        _steps: &[&[ForecastRow]],
        _measures: &[bool],
        _times: f64,
    ) -> Option<Box<dyn ErrorTangent>> {
        None
    }

    /// Whether it looks at all steps together.
    fn is_joint(&self) -> bool {
        false
    }

    /// What conventional mapping makes of a settled point: apparent efficiency and its standard error, fractions.
    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)>;
}

/// What a step is worth to a planned campaign.
pub trait WorthOfStep: std::fmt::Debug + Sync {
    /// By how much the step makes all points more certain, less the variance of its own point, fraction^2; the rows lead from
    /// its jump to its end.
    fn of(&self, rows: &[ForecastRow]) -> Option<f64>;
}

/// A tangent of the sum of the variances of a campaign's points, by the information of all its steps: no campaign's sum is below `start`, less what
/// its steps count for.
pub trait ErrorTangent: std::fmt::Debug + Sync {
    /// Where no step counts for anything, fraction^2.
    fn start(&self) -> f64;

    /// What a step in place of the campaign's step `place` counts for, fraction^2; the rows lead from its jump to its end.
    fn of(&self, rows: &[ForecastRow], place: usize) -> Option<f64>;
}
