//! The profile of alpha_A: the increase of the sum of squares if alpha_A is fixed at a given value.

use crate::joint::fit::solve::Problem;
use crate::joint::step_model::parameters::ALPHA;
use mapper_core::ProfilePoint;

/// Values at which alpha_A is fixed: the range found in compressors.
const GRID: [f64; 9] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];

/// Convergence tolerance on the sum of squares: a profile is compared with 3.84.
const ENOUGH_SQUARE: f64 = 0.1;

/// Refits all other parameters at each value, without the prior of alpha_A. Empty if alpha_A is not fitted or a fit does not converge.
pub(crate) fn alpha_area(problem: &Problem<'_>) -> Vec<ProfilePoint> {
    if !problem.active[ALPHA] {
        return Vec::new();
    }
    let mut held = problem.clone();
    held.active[ALPHA] = false;
    let mut profile = Vec::with_capacity(GRID.len());
    for value in GRID {
        held.shared[ALPHA] = value;
        let Some(square) = held.minimise(ENOUGH_SQUARE) else { return Vec::new() };
        profile.push(ProfilePoint { value, square });
    }
    let best = profile.iter().map(|point| point.square).fold(f64::INFINITY, f64::min);
    for point in &mut profile {
        point.square -= best;
    }
    profile
}
