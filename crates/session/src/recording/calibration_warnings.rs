//! Warnings at the points whose readings no calibration supports.

use mapper_campaign::campaign::{CalibrationRule, Date};
use mapper_campaign::{CalibrationWarning, Campaign};
use mapper_core::{Channel, IdentifiedPoint, Recording, Verdict};
use mapper_numerics::statistics::range;

/// Adds the defects of the sensors' calibrations to each point. If the campaign requires calibrations, the point is unusable.
pub(crate) fn warn(
    points: &mut [IdentifiedPoint],
    recording: &Recording,
    campaign: &Campaign,
    day: Option<Date>,
) {
    for point in points {
        let Some(step) = recording.steps.iter().find(|step| step.index == point.step) else { continue };
        let readings = |channel: Channel| {
            let values = recording.series.get(&channel)?.slice(step.start_s, step.end_s).1;
            let (low, high) = range(values.iter().copied().filter(|value| value.is_finite()));
            (low <= high).then_some((low, high))
        };
        for CalibrationWarning { warning, .. } in campaign.calibration_warnings(day, readings) {
            match campaign.calibration {
                CalibrationRule::Optional => point.warnings.push(warning),
                CalibrationRule::Required => {
                    point.warnings.insert(0, warning);
                    point.verdict = Verdict::Unusable;
                }
            }
        }
    }
}
