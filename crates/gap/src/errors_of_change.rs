//! How wrong a model may be about what changes, by how wrong it is about what changes within a healthy recording.
//!
//! What a model lacks is subtracted where the machine ran on the healthy night. A cause moves it elsewhere, where the model lacks something else,
//! and the model's answer to a cause is as wrong as its answer to the steps of the campaign. Both are seen. The model misses what an output does over the
//! healthy recording by a share `k`: of a change `d` of that output it misses as much. And where a step runs elsewhere by a share `r` of what the
//! recording spans, what is lacking there, `b`, changes by as much of itself. Both in level and course: between the values of a step
//! `(k^2 d_i d_j + r^2 b_i b_j) exp(-|ln(t_i/t_j)|)`. Where nothing changes it is nothing.

use crate::nuisance::OUTPUTS;
use crate::study::Study;
use crate::whiten::Linearised;
use nalgebra::DMatrix;

/// Noise beyond so many declared variances stands for values that say nothing, near surge.
const SAYS_NOTHING: f64 = 1e3;
/// What moves within this long after a jump moves together, s.
const AT_ONCE_S: f64 = 0.3;

/// Share by which the model misses what each output does over a recording, 0 where noise accounts for it; `lacking` is what is measured less what is
/// predicted.
pub(crate) fn errors_of_change(
    study: &Study,
    linearised: &Linearised,
    lacking: &[f64],
) -> [f64; OUTPUTS.len()] {
    let mut of_output = [const { Vec::new() }; OUTPUTS.len()];
    for (place, group) in study.groups.iter().enumerate() {
        let variances = linearised.covariance(place).diagonal();
        let most = SAYS_NOTHING * study.declared.noise_sigma(OUTPUTS[group.output]).powi(2);
        let told = group.rows.clone().zip(variances.iter().copied()).filter(|(_, variance)| *variance < most);
        of_output[group.output].extend(told);
    }
    of_output.map(|rows: Vec<(usize, f64)>| {
        let count = rows.len().max(1) as f64;
        let variance = |of: &[f64]| {
            let mean = rows.iter().map(|(row, _)| of[*row]).sum::<f64>() / count;
            rows.iter().map(|(row, _)| (of[*row] - mean).powi(2)).sum::<f64>() / count
        };
        let noise = rows.iter().map(|(_, variance)| variance).sum::<f64>() / count;
        let (missed, moved) = (variance(lacking) - noise, variance(&study.measured));
        if moved > 0.0 { (missed.max(0.0) / moved).sqrt().min(1.0) } else { 0.0 }
    })
}

/// Share of what each output spans over a recording, one standard deviation, by which each step runs elsewhere: the largest of all
/// outputs, of the step itself and of the one from which it jumps.
pub(crate) fn elsewhere(study: &Study, changed: &[f64]) -> Vec<f64> {
    let spans: Vec<f64> = (0..OUTPUTS.len())
        .map(|output| {
            let groups = study.groups.iter().filter(|group| group.output == output);
            let values: Vec<f64> =
                groups.flat_map(|group| study.measured[group.rows.clone()].to_vec()).collect();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (squares / values.len().max(1) as f64).sqrt()
        })
        .collect();
    let mut shares = vec![0.0f64; study.steps.len()];
    for group in study.groups.iter().filter(|group| spans[group.output] > 0.0) {
        let squares: f64 = changed[group.rows.clone()].iter().map(|by| by * by).sum();
        let by = (squares / group.rows.len().max(1) as f64).sqrt() / spans[group.output];
        shares[group.step] = shares[group.step].max(by);
    }
    (0..shares.len()).map(|step| shares[step].max(shares[step.saturating_sub(1)])).collect()
}

/// Covariance of values of a step that err in proportion to each of `courses`, in level and course.
pub(crate) fn covariance_of_errors(since_jump_s: &[f64], courses: [&[f64]; 2]) -> DMatrix<f64> {
    let n = since_jump_s.len();
    let at: Vec<f64> = since_jump_s.iter().map(|t_s| (t_s.max(0.0) + AT_ONCE_S).ln()).collect();
    DMatrix::from_fn(n, n, |i, j| {
        let sum: f64 = courses.iter().map(|course| course[i] * course[j]).sum();
        sum * (-(at[i] - at[j]).abs()).exp()
    })
}
