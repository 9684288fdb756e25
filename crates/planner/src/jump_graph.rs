//! The jumps that no limit forbids, as a directed graph: the points that one order can reach, and ways around a forbidden jump.

use mapper_core::{AvoidedCrossing, Jump, OperatingPoint, krpm, readable, temperature};
use mapper_physics::operating_point::transition_forecast::{TransitionViolation, surge_excess_ratio};
use petgraph::algo::{astar, tarjan_scc};
use petgraph::graphmap::DiGraphMap;
use std::collections::BTreeMap;
use std::fmt;

/// Cost of a jump over the whole range of speed relative to that of a visit: of two ways with equally many visits, the one with the smaller
/// jumps is chosen. It is small enough that no sum of jumps outweighs a visit.
const SPEED_COST_RATIO: f64 = 1e-3;

/// Reason why a jump is not allowed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Rejection {
    #[error("its surge margin falls to {:.1} %; its limit is {:.1} %", 100.0 * .lowest_ratio, 100.0 * .limit_ratio)]
    SurgeMargin { lowest_ratio: f64, limit_ratio: f64 },
    #[error("the shaft reaches {}; its limit is {}", readable(*.highest_rpm, "rpm"), readable(*.limit_rpm, "rpm"))]
    Overspeed { highest_rpm: f64, limit_rpm: f64 },
    #[error(
        "the shaft overshoots to {}, above its higher target, {}, by more than the allowed {:.1} %",
        readable(*.highest_rpm, "rpm"), readable(*.target_rpm, "rpm"), 100.0 * (.limit_rpm / .target_rpm - 1.0)
    )]
    Overshoot { highest_rpm: f64, target_rpm: f64, limit_rpm: f64 },
    #[error("T2 reaches {}; its limit is {}", temperature(*.highest_k), temperature(*.limit_k))]
    OutletTemperature { highest_k: f64, limit_k: f64 },
    #[error("T3 is {}; its limit is {}", temperature(*.t3_k), temperature(*.limit_k))]
    TurbineInletTemperature { t3_k: f64, limit_k: f64 },
    #[error(
        "the housing temperature changes by {gradient_k:.1} K in the window; its limit is {limit_k:.1} K"
    )]
    HousingGradient { gradient_k: f64, limit_k: f64 },
    #[error(
        "P3 and valve arrive after {needed_s:.1} s; the window begins after {available_s:.1} s: begin `identification.window` later, or \
         write `window: auto`"
    )]
    Arrival { needed_s: f64, available_s: f64 },
    #[error(
        "the shaft is within the speeds to avoid, {} to {} krpm, for {:.1} s; at most {:.1} s are allowed",
        krpm(.0.range.from_rpm), krpm(.0.range.to_rpm), .0.inside_s, .0.range.longest_s
    )]
    Avoided(AvoidedCrossing),
}

impl From<TransitionViolation> for Rejection {
    fn from(violation: TransitionViolation) -> Self {
        match violation {
            TransitionViolation::SurgeMargin { lowest_ratio, limit_ratio } => {
                Rejection::SurgeMargin { lowest_ratio, limit_ratio }
            }
            TransitionViolation::Overspeed { highest_rpm, limit_rpm } => {
                Rejection::Overspeed { highest_rpm, limit_rpm }
            }
            TransitionViolation::Overshoot { highest_rpm, target_rpm, limit_rpm } => {
                Rejection::Overshoot { highest_rpm, target_rpm, limit_rpm }
            }
            TransitionViolation::Avoided(crossing) => Rejection::Avoided(crossing),
        }
    }
}

impl Rejection {
    /// What the jump reaches, relative to its limit.
    pub(crate) fn ratio(&self) -> f64 {
        match *self {
            Rejection::SurgeMargin { lowest_ratio, limit_ratio } => {
                surge_excess_ratio(lowest_ratio, limit_ratio)
            }
            Rejection::Overshoot { highest_rpm, limit_rpm, .. } => highest_rpm / limit_rpm,
            Rejection::Overspeed { highest_rpm, limit_rpm } => highest_rpm / limit_rpm,
            Rejection::OutletTemperature { highest_k, limit_k } => highest_k / limit_k,
            Rejection::TurbineInletTemperature { t3_k, limit_k } => t3_k / limit_k,
            Rejection::HousingGradient { gradient_k, limit_k } => gradient_k.abs() / limit_k,
            Rejection::Arrival { needed_s, available_s } => needed_s / available_s,
            Rejection::Avoided(crossing) => crossing.ratio(),
        }
    }
}

/// A directed graph of points, by their index. Its edges are the allowed jumps.
#[derive(Debug, Clone)]
pub(crate) struct JumpGraph {
    points: Vec<OperatingPoint>,
    allowed: DiGraphMap<usize, f64>,
    /// The most violated limit of each forbidden jump.
    forbidden: BTreeMap<(usize, usize), Rejection>,
}

/// Points that no order can reach together with the others, and the forbidden jumps that violate their limits least.
#[derive(Debug, Clone, PartialEq)]
pub struct SeparatePoints {
    /// The points; allowed jumps connect them with each other.
    pub points: Vec<OperatingPoint>,
    /// The jump from another point, with the limit that forbids it.
    pub into: Option<(Jump, Rejection)>,
    /// The jump to another point, with the limit that forbids it.
    pub out: Option<(Jump, Rejection)>,
}

impl fmt::Display for SeparatePoints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let points = self.points.iter().map(OperatingPoint::to_string).collect::<Vec<_>>().join(", ");
        write!(f, "{points} (")?;
        for (i, (jump, reason)) in [&self.into, &self.out].into_iter().flatten().enumerate() {
            let separator = if i == 0 { "" } else { "; " };
            write!(f, "{separator}{} to {}: {reason}", jump.from, jump.to)?;
        }
        write!(f, ")")
    }
}

impl JumpGraph {
    pub(crate) fn complete(points: &[OperatingPoint]) -> Self {
        let speeds = || points.iter().map(|point| point.speed_rpm);
        let range_rpm = speeds().fold(0.0, f64::max) - speeds().fold(f64::INFINITY, f64::min);
        let cost = |from: usize, to: usize| {
            let change = (points[from].speed_rpm - points[to].speed_rpm) / range_rpm.max(1.0);
            1.0 + SPEED_COST_RATIO * change * change
        };
        let mut allowed = DiGraphMap::new();
        for from in 0..points.len() {
            allowed.add_node(from);
            for to in (0..points.len()).filter(|to| *to != from) {
                allowed.add_edge(from, to, cost(from, to));
            }
        }
        JumpGraph { points: points.to_vec(), allowed, forbidden: BTreeMap::new() }
    }

    /// Removes a jump if there is a reason. Returns whether it was allowed before.
    pub(crate) fn forbid(&mut self, from: usize, to: usize, reasons: &[Rejection]) -> bool {
        let Some(worst) = reasons.iter().max_by(|a, b| a.ratio().total_cmp(&b.ratio())) else { return false };
        self.forbidden.insert((from, to), *worst);
        self.allowed.remove_edge(from, to).is_some()
    }

    pub(crate) fn is_allowed(&self, from: usize, to: usize) -> bool {
        self.allowed.contains_edge(from, to)
    }

    pub(crate) fn forbidden(&self) -> impl Iterator<Item = (usize, usize)> {
        self.forbidden.keys().copied()
    }

    /// The points of the way with the fewest visits between two points, both ends excluded.
    pub(crate) fn points_between(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let (_, way) = astar(&self.allowed, from, |at| at == to, |(.., cost)| *cost, |_| 0.0)?;
        way.get(1..way.len() - 1).map(<[usize]>::to_vec)
    }

    /// The rank of each point in an order that reaches all of them, over other points if necessary; points that allowed jumps connect in
    /// both directions have equal rank.
    pub(crate) fn ranks(&self) -> Result<Vec<usize>, Vec<SeparatePoints>> {
        // Strongly connected components; allowed jumps lead only to components further in front.
        let components = tarjan_scc(&self.allowed);
        let mut component_of = vec![0; self.points.len()];
        for (index, component) in components.iter().enumerate() {
            component.iter().for_each(|point| component_of[*point] = index);
        }
        // For each component: the points of the longest chain that begins there, and its next component.
        let mut chains: Vec<(usize, Option<usize>)> = Vec::new();
        for component in &components {
            let reached = component.iter().flat_map(|point| self.allowed.neighbors(*point));
            let next = reached
                .map(|point| component_of[point])
                .filter(|next| *next < chains.len())
                .max_by_key(|next| (chains[*next].0, *next));
            chains.push((component.len() + next.map_or(0, |next| chains[next].0), next));
        }
        let mut rank_of: Vec<Option<usize>> = vec![None; components.len()];
        let mut at = (0..chains.len()).max_by_key(|index| (chains[*index].0, *index));
        let mut rank = 0;
        while let Some(component) = at {
            rank_of[component] = Some(rank);
            (at, rank) = (chains[component].1, rank + 1);
        }
        let separate = components.iter().enumerate().filter(|(index, _)| rank_of[*index].is_none());
        let separate: Vec<SeparatePoints> = separate.map(|(_, component)| self.separate(component)).collect();
        let ranks = component_of.iter().filter_map(|component| rank_of[*component]).collect();
        if separate.is_empty() { Ok(ranks) } else { Err(separate) }
    }

    fn separate(&self, component: &[usize]) -> SeparatePoints {
        let mut points = component.to_vec();
        points.sort_unstable();
        let least_violated = |ends: &dyn Fn(usize, usize) -> (usize, usize)| {
            let crossing = self.forbidden.iter().filter(|(jump, _)| {
                let (inside, outside) = ends(jump.0, jump.1);
                points.contains(&inside) && !points.contains(&outside)
            });
            let least = crossing.min_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()));
            least
                .map(|(&(from, to), reason)| (Jump { from: self.points[from], to: self.points[to] }, *reason))
        };
        SeparatePoints {
            into: least_violated(&|from, to| (to, from)),
            out: least_violated(&|from, to| (from, to)),
            points: points.iter().map(|point| self.points[*point]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points at 10, 20, 30 ... krpm.
    fn points(count: usize) -> Vec<OperatingPoint> {
        let speeds = (1..=count).map(|line| 10e3 * line as f64);
        speeds.map(|speed_rpm| OperatingPoint { speed_rpm, valve_opening_ratio: 0.5 }).collect()
    }

    /// Overspeed by this percentage.
    fn overspeed(percent: f64) -> Rejection {
        Rejection::Overspeed { highest_rpm: 1e3 * (100.0 + percent), limit_rpm: 100e3 }
    }

    fn graph_of(count: usize, allows: impl Fn(usize, usize) -> bool) -> JumpGraph {
        let mut graph = JumpGraph::complete(&points(count));
        for from in 0..count {
            for to in (0..count).filter(|to| *to != from && !allows(from, *to)) {
                graph.forbid(from, to, &[overspeed((1 + from.abs_diff(to)) as f64)]);
            }
        }
        graph
    }

    #[test]
    fn a_chain_is_walked_point_by_point() {
        let graph = graph_of(5, |from, to| from.abs_diff(to) == 1);
        assert_eq!(graph.points_between(0, 4), Some(vec![1, 2, 3]));
        assert_eq!(graph.points_between(1, 0), Some(vec![]));
        assert_eq!(graph.ranks(), Ok(vec![0; 5]));
    }

    #[test]
    fn one_way_jumps_determine_the_ranks() {
        let graph = graph_of(4, |from, to| to > from);
        assert_eq!(graph.ranks(), Ok(vec![0, 1, 2, 3]));
        assert_eq!(graph.points_between(3, 0), None);
    }

    #[test]
    fn a_point_without_jumps_is_separate_and_names_its_least_violated_limits() {
        let graph = graph_of(4, |from, to| from != 3 && to != 3);
        let separate = graph.ranks().unwrap_err();
        let all = points(4);
        let [only] = &separate[..] else { panic!("{separate:?}") };
        assert_eq!(only.points, [all[3]]);
        // The neighbour at 30 krpm exceeds the limit least, in both directions.
        assert_eq!(only.into, Some((Jump { from: all[2], to: all[3] }, overspeed(2.0))));
        assert_eq!(only.out, Some((Jump { from: all[3], to: all[2] }, overspeed(2.0))));
    }

    #[test]
    fn of_two_branches_the_longer_is_reached() {
        // 0 leads to 1, and to the pair of 2 and 3; nothing connects 1 with the pair.
        let jumps = [(0, 1), (0, 2), (2, 3), (3, 2)];
        let separate = graph_of(4, |from, to| jumps.contains(&(from, to))).ranks().unwrap_err();
        assert_eq!(separate.iter().map(|part| part.points.clone()).collect::<Vec<_>>(), [[points(4)[1]]]);
    }

    proptest! {
        /// Against all permutations: an order over other points exists exactly if some permutation has a way between neighbours.
        #[test]
        fn ranks_agree_with_all_permutations(allowed in prop::collection::vec(any::<bool>(), 25)) {
            let graph = graph_of(5, |from, to| allowed[5 * from + to]);
            let mut most = 0;
            let mut stack: Vec<Vec<usize>> = (0..5).map(|first| vec![first]).collect();
            while let Some(order) = stack.pop() {
                most = most.max(order.len());
                for next in (0..5).filter(|next| !order.contains(next)) {
                    if graph.points_between(order[order.len() - 1], next).is_some() {
                        stack.push([&order[..], &[next]].concat());
                    }
                }
            }
            let left_out: usize = graph.ranks().map_or_else(|separate| separate.iter().map(|part| part.points.len()).sum(), |_| 0);
            prop_assert_eq!(5 - left_out, most);
            if let Ok(ranks) = graph.ranks() {
                for (from, to) in (0..5).flat_map(|from| (0..5).map(move |to| (from, to))) {
                    let leads = from == to || graph.points_between(from, to).is_some();
                    prop_assert_eq!(leads, ranks[from] <= ranks[to]);
                }
            }
        }
    }
}
