//! Tolerances that end outside their prior.

use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, fit};
use crate::gap::best_fit::selection::Selection;
use crate::gap::findings::report::BeyondPrior;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use mapper_numerics::statistics::DOUBT_SIGMAS;

/// Effort of a fit whose tolerances have no limit; this one has no effect.
const UNLIMITED: Effort =
    Effort { iterations: 8, enough: 0.5, max_sigmas: 1e3, max_sigmas_of_rig: 1e3, exact: true };

/// Tolerances of a fit beyond three sigmas of their prior, furthest first. A tolerance at [`MAX_SIGMAS`], which limits the search for causes, is fitted
/// again without that limit.
pub fn beyond_prior(study: &Study, linearised: &Linearised, fitted: &Fit) -> Vec<BeyondPrior> {
    let limited = fitted.hypothesis.nuisances.iter().any(|sigmas| sigmas.abs() > 0.999 * MAX_SIGMAS);
    let freed =
        limited.then(|| fit(study, linearised, fitted, &Selection::all(study), UNLIMITED).ok()).flatten();
    let nuisances = &freed.as_ref().unwrap_or(fitted).hypothesis.nuisances;
    let mut beyond: Vec<BeyondPrior> = study
        .nuisances
        .iter()
        .zip(nuisances)
        .filter(|(nuisance, sigmas)| sigmas.abs() > DOUBT_SIGMAS && nuisance.kind.is_of_rig())
        .map(|(nuisance, sigmas)| BeyondPrior {
            what: nuisance.kind.to_string(),
            sigmas: sigmas.abs(),
            value: nuisance.value(*sigmas),
        })
        .collect();
    beyond.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
    beyond
}
