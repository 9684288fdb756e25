//! Gap reduction by a law on steps used neither to find nor to fit it.

use crate::gap::best_fit::adequacy::misfit_of_steps;
use crate::gap::best_fit::fit::Fit;
use crate::gap::residuals::study::Study;

/// `1 - sum g_after+/sum g_before+` with `g = (|r|^2 - n)/n` over the held-out steps; over all steps if none is held out.
pub fn shrink(study: &Study, before: &Fit, after: &Fit, held_out: &[usize]) -> f64 {
    let all: Vec<usize> = (0..study.steps.len()).collect();
    let steps = if held_out.is_empty() { &all } else { held_out };
    let of = |fit: &Fit| {
        let misfit = misfit_of_steps(study, &fit.residual);
        steps.iter().map(|step| misfit[*step].max(0.0)).sum::<f64>()
    };
    let (before, after) = (of(before), of(after));
    if before > 0.0 { 1.0 - after / before } else { 0.0 }
}
