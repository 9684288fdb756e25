//! Finds a region of the map whose steps disagree with the others on the shared parameters, so that they do not invalidate the recording.
//!
//! The search runs if the fit of all steps has warnings. A region is one end of the map (near choke, near surge, slowest, fastest). It is excluded if
//! the warnings disappear without it and the shared parameters change by more than their own uncertainty explains. Without an error,
//! the remaining steps only carry less information: the variance of the difference is then the difference of the variances (Hausman,
//! Econometrica 46, 1978, eq. 2.10).

use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::start::LAW_SIGMA;
use crate::joint::step_model::parameters::{EXPONENT, LN_COEFFICIENT, REFINEMENTS};
use crate::joint::step_model::rows::StepRows;
use crate::joint::step_model::surface::SurfaceScale;
use mapper_core::MapRegion;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, MIN_VALUES};

/// Shares of the steps in a region; the smallest one that helps is excluded. Bound: fewer steps are excluded one by one, more would leave
/// too few.
const SHARES: [f64; 2] = [1.0 / 6.0, 1.0 / 3.0];

/// Steps at one end of the map.
pub(crate) struct Region {
    /// The end.
    pub(crate) region: MapRegion,
    /// Indices of the steps.
    pub(crate) steps: Vec<usize>,
}

/// Sort key of a position (scaled speed and flow): the lowest come first in a region.
type Rank = fn(&(f64, f64)) -> f64;

/// All regions, the small ones first; those of equal size are adjacent.
pub(crate) fn regions(steps: &[StepRows]) -> Vec<Vec<Region>> {
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let Some(scale) = SurfaceScale::of(&places).filter(|_| steps.len() > MIN_VALUES) else {
        return Vec::new();
    };
    let coordinates: Vec<(f64, f64)> = places.iter().map(|place| scale.coordinates(*place)).collect();
    let sorted = |of: Rank| {
        let mut order: Vec<usize> = (0..coordinates.len()).collect();
        order.sort_by(|a, b| of(&coordinates[*a]).total_cmp(&of(&coordinates[*b])));
        order
    };
    let ends: [(MapRegion, Rank); 4] = [
        (MapRegion::Choke, |place| -place.1),
        (MapRegion::Surge, |place| place.1),
        (MapRegion::LowestSpeeds, |place| place.0),
        (MapRegion::HighestSpeeds, |place| -place.0),
    ];
    let of_size = |share: f64| {
        let count = (share * steps.len() as f64).ceil() as usize;
        ends.iter()
            .map(|(region, of)| {
                let steps = sorted(*of).into_iter().take(count).collect();
                Region { region: *region, steps }
            })
            .collect()
    };
    SHARES.into_iter().map(of_size).collect()
}

/// Largest difference between the remaining steps and all steps over the shared parameters, in standard errors; `None` if as expected.
pub(crate) fn disagreement(
    all: (&Problem<'_>, &Covariance),
    rest: (&Problem<'_>, &Covariance),
) -> Option<f64> {
    let error = |(problem, covariance): (&Problem<'_>, &Covariance), index: usize| {
        // A parameter fixed as declared has no error.
        if problem.active[index] { covariance.error_of(index) } else { Some(0.0) }
    };
    // Small model errors change a parameter by as much, and the spread of the points about the law changes the law.
    let with_priors = REFINEMENTS.into_iter().map(|refinement| (refinement.index, refinement.model_error));
    with_priors
        .chain([(EXPONENT, LAW_SIGMA), (LN_COEFFICIENT, LAW_SIGMA)])
        .filter_map(|(index, floor)| {
            let (of_all, of_rest) = (error(all, index)?, error(rest, index)?);
            let variance = (of_rest * of_rest - of_all * of_all).max(0.0) + floor * floor;
            Some((all.0.shared[index] - rest.0.shared[index]).abs() / variance.sqrt())
        })
        .filter(|sigmas| *sigmas > EXCLUDE_SIGMAS)
        .reduce(f64::max)
}
