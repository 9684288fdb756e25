//! A recording with the drift of a sensor subtracted from its readings.

use crate::cause::Cause;
use crate::course::{Course, CourseKind};
use crate::report::{DriftReport, RateOrStep};
use mapper_core::{Channel, Recording};

/// The first recording with the drift of its sensor, as reported, subtracted; `None` where no sensor was found to drift.
pub fn without_drift(recording: &Recording, report: &DriftReport) -> Option<Recording> {
    let (Some(Cause::Sensor(channel)), Some(onset_s), Some(size)) =
        (report.cause, report.onset_s, report.size)
    else {
        return None;
    };
    let (kind, size) = match size {
        RateOrStep::RatePerH(rate) => (CourseKind::Ramp, rate),
        RateOrStep::Step(step) => (CourseKind::Step, step),
    };
    let course = Course { kind, onset_s };
    Some(take_off(recording, channel, &|t_s| size * course.at(t_s)))
}

/// The recording with `drift_at` (run time, s) subtracted from the readings of a channel.
pub(crate) fn take_off(recording: &Recording, channel: Channel, drift_at: &dyn Fn(f64) -> f64) -> Recording {
    let mut recording = recording.clone();
    if let Some(series) = recording.series.get_mut(&channel) {
        for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
            let drift = drift_at(*t_s);
            *value = if Cause::Sensor(channel).is_gain() { *value / (1.0 + drift) } else { *value - drift };
        }
    }
    recording
}
