//! What no order can exceed.
//!
//! A step's gradient depends on the state before it, and that on all earlier steps. But after a dwell at a point only
//! part of the states is possible, whatever came before. The largest gradient over that part makes a weight for each
//! jump that no order exceeds, and the best assignment of successors under these weights a sum that no order exceeds. Of up to
//! [`EXACT_POINTS`] points `relaxation` makes that sum smaller.

use crate::thermal_memory::chain::Chain;
use crate::thermal_memory::housing::{Housing, Interval, StateBox};
use crate::upper_bound::assignment::bottleneck;
use crate::upper_bound::auction::prices;
use crate::upper_bound::relaxation::{Repeated, Visited, bounded_sum_k};

/// Rounds of narrowing: each multiplies the remaining gain by what the housing remembers of a dwell.
const ROUNDS: usize = 12;
/// Above this many points the sum is bounded by prices that are off by the last of these increments, K.
pub(crate) const EXACT_POINTS: usize = 500;
const INCREMENTS_K: (f64, f64) = (5.0, 0.01);
/// Above this many points no bound is computed: its table grows with the square.
pub(crate) const MAX_POINTS: usize = 4000;
/// Above this many points the smallest gradient is bounded without a matching.
const MATCHING_POINTS: usize = 400;

/// Upper bounds on the figures of any order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bound {
    pub(crate) sum_k: f64,
    pub(crate) worst_k: f64,
}

/// Largest possible gradient of each jump, K, row after row.
pub(crate) struct Optimistic<'a> {
    housing: &'a Housing,
    points: Vec<usize>,
    boxes: Vec<StateBox>,
    n: usize,
    weight_k: Vec<f64>,
}

impl<'a> Optimistic<'a> {
    /// `None` for too many points, and where the reduced housing does not stay within any bounds.
    pub(crate) fn of(housing: &'a Housing, points: &[usize]) -> Option<Self> {
        let n = points.len();
        if n > MAX_POINTS {
            return None;
        }
        let boxes = reachable_boxes(housing, points)?;
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
        Some(Optimistic { housing, points: points.to_vec(), boxes, n, weight_k })
    }

    /// Largest gradient of the step between two places of the list.
    pub(crate) fn weight_k(&self, from: usize, to: usize) -> f64 {
        self.weight_k[self.n * from + to]
    }

    /// The bounds for orders of the first `counted` places; what lies beyond them is visited by repeats alone, whose own gradients do not
    /// count. `returns`: the order ends with a jump back to its first point, which counts. `found_k`: the sum of an order.
    pub(crate) fn bound(
        &self,
        counted: usize,
        repeated: Option<Repeated>,
        returns: bool,
        found_k: f64,
    ) -> Bound {
        let n = self.n;
        let copies = repeated.map_or(0, |repeated| 2 * repeated.count);
        let real = |i: usize| match repeated {
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
        let sum_k = if end <= EXACT_POINTS {
            let (housing, points, boxes) = (self.housing, &self.points, &self.boxes);
            bounded_sum_k(&Visited { housing, points, counted, boxes, repeated, returns }, found_k)
        } else {
            // One more node closes the path to a circle: the first point follows it, and it follows the last. The way back closes it
            // by itself.
            let size = if returns { end } else { end + 1 };
            let weight = |i: usize, j: usize| {
                if i == end {
                    if j < n { 0.0 } else { -1e9 }
                } else if j >= counted {
                    // A repeat, or the way back to the start.
                    0.0
                } else {
                    self.weight_k(real(i), j).max(-1e9)
                }
            };
            let table: Vec<f64> = (0..size * size).map(|place| weight(place / size, place % size)).collect();
            prices(size, &table, INCREMENTS_K).bound
        };
        let worst_k = if n <= MATCHING_POINTS {
            bottleneck(counted, end, usize::from(!returns), |j, i| self.weight_k(real(i), j))
        } else {
            // All points have a step that leads to them, but for the first where nothing goes back to it.
            let into = |j: usize| (0..n).map(|i| self.weight_k(i, j)).fold(f64::NEG_INFINITY, f64::max);
            let mut best: Vec<f64> = (0..counted).map(into).collect();
            best.sort_by(f64::total_cmp);
            best.get(usize::from(!returns)).copied().unwrap_or(f64::INFINITY)
        };
        Bound { sum_k, worst_k }
    }
}

/// For each point the box of scaled states that a dwell there can end in.
pub(crate) fn reachable_boxes(housing: &Housing, points: &[usize]) -> Option<Vec<(Interval, Interval)>> {
    let everything = |size: f64| ((-size, size), (-size, size));
    let within = |inner: Interval, outer: Interval| inner.0 >= outer.0 && inner.1 <= outer.1;
    for size in [1.5, 3.0, 6.0] {
        let first_inside = points.iter().all(|&to| housing.first(to).iter().all(|x| x.abs() <= size));
        let mut boxes = vec![everything(size); points.len()];
        let images = narrowed(housing, points, &boxes);
        let inside =
            |image: &(Interval, Interval)| within(image.0, (-size, size)) && within(image.1, (-size, size));
        if !(first_inside && images.iter().all(inside)) {
            continue;
        }
        boxes = images;
        // The cost of a round is the square of the number of points.
        for _ in 1..if points.len() > 500 { ROUNDS / 3 } else { ROUNDS } {
            boxes = narrowed(housing, points, &boxes);
        }
        return Some(boxes);
    }
    None
}

fn narrowed(
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
    use crate::request::PlanRequest;
    use crate::targets::reachable;
    use crate::thermal_memory::chain::gradients_k;
    use mapper_core::{Dwell, Limits, OperatingPoint, SettleBands, Timing, VisitOrder, WindowRule};
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
            },
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

    /// The visits of an order with the jump between its first two points in number repeated behind the places in the mask, and whether
    /// each of them counts.
    fn with_jump(order: &[usize], behind: usize) -> Vec<(usize, bool)> {
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

        /// No order of some points, made with a repeated jump at any places and with a way back or none, has a larger sum than the bound;
        /// the bound is close to the best of them where the housing remembers most, in short steps.
        #[test]
        fn no_order_exceeds_the_bound(
            places in prop::sample::subsequence((0..18usize).collect::<Vec<_>>(), 3..=5),
            dwell_s in 20.0..90.0f64,
            returns in any::<bool>(),
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
            let targets = reachable(&request, &points).unwrap();
            let mut housing = Housing::of(&request, &points, &targets, dwell_s).unwrap();
            let mut best_k = f64::NEG_INFINITY;
            permute(&mut (0..points.len()).collect::<Vec<_>>(), 0, &mut |order| {
                for behind in (0..1usize << order.len()).filter(|mask| mask.count_ones() as usize == repeats) {
                    let mut visits = with_jump(order, behind);
                    if returns && visits.last().is_some_and(|last| last.0 != order[0]) {
                        visits.push((order[0], true));
                    } else if returns {
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
            housing.returns = returns;
            let given: Vec<usize> = (0..points.len()).collect();
            let repeated = (repeats > 0).then_some(Repeated { from: 0, to: 1, count: repeats });
            if let Some(optimistic) = Optimistic::of(&housing, &given) {
                for found_k in [0.0, best_k] {
                    let bound_k = optimistic.bound(points.len(), repeated, returns, found_k).sum_k;
                    // Sums of at most ten numbers.
                    prop_assert!(bound_k >= best_k - 1e-9, "{bound_k} below {best_k}");
                }
            }
        }
    }
}
