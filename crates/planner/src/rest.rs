//! What is left of a plan while it is run: its steps gone through from where the machine really is, and a better order of them.
//!
//! The reduced housing of the campaign's points is made once. What a step would tell is kept at the starts from which each
//! point was simulated, so that an order is sought anew, by whatever that is worth by then, in milliseconds.

use crate::chain::Chain;
use crate::forecast::{Forecast, forecast};
use crate::graph::rejections;
use crate::housing::{Housing, Surface};
use crate::method::ForecastRow;
use crate::objective::NOT_ALLOWED;
use crate::reach::reachable;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{OperatingPoint, PlanStep, StepKind, Timing};
use mapper_numerics::parallel;
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::SteadyState;
use std::collections::HashSet;

/// Orders that are tried in one search: some milliseconds.
const MOST_TRIED: usize = 4_000;

/// Where a machine is: its state, and the point and turbine pressure, Pa, that it comes from.
#[derive(Debug, Clone, Copy)]
pub struct Now {
    /// The machine.
    pub state: State,
    /// The point where it is.
    pub at: OperatingPoint,
    /// Turbine inlet total pressure there, Pa.
    pub p3_pa: f64,
    /// When the next step begins, s of the plan's time.
    pub next_s: f64,
}

/// Steps gone through from where the machine is.
#[derive(Debug, Clone)]
pub struct Walked {
    /// The steps with their forecasts, begins and origins.
    pub steps: Vec<PlanStep>,
    /// Each from its jump on.
    pub rows: Vec<Vec<ForecastRow>>,
    /// Jumps that are not allowed: from, to and why.
    pub forbidden: Vec<(OperatingPoint, OperatingPoint, String)>,
}

/// Goes through steps with their dwells, each from where the one before leaves the machine. `longest_s`: up to when each is
/// simulated, at least its dwell; by that no step is shortened.
///
/// # Errors
/// [`PlanError::Forecast`] where a simulation fails.
pub fn walk_on(
    request: &PlanRequest<'_>,
    now: &Now,
    steps: &[PlanStep],
    longest_s: f64,
) -> Result<Walked, PlanError> {
    let request = &PlanRequest { method: None, ..request.clone() };
    let mut walked =
        Walked { steps: Vec::with_capacity(steps.len()), rows: Vec::new(), forbidden: Vec::new() };
    let mut now = *now;
    for step in steps {
        let boundary = boundary(request, step);
        let made = |dwell_s: f64| -> Result<Forecast, PlanError> {
            forecast(request, now.state, &boundary, dwell_s, true)
                .map_err(|source| PlanError::Forecast { to: step.to, source })
        };
        let forecast = made(step.dwell_s)?;
        let reasons = rejections(request, &forecast, step.p3_pa - now.p3_pa, step.t3_k);
        if !reasons.is_empty() {
            let reasons = reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join(", and ");
            walked.forbidden.push((now.at, step.to, reasons));
        }
        let (end, predicted) = (forecast.end, forecast.predicted);
        let rows = if longest_s > step.dwell_s { made(longest_s)?.rows } else { forecast.rows };
        walked.rows.push(rows);
        walked.steps.push(PlanStep { from: Some(now.at), start_s: now.next_s, predicted, ..step.clone() });
        now = Now { state: end, at: step.to, p3_pa: step.p3_pa, next_s: now.next_s + step.dwell_s };
    }
    Ok(walked)
}

/// The machine after a step: `duration_s` at its point.
///
/// # Errors
/// [`PlanError::Forecast`] where the simulation fails.
pub fn after_step(
    request: &PlanRequest<'_>,
    state: State,
    step: &PlanStep,
    duration_s: f64,
) -> Result<State, PlanError> {
    mapper_physics::forecast::hold(request.model, state, &boundary(request, step), duration_s)
        .map_err(|source| PlanError::Forecast { to: step.to, source })
}

/// The machine when the first step of a plan begins.
///
/// # Errors
/// [`PlanError`] where the point cannot be reached, or the simulation fails.
pub fn before_first_step(
    request: &PlanRequest<'_>,
    first: &PlanStep,
    warm_up_s: f64,
) -> Result<State, PlanError> {
    let targets = reachable(request, &[first.to])?;
    let SteadyState { state, .. } = *targets.first().ok_or(PlanError::NoPoints)?;
    mapper_physics::forecast::warmed_up(request.model, state, &boundary(request, first), warm_up_s)
        .map_err(|source| PlanError::Forecast { to: first.to, source })
}

fn boundary(request: &PlanRequest<'_>, step: &PlanStep) -> BoundaryConditions {
    BoundaryConditions {
        p3_pa: step.p3_pa,
        t3_k: step.t3_k,
        oil_temperature_k: step.oil_temperature_k,
        valve_opening_ratio: step.to.valve_opening_ratio,
        ..request.boundary
    }
}

/// The points of a plan on the reduced housing, with what a step to each would tell (a `T`) from wherever it comes.
#[derive(Debug)]
pub struct Reordering<T> {
    points: Vec<OperatingPoint>,
    housing: Housing,
    tells: Vec<Option<[[T; 2]; 3]>>,
}

impl<T: Send> Reordering<T> {
    /// For the points of a plan and steps of about `dwell_s`; `tells` says what a step tells by its rows.
    ///
    /// # Errors
    /// [`PlanError`] where a point cannot be reached or a simulation fails.
    pub fn of(
        request: &PlanRequest<'_>,
        steps: &[PlanStep],
        dwell_s: f64,
        tells: impl Fn(&[ForecastRow]) -> Option<T> + Sync,
    ) -> Result<Self, PlanError> {
        let mut points: Vec<OperatingPoint> = Vec::new();
        for step in steps {
            if !points.contains(&step.to) {
                points.push(step.to);
            }
        }
        let timing = Timing { dwell_s, ..request.timing };
        let request = &PlanRequest { method: None, timing, ..request.clone() };
        let targets = reachable(request, &points)?;
        let housing = Housing::of(request, &points, &targets, None, None)?;
        let starts = housing.starts(&targets).ok_or(PlanError::NoPoints)?;
        let aims: Vec<(OperatingPoint, &SteadyState)> = points.iter().copied().zip(&targets).collect();
        let one = |(to, target): &(OperatingPoint, &SteadyState)| -> Result<Option<[[T; 2]; 3]>, PlanError> {
            let at = |state: State| -> Result<Option<T>, PlanError> {
                let forecast = forecast(request, state, &target.boundary, dwell_s, true)
                    .map_err(|source| PlanError::Forecast { to: *to, source })?;
                Ok(tells(&forecast.rows))
            };
            let mut pairs = Vec::with_capacity(starts.len());
            for [one, other] in starts {
                let (Some(one), Some(other)) = (at(one)?, at(other)?) else { return Ok(None) };
                pairs.push([one, other]);
            }
            Ok(pairs.try_into().ok())
        };
        let tells = parallel::try_map(&aims, one)?;
        Ok(Reordering { points, housing, tells })
    }

    fn place(&self, point: OperatingPoint) -> Option<usize> {
        self.points.iter().position(|other| *other == point)
    }

    /// A better order of what is left that makes none of the `forbidden` jumps, as places in `left`, and by how much it is worth more;
    /// `None` where none was found. Points change places among each other; repeats with the step they begin at, and the visit at
    /// the end, keep theirs. `worth` says what a step is worth by what it tells.
    pub fn better(
        &self,
        now: &Now,
        left: &[PlanStep],
        forbidden: &[(OperatingPoint, OperatingPoint)],
        worth: impl Fn(&T) -> f64,
    ) -> Option<(Vec<usize>, f64)> {
        let known = |tells: &Option<[[T; 2]; 3]>| {
            tells.as_ref().map_or(Surface::default(), |tells| {
                Surface::through([0, 1, 2].map(|i| [worth(&tells[i][0]), worth(&tells[i][1])]))
            })
        };
        let search = Search {
            housing: &self.housing,
            worths: self.tells.iter().map(known).collect(),
            at: left.iter().map(|step| self.place(step.to)).collect::<Option<_>>()?,
            measures: left.iter().map(|step| step.kind.measures()).collect(),
            from: self.place(now.at)?,
            state: self.housing.scaled(&now.state),
            forbidden: forbidden
                .iter()
                .filter_map(|(from, to)| Some((self.place(*from)?, self.place(*to)?)))
                .collect(),
        };
        let slots = movable(left);
        let mut order: Vec<usize> = (0..left.len()).collect();
        let before = search.value(&order);
        let mut best = before;
        let mut tried = 0;
        // The first move that gains is made, until none does or enough were tried.
        let mut gained = true;
        while gained && tried < MOST_TRIED {
            gained = false;
            for i in 0..slots.len() {
                for j in 0..slots.len() {
                    if i == j || tried >= MOST_TRIED {
                        continue;
                    }
                    let moves: &[bool] = if i < j { &[true, false] } else { &[false] };
                    for swap in moves {
                        let trial = moved(&order, &slots, i, j, *swap);
                        tried += 1;
                        let value = search.value(&trial);
                        if value > best + 1e-9 * best.abs() {
                            (order, best, gained) = (trial, value, true);
                        }
                    }
                }
            }
        }
        (best > before).then_some((order, best - before))
    }
}

/// The places of the steps that may change: points that no repeat begins at.
fn movable(left: &[PlanStep]) -> Vec<usize> {
    let begins = |i: usize| left.get(i + 1).is_some_and(|next| next.kind == StepKind::Repeat);
    (0..left.len()).filter(|i| left[*i].kind == StepKind::Point && !begins(*i)).collect()
}

/// Two steps exchanged, or the one at the slot `i` put at the slot `j` and those between moved up.
fn moved(order: &[usize], slots: &[usize], i: usize, j: usize, swap: bool) -> Vec<usize> {
    let mut trial = order.to_vec();
    if swap {
        trial.swap(slots[i], slots[j]);
        return trial;
    }
    let between: Vec<usize> = if i < j { (i..j).collect() } else { (j..i).rev().collect() };
    for k in between {
        trial.swap(slots[k], slots[k + 1]);
    }
    trial
}

struct Search<'a> {
    housing: &'a Housing,
    worths: Vec<Surface>,
    /// The point of each step that is left.
    at: Vec<usize>,
    measures: Vec<bool>,
    from: usize,
    state: [f64; 2],
    forbidden: HashSet<(usize, usize)>,
}

impl Search<'_> {
    /// What an order of the steps is worth, less far more than that for each jump that is not allowed.
    fn value(&self, order: &[usize]) -> f64 {
        let (mut from, mut state, mut sum) = (self.from, self.state, 0.0);
        for step in order {
            let to = self.at[*step];
            let [c, t] = state;
            if self.measures[*step] {
                sum += self.worths[to].at(c, t, self.housing.responses[from].speed);
            }
            let (gradient_k, next) = self.housing.step(from, to, state);
            if gradient_k.abs() > self.housing.gradient_max_k() || self.forbidden.contains(&(from, to)) {
                sum -= NOT_ALLOWED;
            }
            (from, state) = (to, next);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_put_elsewhere_and_the_others_close_up() {
        let slots = [0, 1, 3, 4];
        assert_eq!(moved(&[0, 1, 2, 3, 4], &slots, 0, 3, false), [1, 3, 2, 4, 0]);
        assert_eq!(moved(&[0, 1, 2, 3, 4], &slots, 3, 0, false), [4, 0, 2, 1, 3]);
        assert_eq!(moved(&[0, 1, 2, 3, 4], &slots, 0, 2, true), [3, 1, 2, 0, 4]);
    }
}
