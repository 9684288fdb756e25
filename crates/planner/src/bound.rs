//! Upper bounds on the gradients of any order.
//!
//! The gradient of a step depends on the state before it, and therefore on all earlier steps. But a dwell at a point always ends in a limited
//! range of states. The largest gradient over that range is an upper bound for the jump, and the best assignment of
//! successors with these weights is an upper bound on the sum of any order. For up to [`MAX_RELAXATION_POINTS`] points, a
//! Lagrangian relaxation gives a tighter bound.

use crate::assignment::{run_auction, solve_bottleneck};
use crate::housing::{Chain, Housing, Interval, RepeatedJump, StateBox};
use crate::relaxation::{RelaxationProblem, bound_sum_k};

/// Rounds of narrowing the ranges: each multiplies the remaining excess by the memory of the housing over one dwell.
const ROUNDS: usize = 12;
/// Above this many points an auction bounds the sum instead of the relaxation.
pub(crate) const MAX_RELAXATION_POINTS: usize = 500;
/// First and last increments of the auction, K.
const INCREMENTS_K: (f64, f64) = (5.0, 0.01);
/// Above this many points no bound is computed: its table grows with the square.
pub(crate) const MAX_POINTS: usize = 4000;
/// Above this many points the minimum gradient is bounded without a matching.
const MAX_MATCHING_POINTS: usize = 400;

/// Upper bounds on the figures of any order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bound {
    pub(crate) sum_k: f64,
    pub(crate) min_k: f64,
}

/// Largest possible gradient of each jump, K, row after row.
pub(crate) struct GradientBounds<'a> {
    housing: &'a Housing,
    points: Vec<usize>,
    boxes: Vec<StateBox>,
    n: usize,
    weight_k: Vec<f64>,
}

impl<'a> GradientBounds<'a> {
    /// `None` for too many points, or if the states of the reduced housing have no finite bound.
    pub(crate) fn new(housing: &'a Housing, points: &[usize]) -> Option<Self> {
        let n = points.len();
        if n > MAX_POINTS {
            return None;
        }
        let boxes = bound_states(housing, points)?;
        let mut weight_k = vec![f64::NEG_INFINITY; n * n];
        for (i, &from) in points.iter().enumerate() {
            let (c, t) = boxes[i];
            let w = housing.responses[from].speed;
            for (j, &to) in points.iter().enumerate() {
                if i != j && housing.admissible(from, to) {
                    let (low, high) = housing.responses[to].gradient_k.range(c, t, w);
                    weight_k[n * i + j] = low.abs().max(high.abs()).min(housing.gradient_max_k());
                }
            }
        }
        Some(GradientBounds { housing, points: points.to_vec(), boxes, n, weight_k })
    }

    /// Largest gradient of the jump between two points of the list.
    pub(crate) fn weight_k(&self, from: usize, to: usize) -> f64 {
        self.weight_k[self.n * from + to]
    }

    /// Bounds for orders of the first `counted` places. Only repeats visit the others, and their gradients do not count. `has_return`:
    /// the order ends with a jump back to its first point, which counts. `found_k`: the sum of a known order.
    pub(crate) fn bound(
        &self,
        counted: usize,
        repeated: Option<RepeatedJump>,
        has_return: bool,
        found_k: f64,
    ) -> Bound {
        let n = self.n;
        let copies = repeated.map_or(0, |repeated| 2 * repeated.count);
        let original = |i: usize| match repeated {
            Some(repeated) if i >= n => {
                if (i - n).is_multiple_of(2) {
                    repeated.from
                } else {
                    repeated.to
                }
            }
            _ => i,
        };
        let end = n + copies;
        let sum_k = if end <= MAX_RELAXATION_POINTS {
            let (housing, points, boxes) = (self.housing, &self.points, &self.boxes);
            bound_sum_k(&RelaxationProblem { housing, points, counted, boxes, repeated, has_return }, found_k)
        } else {
            // An extra node closes the path to a cycle: it follows the last point and precedes the first. A return jump closes the
            // cycle itself.
            let size = if has_return { end } else { end + 1 };
            let weight = |i: usize, j: usize| {
                if i == end {
                    if j < n { 0.0 } else { -1e9 }
                } else if j >= counted {
                    // A repeat, or the end of the path.
                    0.0
                } else {
                    self.weight_k(original(i), j).max(-1e9)
                }
            };
            let table: Vec<f64> = (0..size * size).map(|place| weight(place / size, place % size)).collect();
            run_auction(size, &table, INCREMENTS_K).bound
        };
        let min_k = if n <= MAX_MATCHING_POINTS {
            solve_bottleneck(counted, end, usize::from(!has_return), |j, i| self.weight_k(original(i), j))
        } else {
            // A step leads to every point, except to the first if the order does not return.
            let max_into = |j: usize| (0..n).map(|i| self.weight_k(i, j)).fold(f64::NEG_INFINITY, f64::max);
            let mut best: Vec<f64> = (0..counted).map(max_into).collect();
            best.sort_by(f64::total_cmp);
            best.get(usize::from(!has_return)).copied().unwrap_or(f64::INFINITY)
        };
        Bound { sum_k, min_k }
    }
}

/// Bounds the scaled states at the end of a dwell at each point.
pub(crate) fn bound_states(housing: &Housing, points: &[usize]) -> Option<Vec<(Interval, Interval)>> {
    let full_range = |size: f64| ((-size, size), (-size, size));
    let within = |inner: Interval, outer: Interval| inner.0 >= outer.0 && inner.1 <= outer.1;
    for size in [1.5, 3.0, 6.0] {
        let first_inside = points.iter().all(|&to| housing.first(to).iter().all(|x| x.abs() <= size));
        let mut boxes = vec![full_range(size); points.len()];
        let images = propagate_boxes(housing, points, &boxes);
        let inside =
            |image: &(Interval, Interval)| within(image.0, (-size, size)) && within(image.1, (-size, size));
        if !(first_inside && images.iter().all(inside)) {
            continue;
        }
        boxes = images;
        // The cost of a round grows with the square of the number of points.
        for _ in 1..if points.len() > 500 { ROUNDS / 3 } else { ROUNDS } {
            boxes = propagate_boxes(housing, points, &boxes);
        }
        return Some(boxes);
    }
    None
}

fn propagate_boxes(
    housing: &Housing,
    points: &[usize],
    boxes: &[(Interval, Interval)],
) -> Vec<(Interval, Interval)> {
    let hull = |a: Interval, b: Interval| (a.0.min(b.0), a.1.max(b.1));
    points
        .iter()
        .enumerate()
        .map(|(i, &to)| {
            let [c, t] = housing.first(to);
            let mut image = ((c, c), (t, t));
            for (k, &from) in points.iter().enumerate() {
                if k != i && housing.admissible(from, to) {
                    let w = housing.responses[from].speed;
                    let (c, t) = boxes[k];
                    let end = &housing.responses[to].end;
                    image = (hull(image.0, end[0].range(c, t, w)), hull(image.1, end[1].range(c, t, w)));
                }
            }
            image
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::housing::gradients_k;
    use crate::request::PlanRequest;
    use crate::request::solve_steady_states;
    use mapper_core::{
        Dwell, Limits, OperatingPoint, RigActuators, SettleBands, Timing, VisitOrder, WindowRule,
    };
    use mapper_physics::simulation::model::Model;
    use proptest::prelude::*;

    fn request<'a>(model: &'a Model, points: &'a [OperatingPoint]) -> PlanRequest<'a> {
        PlanRequest {
            campaign_name: "test",
            campaign_canonical: "{}",
            model,
            boundary: Default::default(),
            follow_outlet: Default::default(),
            points,
            order: VisitOrder::ThermalGradient,
            timing: Timing { warm_up_s: 120.0, cool_down_s: 0.0, dwell: Dwell::Fixed(40.0) },
            window: WindowRule::Auto,
            settle_bands: SettleBands::default(),
            limits: Limits {
                speed_max_rpm: 180e3,
                p3_min_pa: 110e3,
                p3_max_pa: 500e3,
                p3_stroke_s: None,
                t3_max_k: None,
                t2_max_k: None,
                surge_margin_min_ratio: None,
                housing_gradient_max_k: None,
                overshoot_max_ratio: None,
                avoid: mapper_core::AvoidedSpeeds::NONE,
            },
            actuators: RigActuators::default(),
            repeats: None,
            return_to_first: false,
            appended: None,
            method: None,
            effort: 0.1,
            bound: true,
            seed: 1,
        }
    }

    fn permute(order: &mut [usize], from: usize, visit: &mut impl FnMut(&[usize])) {
        if from == order.len() {
            return visit(order);
        }
        for other in from..order.len() {
            order.swap(from, other);
            permute(order, from + 1, visit);
            order.swap(from, other);
        }
    }

    /// The visits of an order, with the jump from point 0 to point 1 repeated behind the places in the mask, and whether each visit counts.
    fn insert_repeats(order: &[usize], behind: usize) -> Vec<(usize, bool)> {
        let mut visits = Vec::new();
        for (place, &point) in order.iter().enumerate() {
            visits.push((point, place > 0));
            if behind >> place & 1 == 1 {
                if point != 0 {
                    visits.push((0, false));
                }
                visits.push((1, false));
            }
        }
        visits
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

                /// No order of some points has a larger sum than the bound, wherever the jump is repeated, with or without a return.
        #[test]
        fn no_order_exceeds_the_bound(
            places in prop::sample::subsequence((0..18usize).collect::<Vec<_>>(), 3..=5),
            dwell_s in 20.0..90.0f64,
            has_return in any::<bool>(),
            repeats in 0usize..=2,
        ) {
            let model = Model::nominal();
            let points: Vec<OperatingPoint> = places
                .iter()
                .map(|place| OperatingPoint {
                    speed_rpm: 50e3 + 20e3 * (place / 3) as f64,
                    valve_opening_ratio: [0.5, 0.7, 1.0][place % 3],
                })
                .collect();
            let request = request(&model, &points);
            let targets = solve_steady_states(&request, &points).unwrap();
            let mut housing = Housing::new(&request, &points, &targets, dwell_s).unwrap();
            let mut best_k = f64::NEG_INFINITY;
            permute(&mut (0..points.len()).collect::<Vec<_>>(), 0, &mut |order| {
                for behind in (0..1usize << order.len()).filter(|mask| mask.count_ones() as usize == repeats) {
                    let mut visits = insert_repeats(order, behind);
                    if has_return && visits.last().is_some_and(|last| last.0 != order[0]) {
                        visits.push((order[0], true));
                    } else if has_return {
                        continue;
                    }
                    if visits.windows(2).any(|pair| pair[0].0 == pair[1].0) {
                        continue;
                    }
                    let path: Vec<usize> = visits.iter().map(|visit| visit.0).collect();
                    let gradients_k = gradients_k(&housing, &path);
                    let counted = gradients_k.iter().zip(&visits[1..]).filter(|(_, visit)| visit.1);
                    best_k = best_k.max(counted.map(|(gradient_k, _)| gradient_k).sum());
                }
            });
            prop_assume!(best_k.is_finite());
            housing.has_return = has_return;
            let given: Vec<usize> = (0..points.len()).collect();
            let repeated = (repeats > 0).then_some(RepeatedJump { from: 0, to: 1, count: repeats });
            if let Some(gradient_bounds) = GradientBounds::new(&housing, &given) {
                for found_k in [0.0, best_k] {
                    let bound_k = gradient_bounds.bound(points.len(), repeated, has_return, found_k).sum_k;
                    // Sums of at most ten numbers.
                    prop_assert!(bound_k >= best_k - 1e-9, "{bound_k} below {best_k}");
                }
            }
        }
    }
}
