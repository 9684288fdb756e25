//! Orders a set of points by the criterion of the request.

use crate::ordering::exact::{Figure, branch_and_bound};
use crate::ordering::objective::Objective;
use crate::ordering::search::{Effort, search, search_min_gradient};
use crate::request::PlanRequest;
use crate::thermal_memory::housing::Housing;
use crate::upper_bound::bound::GradientBounds;
use mapper_core::{OperatingPoint, VisitOrder};

/// Repeats are inserted so that gradients stay above this, K, if possible.
const REPEATS_KEEP_K: f64 = 30.0;
/// An order is proven to be the best if no other order is better by more than this.
pub(crate) const PROOF_TOLERANCE_RATIO: f64 = 1e-3;
/// Maximum number of points for a proof: with more points it rarely ends within [`PROOF_NODES`].
const MAX_PROVEN_POINTS: usize = 14;
/// Maximum number of partial orders of a proof: a fraction of a second.
const PROOF_NODES: u64 = 300_000;

#[derive(Debug, Clone)]
pub(crate) struct PointOrder {
    pub(crate) order: Vec<usize>,
    /// Whether the order is proven to be the best within [`PROOF_TOLERANCE_RATIO`] on the reduced housing.
    pub(crate) proven: bool,
}

impl PointOrder {
    fn unproven(order: Vec<usize>) -> Self {
        PointOrder { order, proven: false }
    }
}

/// Order along speed lines: by speed, and on each line from the widest opening to the narrowest.
pub(crate) fn compare_along_speed_lines(a: &OperatingPoint, b: &OperatingPoint) -> std::cmp::Ordering {
    let by_opening = b.valve_opening_ratio.total_cmp(&a.valve_opening_ratio);
    a.speed_rpm.total_cmp(&b.speed_rpm).then(by_opening)
}

/// The objective of the search for this kind of order.
pub(crate) fn objective(order: VisitOrder) -> Objective {
    match order {
        VisitOrder::MinGradient => Objective::Minimum { target_k: REPEATS_KEEP_K },
        _ => Objective::Sum,
    }
}

/// Searches orders of the `given` points, the best first. Several are returned because repeats may change their ranking.
pub(crate) fn search_orders(
    housing: &Housing,
    points: &[OperatingPoint],
    given: &[usize],
    request: &PlanRequest<'_>,
) -> Vec<PointOrder> {
    let effort = Effort::usual(given.len(), request.effort);
    let (orders, figure) = match request.order {
        VisitOrder::Listed => return vec![PointOrder::unproven(given.to_vec())],
        VisitOrder::SpeedLines | VisitOrder::Conventional => {
            let mut order = given.to_vec();
            order.sort_by(|a, b| compare_along_speed_lines(&points[*a], &points[*b]));
            return vec![PointOrder::unproven(order)];
        }
        VisitOrder::ThermalGradient => {
            (search(housing, given, Objective::Sum, effort, request.seed), Figure::Sum)
        }
        VisitOrder::MinGradient => {
            (vec![search_min_gradient(housing, given, effort, request.seed)], Figure::Minimum)
        }
    };
    let best = orders.first().filter(|order| request.bound && order.len() <= MAX_PROVEN_POINTS);
    let gradient_bounds = best.and_then(|order| Some((order, GradientBounds::new(housing, order)?)));
    if let Some((order, gradient_bounds)) = gradient_bounds {
        let proof =
            branch_and_bound(housing, order, &gradient_bounds, figure, PROOF_TOLERANCE_RATIO, PROOF_NODES);
        if proof.proven {
            return vec![PointOrder { order: proof.order, proven: true }];
        }
    }
    orders.into_iter().map(PointOrder::unproven).collect()
}
