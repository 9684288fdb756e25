//! Expected model error of changes, estimated from its errors within a reference recording.
//!
//! Subtracting the reference removes the model error at the reference operating points. A fault moves the machine elsewhere, and the
//! model's response to the fault is as wrong as its response to the steps of the campaign. The model misses a share `k` of each output's
//! variation in the reference, so it misses the same share of a change `d`. If a step runs elsewhere by a share `r` of the recorded span,
//! the model error `b` there changes by that share. Within a step the covariance is `(k^2 d_i d_j + r^2 b_i b_j) exp(-|ln(t_i/t_j)|)`. It
//! is zero if nothing changes.

use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use mapper_observe::perturbation::UNINFORMATIVE;

/// Relative model error of each output's variation over a recording; 0 if noise accounts for it. `model_error` is measured minus predicted.
pub(crate) fn errors_of_change(
    study: &Study,
    linearised: &Linearised,
    model_error: &[f64],
) -> [f64; OUTPUTS.len()] {
    let mut of_output = [const { Vec::new() }; OUTPUTS.len()];
    for (place, group) in study.groups.iter().enumerate() {
        let variances = linearised.covariance(place).diagonal();
        // Near surge.
        let most = UNINFORMATIVE * study.declared.noise_sigma(OUTPUTS[group.output]).powi(2);
        let kept = group.rows.clone().zip(variances.iter().copied()).filter(|(_, variance)| *variance < most);
        of_output[group.output].extend(kept);
    }
    of_output.map(|rows: Vec<(usize, f64)>| {
        let count = rows.len().max(1) as f64;
        let variance = |of: &[f64]| {
            let mean = rows.iter().map(|(row, _)| of[*row]).sum::<f64>() / count;
            rows.iter().map(|(row, _)| (of[*row] - mean).powi(2)).sum::<f64>() / count
        };
        let noise = rows.iter().map(|(_, variance)| variance).sum::<f64>() / count;
        let (missed, moved) = (variance(model_error) - noise, variance(&study.measured));
        if moved > 0.0 { (missed.max(0.0) / moved).sqrt().min(1.0) } else { 0.0 }
    })
}

/// Shift of each step's operating point, 1 sigma, relative to each output's span over the recording. Returns the maximum over all outputs,
/// of the step and of the one it jumps from.
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
