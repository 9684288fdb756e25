//! The order of a set of points.

use crate::ordering::exact::{Figure, branch_and_bound};
use crate::ordering::objective::Objective;
use crate::ordering::search::{Effort, search, search_worst};
use crate::request::PlanRequest;
use crate::thermal_memory::housing::Housing;
use crate::upper_bound::bound::Optimistic;
use mapper_core::{OperatingPoint, VisitOrder};

/// Repeats are put where no gradient falls below this, K, if that can be.
const REPEATS_KEEP_K: f64 = 30.0;
/// An order is called the best when none is better by more than this.
pub(crate) const PROOF_TOLERANCE_RATIO: f64 = 1e-3;
/// Up to this many points a proof is tried: within [`PROOF_NODES`] it hardly ever ends for more.
const MAX_PROVEN_POINTS: usize = 14;
/// Partial orders that a proof may look at: a fraction of a second.
const PROOF_NODES: u64 = 300_000;

/// An order with what is known of it.
#[derive(Debug, Clone)]
pub(crate) struct Ordered {
    pub(crate) order: Vec<usize>,
    /// Whether it is the best within [`PROOF_TOLERANCE_RATIO`] on the reduced housing.
    pub(crate) proven: bool,
}

impl Ordered {
    fn unproven(order: Vec<usize>) -> Self {
        Ordered { order, proven: false }
    }
}

/// Along speed lines: by speed, on each line from the widest opening to the narrowest.
pub(crate) fn by_speed_line(a: &OperatingPoint, b: &OperatingPoint) -> std::cmp::Ordering {
    let by_opening = b.valve_opening_ratio.total_cmp(&a.valve_opening_ratio);
    a.speed_rpm.total_cmp(&b.speed_rpm).then(by_opening)
}

/// What the search makes large for this order.
pub(crate) fn objective(order: VisitOrder) -> Objective {
    match order {
        VisitOrder::MinGradient => Objective::Worst { target_k: REPEATS_KEEP_K },
        _ => Objective::Sum,
    }
}

/// Orders of the `given` points of the housing, the best first; more than one where their repeats decide.
pub(crate) fn orders_on(
    housing: &Housing,
    points: &[OperatingPoint],
    given: &[usize],
    request: &PlanRequest<'_>,
) -> Vec<Ordered> {
    let effort = Effort::usual(given.len(), request.effort);
    let (orders, figure) = match request.order {
        VisitOrder::Listed => return vec![Ordered::unproven(given.to_vec())],
        VisitOrder::SpeedLines | VisitOrder::Conventional => {
            let mut order = given.to_vec();
            order.sort_by(|a, b| by_speed_line(&points[*a], &points[*b]));
            return vec![Ordered::unproven(order)];
        }
        VisitOrder::ThermalGradient => {
            (search(housing, given, Objective::Sum, effort, request.seed), Figure::Sum)
        }
        VisitOrder::MinGradient => (vec![search_worst(housing, given, effort, request.seed)], Figure::Worst),
    };
    let best = orders.first().filter(|order| request.bound && order.len() <= MAX_PROVEN_POINTS);
    let optimistic = best.and_then(|order| Some((order, Optimistic::of(housing, order)?)));
    if let Some((order, optimistic)) = optimistic {
        let proof = branch_and_bound(housing, order, &optimistic, figure, PROOF_TOLERANCE_RATIO, PROOF_NODES);
        if proof.proven {
            return vec![Ordered { order: proof.order, proven: true }];
        }
    }
    orders.into_iter().map(Ordered::unproven).collect()
}
