//! Declared errors of the model's equations: the share `k` of each output's variation over a recording that they may miss.
//!
//! Equations that are not those of the machine are wrong in the same way in every step: they miss `k` of an output's level, `k` of its change
//! after a jump at each time constant, and `k` of the time of its fast changes. These repeating parts are nuisance parameters. Another
//! part of the same size differs from step to step, because the error depends on the state: a Gaussian process over ln of the time since the
//! jump, which enters the covariance (the discrepancy of Kennedy and O'Hagan, J. R. Stat. Soc. B 63:425, 2001).

use crate::gap::residuals::nuisance::{OUTPUTS, RESPONSES_S, structure_delay_s, structure_ratio};
use crate::gap::residuals::study::{Group, Study};
use mapper_numerics::statistics::mean;
use mapper_physics::rig::instruments::NOMINAL_P3_LAG_S;
use nalgebra::DMatrix;

/// Mean and standard deviation of an output's readings over the recording.
pub(crate) fn variation(study: &Study, output: usize) -> Option<(f64, f64)> {
    let groups = || study.groups.iter().filter(move |group| group.output == output);
    let readings = || groups().flat_map(|group| &study.measured[group.rows.clone()]);
    let middle = mean(readings())?;
    Some((middle, mean(readings().map(|reading| (reading - middle).powi(2)))?.sqrt()))
}

/// A repeating part of an output: its rows, and the reading's share: the level, or the decay after each jump by one of [`RESPONSES_S`].
pub(crate) fn repeating_part(study: &Study, output: usize, part: usize) -> Vec<(usize, f64)> {
    let Some((middle, _)) = variation(study, output) else { return Vec::new() };
    let mut before = None;
    let mut whole = Vec::new();
    for group in study.groups.iter().filter(|group| group.output == output) {
        let level = study.measured[group.rows.end - 1];
        let jump = level - before.replace(level).unwrap_or(level);
        let blocks = &study.steps[group.step].blocks;
        whole.extend(group.rows.clone().zip(&group.blocks).map(|(row, block)| {
            let decayed = (-blocks[*block].since_jump_s.max(0.0) / RESPONSES_S[part]).exp();
            (row, if RESPONSES_S[part].is_infinite() { level - middle } else { jump * decayed })
        }));
    }
    whole
}

/// Covariance within a step of errors proportional to each of `histories`. They are correlated over the logarithm of time, because the parts of
/// the machine follow with time constants from tenths of a second to minutes. Values within the usual lag of P3 after a jump are fully correlated.
pub(crate) fn covariance_of_errors(since_jump_s: &[f64], histories: [&[f64]; 2]) -> DMatrix<f64> {
    let n = since_jump_s.len();
    let at: Vec<f64> = since_jump_s.iter().map(|t_s| (t_s.max(0.0) + NOMINAL_P3_LAG_S).ln()).collect();
    DMatrix::from_fn(n, n, |i, j| {
        let sum: f64 = histories.iter().map(|history| history[i] * history[j]).sum();
        sum * (-(at[i] - at[j]).abs()).exp()
    })
}

/// Covariance of each group's error that differs from step to step, unit squared; empty if undeclared. `slopes`: of predicted readings.
pub(crate) fn step_errors(study: &Study, slopes: &[f64]) -> Vec<DMatrix<f64>> {
    let sizes: [f64; OUTPUTS.len()] = std::array::from_fn(|output| {
        let ratio = structure_ratio(&study.declared, output);
        if ratio > 0.0 { variation(study, output).map_or(0.0, |(_, sigma)| ratio * sigma) } else { 0.0 }
    });
    if sizes == [0.0; OUTPUTS.len()] {
        return Vec::new();
    }
    let of_group = |group: &Group| {
        let blocks = &study.steps[group.step].blocks;
        let since_jump_s: Vec<f64> = group.blocks.iter().map(|block| blocks[*block].since_jump_s).collect();
        let delay_s = structure_delay_s(&study.declared, group.output);
        let late: Vec<f64> = slopes[group.rows.clone()].iter().map(|slope| delay_s * slope).collect();
        covariance_of_errors(&since_jump_s, [&vec![sizes[group.output]; late.len()], &late])
    };
    study.groups.iter().map(of_group).collect()
}
