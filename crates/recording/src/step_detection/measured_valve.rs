//! Detects a measured valve position that is mapped as the command: it moves with every sample, so its changes are not steps.

use mapper_core::{Series, StepMarker};
use mapper_numerics::statistics::median;

/// Minimum share of samples in which a measured position reverses. Bound: commands with points of a minute reverse a tenth as often.
const MIN_REVERSAL_SHARE: f64 = 0.05;

/// Their minimum number. Bound: a campaign of commands has fewer in such a share of its samples.
const MIN_REVERSALS: usize = 20;

/// Share of the largest opening. Bound: if half of the moves are smaller, they are the resolution of a sensor.
const SMALL_MOVE_SHARE: f64 = 5e-3;

/// Share of samples in which a command reverses, if the reversals are so frequent or so small that it is a measured position.
pub(crate) fn reversal_share(command: &Series) -> Option<f64> {
    let values: Vec<f64> = command.values.iter().copied().filter(|value| value.is_finite()).collect();
    let moves: Vec<f64> =
        values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step != 0.0).collect();
    let turns = moves.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    if turns < MIN_REVERSALS {
        return None;
    }
    let share = turns as f64 / values.len() as f64;
    let top = values.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let sizes: Vec<f64> = moves.iter().map(|step| step.abs()).collect();
    let small = median(&sizes).is_some_and(|size| size < SMALL_MOVE_SHARE * top);
    (share > MIN_REVERSAL_SHARE || small).then_some(share)
}

/// The command reconstructed from the position: for each step, the opening at its end.
pub(crate) fn hold_at_step_ends(position: &mut Series, steps: &[StepMarker]) {
    let mut openings = Vec::with_capacity(position.values.len());
    for t_s in &position.t_s {
        let at = steps.partition_point(|step| step.start_s <= *t_s).max(1) - 1;
        openings.push(steps.get(at).map_or(f64::NAN, |step| step.valve_opening_ratio));
    }
    position.values = openings;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(value: impl Fn(usize) -> f64) -> Series {
        Series {
            t_s: (0..3000).map(|row| row as f64 / 10.0).collect(),
            values: (0..3000).map(value).collect(),
        }
    }

    #[test]
    fn noise_and_resolution_make_a_position_and_steps_and_ramps_do_not() {
        let noise = |row: usize| 0.7 * (1.0 + 1e-3 * (row as f64 * 12.9898).sin());
        assert!(reversal_share(&series(noise)).is_some_and(|share| share > 0.1));
        // The last digit changes occasionally.
        assert!(reversal_share(&series(|row| if row % 60 < 30 { 0.7 } else { 0.701 })).is_some());
        assert_eq!(reversal_share(&series(|row| if row % 600 < 300 { 0.7 } else { 0.5 })), None);
        let saw = |row: usize| 0.5 + 0.001 * (row % 300) as f64;
        assert_eq!(reversal_share(&series(saw)), None);
    }
}
