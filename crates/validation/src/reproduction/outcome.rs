//! An identified run, with the model's true values.

use crate::reproduction::ReproduceError;
use crate::reproduction::lab::{Jump, Run, Truth};
use mapper_core::{IdentifiedPoint, Recording};
use mapper_identify::{IdentifyConfig, WindowRule, identify_each};
use mapper_numerics::statistics;

/// The paper's window: 100 s from 10 s after the jump.
pub(crate) const WINDOW: WindowRule = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
/// Minimum duration of a run for it, s.
pub(crate) const RUN_S: f64 = 110.0;

/// The dynamic method with an assumed alpha_A.
pub(crate) fn dynamic_config(alpha_area_ratio: f64) -> IdentifyConfig {
    IdentifyConfig { window: WINDOW, alpha_area_ratio, ..IdentifyConfig::default() }
}

/// Identified and true values of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) jump: Jump,
    pub(crate) point: IdentifiedPoint,
    /// Mean of the model's efficiency in the window, fraction.
    pub(crate) eta_mean: f64,
    /// The model's efficiency at the window's end, fraction.
    pub(crate) eta_end: f64,
    /// Mean of the model's h in the window, W/(m2 K).
    pub(crate) h_mean_w_m2k: f64,
    /// The model's h at the window's end, W/(m2 K).
    pub(crate) h_end_w_m2k: f64,
}

impl Outcome {
    /// Identified minus mean model efficiency, points; `None` if the method failed.
    pub(crate) fn eta_error_points(&self) -> Option<f64> {
        self.point.eta.map(|eta| 100.0 * (eta - self.eta_mean))
    }

    /// Identified minus final model efficiency, points.
    pub(crate) fn eta_end_error_points(&self) -> Option<f64> {
        self.point.eta.map(|eta| 100.0 * (eta - self.eta_end))
    }

    /// Identified h over the mean model h, minus 1, %.
    pub(crate) fn h_error_percent(&self) -> Option<f64> {
        self.point.h_w_m2k.map(|h| 100.0 * (h / self.h_mean_w_m2k - 1.0))
    }

    /// Identified h over the final model h, minus 1, %.
    pub(crate) fn h_end_error_percent(&self) -> Option<f64> {
        self.point.h_w_m2k.map(|h| 100.0 * (h / self.h_end_w_m2k - 1.0))
    }
}

pub(crate) fn identify_run(run: &Run, config: &IdentifyConfig) -> Result<Outcome, ReproduceError> {
    identify_recording(run, &run.recording, config)
}

/// Identifies a recording that was made from a run (with noise, say).
pub(crate) fn identify_recording(
    run: &Run,
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Outcome, ReproduceError> {
    let mut points = identify_each(recording, config)?;
    let point = points.pop().ok_or(ReproduceError::NoStep)??;
    let window = truth_in_window(run, &config.window);
    let mean = |value: fn(&Truth) -> f64| statistics::mean(window.iter().map(value)).unwrap_or(f64::NAN);
    let last = window.last().ok_or(ReproduceError::NoStep)?;
    Ok(Outcome {
        jump: run.jump,
        point,
        eta_mean: mean(|truth| truth.eta),
        eta_end: last.eta,
        h_mean_w_m2k: mean(|truth| truth.h_w_m2k),
        h_end_w_m2k: last.h_w_m2k,
    })
}

/// The truth within a fixed window.
pub(crate) fn truth_in_window<'a>(run: &'a Run, window: &WindowRule) -> &'a [Truth] {
    let (start_s, end_s) = match window {
        WindowRule::Fixed { start_s, end_s } => (*start_s, *end_s),
        WindowRule::Auto => (0.0, f64::INFINITY),
    };
    // Sample times are multiples of 0.1 s to rounding.
    let start = run.truth.partition_point(|truth| truth.t_s < start_s - 1e-6);
    let end = run.truth.partition_point(|truth| truth.t_s <= end_s + 1e-6);
    &run.truth[start..end.max(start)]
}

/// Identifies every run.
pub(crate) fn identify_runs(runs: &[Run], config: &IdentifyConfig) -> Result<Vec<Outcome>, ReproduceError> {
    runs.iter().map(|run| identify_run(run, config)).collect()
}

/// Smallest and largest of the present values; `None` for none.
pub(crate) fn extremes(values: impl IntoIterator<Item = Option<f64>>) -> Option<(f64, f64)> {
    values.into_iter().flatten().fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    })
}

/// Largest size of the present values; 0 for none.
pub(crate) fn worst(values: impl IntoIterator<Item = Option<f64>>) -> f64 {
    values.into_iter().flatten().fold(0.0, |worst, value| worst.max(value.abs()))
}

/// Root mean square of the present values; `None` for none.
pub(crate) fn rms(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    statistics::rms(values.into_iter().flatten())
}
