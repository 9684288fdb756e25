//! What no order can exceed.
//!
//! A step's gradient depends on the state before it, and that on all earlier steps. But after a dwell at a point only
//! part of the states is possible, whatever came before. The largest gradient over that part makes a weight for each
//! jump that no order exceeds, and the best assignment of successors under these weights a sum that no order exceeds.

use crate::assignment::{bottleneck, largest_assignment};
use crate::auction::prices;
use crate::chain::Chain;
use crate::housing::{Housing, Interval};

/// Rounds of narrowing: each multiplies what is left to gain by what the housing remembers of a dwell.
const ROUNDS: usize = 12;
/// Above this many points the sum is bounded by prices that are off by the last of these increments, K.
pub(crate) const EXACT_POINTS: usize = 500;
const INCREMENTS_K: (f64, f64) = (5.0, 0.01);
/// Above this many points there is no bound: its table grows with the square.
pub(crate) const MOST_POINTS: usize = 4000;
/// Above this many points the smallest gradient is bounded without a matching.
const MATCHING_POINTS: usize = 400;

/// Upper bounds on the figures of any order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bound {
    pub(crate) sum_k: f64,
    pub(crate) worst_k: f64,
}

/// Largest possible gradient of each jump, K, row after row.
pub(crate) struct Optimistic {
    n: usize,
    weight_k: Vec<f64>,
    first_k: Vec<f64>,
}

impl Optimistic {
    /// `None` for too many points, and where the reduced housing does not stay within any bounds.
    pub(crate) fn of(housing: &Housing, points: &[usize]) -> Option<Self> {
        let n = points.len();
        if n > MOST_POINTS {
            return None;
        }
        let boxes = reachable_boxes(housing, points)?;
        let mut weight_k = vec![f64::NEG_INFINITY; n * n];
        let mut first_k = vec![0.0; n];
        for (i, &from) in points.iter().enumerate() {
            first_k[i] = housing.first(from).0.map_or(0.0, f64::abs);
            let (c, t) = boxes[i];
            let w = housing.responses[from].speed;
            for (j, &to) in points.iter().enumerate() {
                if i != j && housing.admissible(from, to) {
                    let (low, high) = housing.responses[to].gradient_k.range(c, t, w);
                    weight_k[n * i + j] = low.abs().max(high.abs()).min(housing.gradient_max_k());
                }
            }
        }
        Some(Optimistic { n, weight_k, first_k })
    }

    /// Largest gradient of the step between two places of the list.
    pub(crate) fn weight_k(&self, from: usize, to: usize) -> f64 {
        self.weight_k[self.n * from + to]
    }

    /// The bounds for orders of the first `counted` places; what lies beyond them is visited by repeats alone.
    /// `repeats`: the place of the point that a repeated jump ends at, and how many steps the repeats take in total; their
    /// own gradients do not count. `returns`: the order ends with a jump back to its first point, which counts.
    pub(crate) fn bound(&self, counted: usize, repeats: Option<(usize, usize)>, returns: bool) -> Bound {
        let n = self.n;
        let (repeated, copies) = repeats.unwrap_or((0, 0));
        let real = |i: usize| if i < n { i } else { repeated };
        // One more node closes the path to a circle: the first point follows it, and it follows the last. The way back
        // closes it by itself.
        let end = n + copies;
        let size = if returns { end } else { end + 1 };
        let weight = |i: usize, j: usize| {
            if i == end {
                if j < n { self.first_k[j] } else { -1e9 }
            } else if j >= counted {
                // A repeat, or the way back to the start.
                0.0
            } else {
                self.weight_k(real(i), j).max(-1e9)
            }
        };
        let sum_k = if end <= EXACT_POINTS {
            largest_assignment(size, weight)
        } else {
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
        let first_inside = points.iter().all(|&to| housing.first_state(to).iter().all(|x| x.abs() <= size));
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
            let [c, t] = housing.first_state(to);
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
