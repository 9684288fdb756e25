//! One bad region of the map may not condemn a recording: which steps disagree with the rest on what all share.
//!
//! Tried where the fit of all steps is doubted: without the steps of one end of the map (near choke, near surge, slowest,
//! fastest) the doubts are gone, and what the rest says of the shared numbers lies outside what all steps say of them by more
//! than its own uncertainty can explain. Where nothing is wrong, the rest only knows less: the variance of the difference is
//! then the difference of the variances (Hausman, Econometrica 46, 1978, eq. 2.10).

use crate::joint::parameters::{ALPHA, EXPONENT, LN_COEFFICIENT, LN_DIRECTION};
use crate::joint::rows::StepRows;
use crate::joint::solve::{Covariance, Problem};
use crate::joint::surface::SurfaceScale;
use mapper_core::ReferenceState;

/// Shares of the steps that a region has; the smallest that helps is left out.
const SHARES: [f64; 2] = [1.0 / 6.0, 1.0 / 3.0];
/// Fewest steps of which something can be left out.
const MIN: usize = 9;
/// Standard errors of the difference beyond which the rest disagrees.
const DISAGREES_SIGMAS: f64 = 4.0;
/// Least standard error of the difference of each number: what smooth faults of any model make of it.
const FLOORS: [(usize, f64); 4] =
    [(ALPHA, 0.02), (EXPONENT, 0.02), (LN_COEFFICIENT, 0.02), (LN_DIRECTION, 0.01)];

/// Steps at one end of the map.
pub(crate) struct Region {
    /// For people: "near choke".
    pub(crate) name: &'static str,
    /// Indices of the steps.
    pub(crate) steps: Vec<usize>,
}

/// What of a place (speed and flow, scaled) puts it first in a region.
type Rank = fn(&(f64, f64)) -> f64;

/// All regions, the small ones first; those of equal size stand together.
pub(crate) fn regions(steps: &[StepRows], reference: ReferenceState) -> Vec<Vec<Region>> {
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let Some(scale) = SurfaceScale::of(&places, reference).filter(|_| steps.len() >= MIN) else {
        return Vec::new();
    };
    let coordinates: Vec<(f64, f64)> = places.iter().map(|place| scale.coordinates(*place)).collect();
    let sorted = |of: Rank| {
        let mut order: Vec<usize> = (0..coordinates.len()).collect();
        order.sort_by(|a, b| of(&coordinates[*a]).total_cmp(&of(&coordinates[*b])));
        order
    };
    let ends: [(&'static str, Rank); 4] = [
        ("near choke", |place| -place.1),
        ("near surge", |place| place.1),
        ("at the lowest speeds", |place| place.0),
        ("at the highest speeds", |place| -place.0),
    ];
    let of_size = |share: f64| {
        let count = (share * steps.len() as f64).ceil() as usize;
        ends.iter()
            .map(|(name, of)| Region { name, steps: sorted(*of).into_iter().take(count).collect() })
            .collect()
    };
    SHARES.into_iter().map(of_size).collect()
}

/// By how many standard errors the rest disagrees with all steps, at the shared number where most; `None` within what is
/// expected.
pub(crate) fn disagreement(
    all: (&Problem<'_>, &Covariance),
    rest: (&Problem<'_>, &Covariance),
) -> Option<f64> {
    let error = |(problem, covariance): (&Problem<'_>, &Covariance), index: usize| {
        // A number that is held as declared is known without error.
        if problem.active[index] { covariance.error_of(index) } else { Some(0.0) }
    };
    FLOORS
        .into_iter()
        .filter_map(|(index, floor)| {
            let (of_all, of_rest) = (error(all, index)?, error(rest, index)?);
            let variance = (of_rest * of_rest - of_all * of_all).max(0.0) + floor * floor;
            Some((all.0.shared[index] - rest.0.shared[index]).abs() / variance.sqrt())
        })
        .filter(|sigmas| *sigmas > DISAGREES_SIGMAS)
        .reduce(f64::max)
}
