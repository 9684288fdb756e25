//! A recording with the drift of its sensors subtracted from their readings.

use crate::drift::causes::cause::is_relative;
use crate::drift::likelihood::fit::FittedDrift;
use crate::drift::report::{DriftReport, FoundDrift};
use mapper_core::{Channel, Recording};

/// The first recording with the reported sensor drift subtracted; `None` if no sensor drifts.
pub fn without_drift(recording: &Recording, report: &DriftReport) -> Option<Recording> {
    let is_of_sensor = |drift: &FoundDrift| !drift.cause.channels().is_empty();
    report.drifts.iter().any(is_of_sensor).then_some(())?;
    let mut recording = recording.clone();
    for drift in &report.drifts {
        subtract(&mut recording, drift.cause.channels(), &|t_s| drift.at(t_s));
    }
    Some(recording)
}

/// The recording of a run that starts `offset_s` after the campaign, with the fitted drifts subtracted.
pub(crate) fn without_drifts(recording: &Recording, drifts: &[FittedDrift], offset_s: f64) -> Recording {
    let mut recording = recording.clone();
    for FittedDrift { drift, .. } in drifts {
        subtract(&mut recording, drift.cause.channels(), &|t_s| drift.at(t_s + offset_s));
    }
    recording
}

/// Subtracts `drift_at` (run time, s) from the readings of channels.
fn subtract(recording: &mut Recording, channels: &[Channel], drift_at: &dyn Fn(f64) -> f64) {
    for channel in channels {
        let Some(series) = recording.series.get_mut(channel) else { continue };
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            let drift = drift_at(*t_s);
            *value = if is_relative(*channel) { *value / (1.0 + drift) } else { *value - drift };
        }
    }
}
