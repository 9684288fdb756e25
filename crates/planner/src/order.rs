//! The order of a set of points.

use crate::bound::Optimistic;
use crate::chain::{Chain, gradients_k};
use crate::exact::{self, Figure, branch_and_bound};
use crate::gradient_share::keeping;
use crate::housing::Housing;
use crate::objective::Objective;
use crate::reach::reachable;
use crate::request::{PlanError, PlanRequest};
use crate::search::{Effort, greedy, search, search_worst};
use mapper_core::{OperatingPoint, VisitOrder};
use mapper_physics::model::State;

/// Repeats are put where no gradient falls below this, K, if that can be.
const REPEATS_KEEP_K: f64 = 30.0;
/// An order is called the best when none is better by more than this.
pub(crate) const PROOF_TOLERANCE_RATIO: f64 = 1e-3;
/// Partial orders that a proof may look at: a fraction of a second.
const PROOF_NODES: u64 = 300_000;

/// An order with what is known of it.
#[derive(Debug, Clone)]
pub(crate) struct Ordered {
    pub(crate) order: Vec<usize>,
    /// Whether it is the best within [`PROOF_TOLERANCE_RATIO`] on the reduced housing.
    pub(crate) proven: bool,
    /// Share of the largest sum of gradients that it keeps, where one was asked for.
    pub(crate) gradient_ratio: Option<f64>,
}

impl Ordered {
    fn unproven(order: Vec<usize>) -> Self {
        Ordered { order, proven: false, gradient_ratio: None }
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
        VisitOrder::WorstGradient => Objective::Worst { target_k: REPEATS_KEEP_K },
        VisitOrder::Information | VisitOrder::Time | VisitOrder::Best => Objective::Information,
        VisitOrder::Listed | VisitOrder::SpeedLines | VisitOrder::Greedy | VisitOrder::SumGradient => {
            Objective::Sum
        }
    }
}

/// Orders `given` points of the housing.
pub(crate) fn order_on(
    housing: &Housing,
    points: &[OperatingPoint],
    given: &[usize],
    request: &PlanRequest<'_>,
) -> Ordered {
    // A campaign that is to know much is one with a large sum of what its steps are worth.
    if let (true, Some(by_worth)) = (request.order.needs_method(), housing.by_worth()) {
        if let Some(share) = request.gradient_share {
            let effort = Effort::usual(given.len(), request.effort);
            let kept = keeping(housing, &by_worth, given, share, effort, request.seed);
            return Ordered { gradient_ratio: Some(kept.ratio), ..Ordered::unproven(kept.order) };
        }
        let request = PlanRequest { order: VisitOrder::SumGradient, ..request.clone() };
        return order_on(&by_worth, points, given, &request);
    }
    let effort = Effort::usual(given.len(), request.effort);
    let settled = |from: usize| housing.settled(from);
    let within = |effort, given: &[usize], objective| search(housing, given, objective, effort, request.seed);
    let search = |given: &[usize], objective| within(effort, given, objective);
    let (order, figure) = match request.order {
        VisitOrder::Listed => return Ordered::unproven(given.to_vec()),
        VisitOrder::SpeedLines => {
            let mut order = given.to_vec();
            order.sort_by(|a, b| by_speed_line(&points[*a], &points[*b]));
            return Ordered::unproven(order);
        }
        VisitOrder::Greedy => {
            return Ordered::unproven(greedy(housing, given, Objective::Sum));
        }
        VisitOrder::SumGradient => {
            // Few points: begin with the best order as if the housing settled at each.
            let fixed = exact::best_path(given.len(), |i, j| {
                let (from, to) = (given[i], given[j]);
                let gradient_k = housing.step(from, to, settled(from)).0;
                Objective::Sum.value(housing, from, to, gradient_k)
            });
            let start = fixed.map_or(given.to_vec(), |(_, path)| path.iter().map(|i| given[*i]).collect());
            (search(&start, Objective::Sum), Figure::Sum)
        }
        VisitOrder::WorstGradient => {
            let order = search_worst(housing, given, effort, request.seed);
            (order, Figure::Worst)
        }
        VisitOrder::Information | VisitOrder::Time | VisitOrder::Best => {
            return Ordered::unproven(search(given, Objective::Information));
        }
    };
    let optimistic =
        (order.len() <= exact::HELD_KARP_POINTS).then(|| Optimistic::of(housing, &order)).flatten();
    match optimistic {
        Some(optimistic) => {
            let proof =
                branch_and_bound(housing, &order, &optimistic, figure, PROOF_TOLERANCE_RATIO, PROOF_NODES);
            Ordered { proven: proof.proven, ..Ordered::unproven(proof.order) }
        }
        None => Ordered::unproven(order),
    }
}

/// A set of points in the order of `request.order`, and the gradient expected of each step, K (absolute), by the reduced
/// housing. The points of the request itself play no part. `from_state`: where the machine is now; the first step is
/// then a jump as any other and has a gradient too. Without it the first point comes after the warm-up and has none.
///
/// # Errors
/// [`PlanError`] with all points that cannot be reached.
pub fn order_points(
    request: &PlanRequest<'_>,
    subset: &[OperatingPoint],
    from_state: Option<State>,
) -> Result<(Vec<OperatingPoint>, Vec<f64>), PlanError> {
    if subset.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let targets = reachable(request, subset)?;
    let housing = Housing::of(request, subset, &targets, from_state, None)?;
    let given: Vec<usize> = (0..subset.len()).collect();
    let order = order_on(&housing, subset, &given, request).order;
    let gradients = gradients_k(&housing, &order);
    Ok((order.into_iter().map(|index| subset[index]).collect(), gradients))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::{ForecastRow, WorthOfStep};
    use mapper_core::{DwellEnd, Limits, SettleBands, Timing, WindowRule};
    use mapper_physics::model::Model;
    use proptest::prelude::*;

    /// A worth of no meaning, by what a joint method may look at: the housing on its way, the flow, the jump in speed.
    #[derive(Debug)]
    struct AnyWorth([f64; 3]);

    impl WorthOfStep for AnyWorth {
        fn of(&self, rows: &[ForecastRow]) -> Option<f64> {
            let (first, last) = (rows.first()?, rows.last()?);
            let [heat, flow, speed] = self.0;
            let moved_k = last.tc_k - first.tc_k;
            let jump = (last.speed_rpm - first.speed_rpm) / 1e5;
            Some(1e-4 * (heat * moved_k * moved_k / 100.0 + flow * last.flow_kg_s * moved_k + speed * jump))
        }
    }

    fn request<'a>(model: &'a Model, points: &'a [OperatingPoint]) -> PlanRequest<'a> {
        PlanRequest {
            campaign_name: "test",
            campaign_canonical: "{}",
            model,
            boundary: Default::default(),
            follow_outlet: Default::default(),
            points,
            order: VisitOrder::Information,
            timing: Timing { warm_up_s: 600.0, dwell_s: 40.0, cool_down_s: 0.0, ends: DwellEnd::Planned },
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
            simulations: None,
            repeats: None,
            return_to_first: false,
            appended: None,
            required_sigma_eta: None,
            method: None,
            effort: 0.1,
            draft: false,
            gradient_share: None,
            seed: 1,
        }
    }

    /// What is said of all orders of the points.
    fn of_all<T>(order: &mut Vec<usize>, rest: &[usize], said: &mut Vec<T>, say: &impl Fn(&[usize]) -> T) {
        if rest.is_empty() {
            said.push(say(order));
        }
        for (place, next) in rest.iter().enumerate() {
            let others: Vec<usize> = rest[..place].iter().chain(&rest[place + 1..]).copied().collect();
            order.push(*next);
            of_all(order, &others, said, say);
            order.pop();
        }
    }

    fn largest(housing: &Housing, given: &[usize]) -> f64 {
        let mut figures = Vec::new();
        of_all(&mut Vec::new(), given, &mut figures, &|order| Objective::Sum.figure(housing, order));
        figures.into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// The search for `information` finds what trying all orders finds, and no order exceeds the bound of what it goes by.
        #[test]
        fn brute_force_agrees_on_what_steps_are_worth(
            weights in prop::array::uniform3(-1.0..1.0f64),
            places in prop::sample::subsequence((0..18usize).collect::<Vec<_>>(), 3..=6),
            returns in any::<bool>(),
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
            let worth = AnyWorth(weights);
            let mut housing = Housing::of(&request, &points, &targets, None, Some(&worth)).unwrap();
            housing.returns = returns;
            let given: Vec<usize> = (0..points.len()).collect();
            let found = order_on(&housing, &points, &given, &request);
            let by_worth = housing.by_worth().unwrap();
            let best = largest(&by_worth, &given);
            let value = Objective::Sum.figure(&by_worth, &found.order);
            prop_assert!(value >= best - 2.0 * PROOF_TOLERANCE_RATIO * best.abs(), "{value} {best}");
            if let Some(optimistic) = Optimistic::of(&by_worth, &given) {
                let bound = optimistic.bound(given.len(), None, returns).sum_k;
                prop_assert!(bound >= best - 1e-9 * best.abs(), "{bound} below {best}");
            }
        }

        /// An order that keeps a share of the gradients does, and no order has larger gradients and is worth more.
        #[test]
        fn brute_force_agrees_on_orders_that_keep_gradients(
            weights in prop::array::uniform3(-1.0..1.0f64),
            places in prop::sample::subsequence((0..18usize).collect::<Vec<_>>(), 3..=6),
            share in 0.3..1.0f64,
        ) {
            let model = Model::nominal();
            let points: Vec<OperatingPoint> = places
                .iter()
                .map(|place| OperatingPoint {
                    speed_rpm: 50e3 + 20e3 * (place / 3) as f64,
                    valve_opening_ratio: [0.5, 0.7, 1.0][place % 3],
                })
                .collect();
            let request = PlanRequest { gradient_share: Some(share), ..request(&model, &points) };
            let targets = reachable(&request, &points).unwrap();
            let worth = AnyWorth(weights);
            let housing = Housing::of(&request, &points, &targets, None, Some(&worth)).unwrap();
            let by_worth = housing.by_worth().unwrap();
            let given: Vec<usize> = (0..points.len()).collect();
            let both = |order: &[usize]| {
                (gradients_k(&housing, order).iter().sum::<f64>(), Objective::Sum.figure(&by_worth, order))
            };
            let mut all = Vec::new();
            of_all(&mut Vec::new(), &given, &mut all, &both);
            let over = |value: fn(&(f64, f64)) -> f64| {
                let values = || all.iter().map(value);
                (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
            };
            let ((least_k, most_k), (worst, best)) = (over(|both| both.0), over(|both| both.1));
            let (kept_k, kept) = both(&order_on(&housing, &points, &given, &request).order);
            prop_assert!(kept_k >= (share - 2.0 * PROOF_TOLERANCE_RATIO) * most_k, "{kept_k} of {most_k}");
            // Hundredths of what there is: the weight is found in six halvings.
            let beaten = |(gradient_k, worth): &(f64, f64)| {
                gradient_k - kept_k > 0.02 * (most_k - least_k) && worth - kept > 0.02 * (best - worst)
            };
            prop_assert!(!all.iter().any(beaten), "{kept_k} K and {kept}");
        }
    }
}
