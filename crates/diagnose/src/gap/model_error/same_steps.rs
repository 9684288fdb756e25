//! Compares the steps of two recordings.

use crate::gap::preconditions::problem::Problem;
use crate::gap::residuals::study::Study;
use mapper_core::{Channel, VALVE_JUMP_RATIO, jump_ratio};
use mapper_identify::LONGEST_BRIDGE_S;
use mapper_observe::averages::mean_reading::mean_reading;

/// Rejects a reference recording with steps other than those of the recording under diagnosis. Times may differ by the interval of a slow
/// logger, T3 by its tolerance: a smaller difference is variation of the stand, not another operating point.
pub(crate) fn same_steps(baseline: &Study, study: &Study) -> Result<(), Problem> {
    if baseline.steps.len() != study.steps.len() {
        return Err(Problem::OtherSteps { baseline: baseline.steps.len(), recorded: study.steps.len() });
    }
    let t3_k = |of: &Study, step: usize| {
        let marker = &of.steps[step].marker;
        let column = of.table.column(Channel::T3)?;
        mean_reading(&column[of.table.range(marker.start_s, marker.end_s)])
    };
    for (index, (theirs, ours)) in baseline.steps.iter().zip(&study.steps).enumerate() {
        let (theirs, ours) = (&theirs.marker, &ours.marker);
        let differs = |what: &'static str, baseline: f64, recorded: f64, unit: &'static str, within: f64| {
            let same =
                (baseline - recorded).abs() <= within || !baseline.is_finite() || !recorded.is_finite();
            let step = ours.index;
            if same {
                Ok(())
            } else {
                Err(Problem::OtherStep { step, what, baseline, recorded, unit, within })
            }
        };
        // Model error hardly changes between points that count as one.
        let (p3_kpa, opening) = (ours.p3_pa / 1e3, ours.valve_opening_ratio);
        differs("commanded P3", theirs.p3_pa / 1e3, p3_kpa, "kPa", jump_ratio(Channel::P3) * p3_kpa)?;
        differs("opening of the valve", theirs.valve_opening_ratio, opening, "", VALVE_JUMP_RATIO * opening)?;
        // The running time before the first jump is not compared.
        if index > 0 {
            differs(
                "length",
                theirs.end_s - theirs.start_s,
                ours.end_s - ours.start_s,
                "s",
                LONGEST_BRIDGE_S,
            )?;
        }
        if let (Some(before), Some(now)) = (t3_k(baseline, index), t3_k(study, index)) {
            differs("T3", before, now, "K", study.declared.tolerances.turbine_inlet_temperature_k)?;
        }
    }
    Ok(())
}
