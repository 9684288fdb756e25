//! Compares the steps of two recordings.

use crate::gap::preconditions::problem::Problem;
use crate::gap::residuals::study::Study;
use mapper_core::{Channel, VALVE_JUMP_RATIO, jump_ratio};
use mapper_observe::averages::mean_reading::mean_reading;

/// Length of a step, s.
const LENGTH_S: f64 = 1.0;
/// Turbine inlet temperature, K: a smaller difference is ambient variation, not another operating point.
const T3_K: f64 = 10.0;

/// Rejects a reference recording with steps other than those of the recording under diagnosis.
pub(crate) fn same_steps(healthy: &Study, study: &Study) -> Result<(), Problem> {
    if healthy.steps.len() != study.steps.len() {
        return Err(Problem::OtherSteps { healthy: healthy.steps.len(), recorded: study.steps.len() });
    }
    let t3_k = |of: &Study, step: usize| {
        let marker = &of.steps[step].marker;
        let column = of.table.column(Channel::T3)?;
        mean_reading(&column[of.table.range(marker.start_s, marker.end_s)])
    };
    for (index, (theirs, ours)) in healthy.steps.iter().zip(&study.steps).enumerate() {
        let (theirs, ours) = (&theirs.marker, &ours.marker);
        let differs = |what: &'static str, healthy: f64, recorded: f64, unit: &'static str, within: f64| {
            let same = (healthy - recorded).abs() <= within || !healthy.is_finite() || !recorded.is_finite();
            let step = ours.index;
            if same {
                Ok(())
            } else {
                Err(Problem::OtherStep { step, what, healthy, recorded, unit, within })
            }
        };
        // Model error hardly changes between points that count as one.
        let (p3_kpa, opening) = (ours.p3_pa / 1e3, ours.valve_opening_ratio);
        differs("commanded P3", theirs.p3_pa / 1e3, p3_kpa, "kPa", jump_ratio(Channel::P3) * p3_kpa)?;
        differs("opening of the valve", theirs.valve_opening_ratio, opening, "", VALVE_JUMP_RATIO * opening)?;
        // The running time before the first jump is not compared.
        if index > 0 {
            differs("length", theirs.end_s - theirs.start_s, ours.end_s - ours.start_s, "s", LENGTH_S)?;
        }
        if let (Some(before), Some(now)) = (t3_k(healthy, index), t3_k(study, index)) {
            differs("T3", before, now, "K", T3_K)?;
        }
    }
    Ok(())
}
