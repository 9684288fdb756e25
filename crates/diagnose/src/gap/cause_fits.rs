//! The fits of a diagnosis on which corrections, figures and files rest.

use crate::closure::select::ClosureKey;
use crate::gap::best_fit::fit::Fit;
use crate::gap::residuals::nuisance::Hypothesis;
use nalgebra::DMatrix;

/// Causes with their sizes, as fitted to a recording.
#[derive(Debug, Clone)]
pub(crate) struct CauseFit {
    /// Tolerances and effects, by their index in the study.
    pub(crate) hypothesis: Hypothesis,
    /// Covariance of the effects' search coordinates; `None` if the recording does not determine them.
    pub(crate) covariance: Option<DMatrix<f64>>,
}

impl CauseFit {
    pub(crate) fn of(fit: &Fit) -> CauseFit {
        let covariance = Some(&fit.covariance).filter(|all| all.iter().all(|one| one.is_finite()));
        CauseFit { hypothesis: fit.hypothesis.clone(), covariance: covariance.cloned() }
    }
}

/// A closure term with its fit.
#[derive(Debug, Clone)]
pub(crate) struct ClosureFit {
    pub(crate) key: ClosureKey,
    pub(crate) fit: CauseFit,
}

/// The fits on which everything rests that follows from a diagnosis.
#[derive(Debug, Clone)]
pub(crate) struct Fits {
    /// The tolerances alone.
    pub(crate) null: CauseFit,
    /// Those of the candidates, in their order.
    pub(crate) causes: Vec<CauseFit>,
    /// Those of the closure term that is more probable than not, and of those that the recording does not distinguish from it.
    pub(crate) closures: Vec<ClosureFit>,
}
