//! Checks whether a recording belongs to a machine other than the nominal one.

use crate::gap::preconditions::problem::Problem;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::Study;
use mapper_core::Channel;

/// Deviations at the end of a step that no rig effect causes: of speed, flows, and the compressor's pressure and temperature rise.
const ANOTHER_MACHINE_RATIO: [(Channel, f64); 5] = [
    (Channel::ShaftSpeed, 0.25),
    (Channel::CompressorFlow, 0.4),
    (Channel::TurbineFlow, 0.4),
    (Channel::P2, 0.4),
    (Channel::T2, 0.6),
];

/// Rejects a recording that is far from the nominal prediction.
pub fn another_machine(study: &Study, predicted: &[f64]) -> Result<(), Problem> {
    let mut worst: Option<(f64, Channel, f64)> = None;
    for (channel, limit) in ANOTHER_MACHINE_RATIO {
        let nominal = &study.declared.nominal;
        // Compare rises, not levels.
        let zero = match channel {
            Channel::P2 => nominal.p1_pa,
            Channel::T2 => nominal.t1_k,
            _ => 0.0,
        };
        let mut away: Vec<f64> = study
            .groups
            .iter()
            .filter(|group| OUTPUTS[group.output] == channel)
            .filter_map(|group| group.rows.clone().last())
            .map(|row| (study.measured[row] - zero) / (predicted[row] - zero).max(1e-9) - 1.0)
            .collect();
        away.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let Some(median) = away.get(away.len() / 2) else { continue };
        if median.abs() > limit && worst.is_none_or(|(most, ..)| median.abs() / limit > most) {
            worst = Some((median.abs() / limit, channel, 100.0 * median));
        }
    }
    worst.map_or(Ok(()), |(_, channel, percent)| Err(Problem::OtherMachine { channel, percent }))
}
