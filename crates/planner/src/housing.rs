//! Reduced housing model for the search: the effect of a dwell at each point on the two housing temperatures.
//!
//! The result of a step is almost linear in the initial temperatures (Tc, Tt) and the previous shaft speed. For each
//! point, six simulations of the full model from states that span the campaign give the coefficients of `1, c, t, w, c^2` (c, t, w: Tc, Tt
//! and the previous speed, scaled to -1..1) for the gradient in the window and for both final temperatures. A step of the search is then
//! three short sums. Every plan states the deviation from the full simulation.

use crate::forecast::forecast;
use crate::request::{PlanError, PlanRequest};
use mapper_core::OperatingPoint;
use mapper_numerics::parallel;
use mapper_physics::operating_point::forecast::warm_up_state;
use mapper_physics::simulation::model::State;
use mapper_physics::simulation::steady::SteadyState;
use std::collections::HashSet;

/// A machine with memory, reduced to the functions that the search needs.
pub trait Chain {
    /// State that one step passes to the next.
    type State: Copy;

    /// Number of points.
    fn len(&self) -> usize;

    /// Whether the chain has no points.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// State after the first step of an order, which has no jump.
    fn first(&self, to: usize) -> Self::State;

    /// Makes the step `from` -> `to` from `state`: change of the housing temperature in the window, K (signed), and the final state.
    fn step(&self, from: usize, to: usize, state: Self::State) -> (f64, Self::State);

    /// Steady state of a point.
    fn settled(&self, at: usize) -> Self::State;

    /// Whether the difference of two states is negligible for all later steps.
    fn is_indistinguishable(&self, a: Self::State, b: Self::State) -> bool;

    /// Whether the jump is allowed.
    fn admissible(&self, _from: usize, _to: usize) -> bool {
        true
    }

    /// Largest allowed gradient, K.
    fn gradient_max_k(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether an order of two or more points ends with a jump back to its first point, which counts like the others.
    fn has_return(&self) -> bool {
        false
    }
}

/// The repeated jump between two points of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RepeatedJump {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) count: usize,
}

/// The jump from the last point of an order back to its first, if the chain has one.
pub(crate) fn return_jump<C: Chain>(chain: &C, order: &[usize]) -> Option<(usize, usize)> {
    match order {
        [first, .., last] if chain.has_return() => Some((*last, *first)),
        _ => None,
    }
}

/// The absolute gradients of an order, K: one for each step with a jump, the return included.
pub fn gradients_k<C: Chain>(chain: &C, order: &[usize]) -> Vec<f64> {
    let mut gradients = Vec::with_capacity(order.len());
    let Some(&first) = order.first() else { return gradients };
    let mut state = chain.first(first);
    for pair in order.windows(2) {
        let (gradient_k, next) = chain.step(pair[0], pair[1], state);
        gradients.push(gradient_k.abs());
        state = next;
    }
    gradients.extend(return_jump(chain, order).map(|(last, first)| chain.step(last, first, state).0.abs()));
    gradients
}

/// Penalty of a forbidden step, K: no order can compensate for it.
pub(crate) const FORBIDDEN_PENALTY_K: f64 = 1e6;

/// Value of one step for the search, K: its gradient, minus the penalty if it is forbidden.
#[inline]
pub(crate) fn value_k<C: Chain>(chain: &C, from: usize, to: usize, gradient_k: f64) -> f64 {
    let size_k = gradient_k.abs();
    let is_forbidden = size_k > chain.gradient_max_k() || !chain.admissible(from, to);
    if is_forbidden { size_k - FORBIDDEN_PENALTY_K } else { size_k }
}

pub(crate) fn sum_k<C: Chain>(chain: &C, order: &[usize]) -> f64 {
    let Some(&first) = order.first() else { return 0.0 };
    let (mut state, mut sum_k) = (chain.first(first), 0.0);
    let jumps = order.windows(2).map(|pair| (pair[0], pair[1])).chain(return_jump(chain, order));
    for (from, to) in jumps {
        let (gradient_k, next) = chain.step(from, to, state);
        sum_k += value_k(chain, from, to, gradient_k);
        state = next;
    }
    sum_k
}

/// Housing temperatures that differ by less, K, lead to later gradients that no sensor can distinguish.
const INDISTINGUISHABLE_K: f64 = 0.01;

/// Scaled (c, t, w) of three of the six initial states; the other three are their mirror images.
const DESIGN: [[f64; 3]; 3] = [[-1.0, -1.0, -1.0], [0.2, -0.6, -1.0], [0.6, 0.0, 1.0]];

/// `k[0] + k[1] c + k[2] t + k[3] w + k[4] c^2`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Surface(pub(crate) [f64; 5]);

impl Surface {
    #[inline]
    pub(crate) fn at(&self, c: f64, t: f64, w: f64) -> f64 {
        let k = &self.0;
        k[0] + (k[1] + k[4] * c) * c + k[2] * t + k[3] * w
    }

    /// Fits values at the initial states of [`DESIGN`] and their mirror images: the odd part exactly, and the even part as a line in c^2
    /// by least squares.
    pub(crate) fn fit(values: [[f64; 2]; 3]) -> Self {
        let odd = values.map(|[a, b]| 0.5 * (a - b));
        let even = values.map(|[a, b]| 0.5 * (a + b));
        let [k1, k2, k3] = solve3(DESIGN, odd);
        let squares = DESIGN.map(|[c, ..]| c * c);
        let mean = |x: [f64; 3]| (x[0] + x[1] + x[2]) / 3.0;
        let (mean_x, mean_y) = (mean(squares), mean(even));
        let slope = (0..3).map(|i| (squares[i] - mean_x) * (even[i] - mean_y)).sum::<f64>()
            / squares.iter().map(|x| (x - mean_x).powi(2)).sum::<f64>();
        Surface([mean_y - slope * mean_x, k1, k2, k3, slope])
    }
}

/// Solves three equations by Cramer's rule; the determinant of [`DESIGN`] is not 0.
fn solve3(m: [[f64; 3]; 3], y: [f64; 3]) -> [f64; 3] {
    let det = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let determinant = det(m);
    std::array::from_fn(|column| {
        let mut replaced = m;
        for row in 0..3 {
            replaced[row][column] = y[row];
        }
        det(replaced) / determinant
    })
}

/// Response of the housing to a dwell at one point.
#[derive(Debug, Clone, Default)]
pub(crate) struct Response {
    pub(crate) gradient_k: Surface,
    /// Scaled Tc and Tt at the end.
    pub(crate) end: [Surface; 2],
    /// Scaled shaft speed of the point, from which the next step starts.
    pub(crate) speed: f64,
    /// The steady state, scaled.
    settled: [f64; 2],
    /// State after the first step of a campaign, scaled.
    first: [f64; 2],
}

/// The reduced model of all points.
#[derive(Debug, Clone)]
pub(crate) struct Housing {
    pub(crate) responses: Vec<Response>,
    forbidden: HashSet<(usize, usize)>,
    gradient_max_k: f64,
    is_indistinguishable: [f64; 2],
    /// Whether the order returns to its first point.
    pub(crate) has_return: bool,
}

/// Middle and half width of the states of a campaign: Tc, Tt, shaft speed.
#[derive(Debug, Clone, Copy)]
struct Scale {
    middle: [f64; 3],
    half: [f64; 3],
}

impl Scale {
    fn new(targets: &[SteadyState]) -> Self {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for state in targets.iter().map(|target| target.state) {
            for (i, value) in [state.tc_k, state.tt_k, state.shaft_speed_rad_s].into_iter().enumerate() {
                (low[i], high[i]) = (low[i].min(value), high[i].max(value));
            }
        }
        Scale {
            middle: [0, 1, 2].map(|i| 0.5 * (low[i] + high[i])),
            // A grid of one point needs a width too.
            half: [0, 1, 2].map(|i| (0.5 * (high[i] - low[i])).max(1.0)),
        }
    }

    fn scaled(&self, state: &State) -> [f64; 3] {
        let values = [state.tc_k, state.tt_k, state.shaft_speed_rad_s];
        std::array::from_fn(|i| (values[i] - self.middle[i]) / self.half[i])
    }
}

impl Housing {
    /// Simulates steps of `dwell_s` to all points.
    pub(crate) fn new(
        request: &PlanRequest<'_>,
        points: &[OperatingPoint],
        targets: &[SteadyState],
        dwell_s: f64,
    ) -> Result<Self, PlanError> {
        let scale = Scale::new(targets);
        let slowest_and_fastest = slowest_and_fastest(targets).ok_or(PlanError::NoPoints)?;
        let targets: Vec<(OperatingPoint, &SteadyState)> = points.iter().copied().zip(targets).collect();
        let simulate = |(to, target): &(OperatingPoint, &SteadyState)| {
            simulate_response(request, target, dwell_s, &scale, slowest_and_fastest)
                .map_err(|source| PlanError::Forecast { to: *to, source })
        };
        Ok(Housing {
            responses: parallel::try_map(&targets, simulate)?,
            forbidden: HashSet::new(),
            gradient_max_k: request.limits.housing_gradient_max_k.unwrap_or(f64::INFINITY),
            is_indistinguishable: [INDISTINGUISHABLE_K / scale.half[0], INDISTINGUISHABLE_K / scale.half[1]],
            has_return: false,
        })
    }

    /// Forbids the jump between two points.
    pub(crate) fn forbid(&mut self, from: usize, to: usize) {
        self.forbidden.insert((from, to));
    }
}

fn slowest_and_fastest(targets: &[SteadyState]) -> Option<[&SteadyState; 2]> {
    let by_speed =
        |a: &&SteadyState, b: &&SteadyState| a.state.shaft_speed_rad_s.total_cmp(&b.state.shaft_speed_rad_s);
    Some([targets.iter().min_by(by_speed)?, targets.iter().max_by(by_speed)?])
}

/// Initial states of the simulations for each point, and the points before them; they span the campaign.
fn start_states<'a>(
    scale: &Scale,
    [slowest, fastest]: [&'a SteadyState; 2],
) -> [[(State, &'a SteadyState); 2]; 3] {
    DESIGN.map(|design| {
        [1.0, -1.0].map(|sign| {
            let [c, t, w] = design.map(|x| sign * x);
            let gas = if w < 0.0 { slowest } else { fastest };
            let state = State {
                tc_k: scale.middle[0] + c * scale.half[0],
                tt_k: scale.middle[1] + t * scale.half[1],
                ..gas.state
            };
            (state, gas)
        })
    })
}

fn simulate_response(
    request: &PlanRequest<'_>,
    target: &SteadyState,
    dwell_s: f64,
    scale: &Scale,
    [slowest, fastest]: [&SteadyState; 2],
) -> Result<Response, mapper_physics::simulation::simulate::SimulationError> {
    let mut gradient_k = [[0.0; 2]; 3];
    let mut end = [[[0.0; 2]; 3]; 2];
    for (i, pair) in start_states(scale, [slowest, fastest]).into_iter().enumerate() {
        for (j, (state, from)) in pair.into_iter().enumerate() {
            let forecast = forecast(request, state, Some(from), target, dwell_s)?;
            gradient_k[i][j] = forecast.predicted.dtc_k.unwrap_or(0.0);
            let [tc, tt, _] = scale.scaled(&forecast.step.end);
            (end[0][i][j], end[1][i][j]) = (tc, tt);
        }
    }
    let first_step_s = request.timing.warm_up_s + dwell_s;
    let first = scale.scaled(&warm_up_state(request.model, target.state, &target.boundary, first_step_s)?);
    let settled = scale.scaled(&target.state);
    Ok(Response {
        gradient_k: Surface::fit(gradient_k),
        end: end.map(Surface::fit),
        speed: settled[2],
        settled: [settled[0], settled[1]],
        first: [first[0], first[1]],
    })
}

impl Chain for Housing {
    type State = [f64; 2];

    fn len(&self) -> usize {
        self.responses.len()
    }

    fn first(&self, to: usize) -> [f64; 2] {
        self.responses[to].first
    }

    #[inline]
    fn step(&self, from: usize, to: usize, [c, t]: [f64; 2]) -> (f64, [f64; 2]) {
        let (response, w) = (&self.responses[to], self.responses[from].speed);
        (response.gradient_k.at(c, t, w), [response.end[0].at(c, t, w), response.end[1].at(c, t, w)])
    }

    fn settled(&self, at: usize) -> [f64; 2] {
        self.responses[at].settled
    }

    #[inline]
    fn is_indistinguishable(&self, a: [f64; 2], b: [f64; 2]) -> bool {
        (a[0] - b[0]).abs() < self.is_indistinguishable[0]
            && (a[1] - b[1]).abs() < self.is_indistinguishable[1]
    }

    #[inline]
    fn admissible(&self, from: usize, to: usize) -> bool {
        self.forbidden.is_empty() || !self.forbidden.contains(&(from, to))
    }

    fn has_return(&self) -> bool {
        self.has_return
    }

    fn gradient_max_k(&self) -> f64 {
        self.gradient_max_k
    }
}
