//! The points that a plan visits, repeats and appended jump included, made into a plan under an order.

use crate::dwell::walk_until_certain;
use crate::finish::finished;
use crate::housing::Housing;
use crate::method::{ForecastRow, WorthOfStep};
use crate::order::{Ordered, objective, order_on};
use crate::reach::reachable;
use crate::repeats::{RepeatedJump, Visit, append, plain, put_return, with_repeats};
use crate::request::{PlanError, PlanRequest};
use crate::walk::{Forbidden, Route, Walk};
use mapper_core::{Jump, OperatingPoint, Plan, PlanStep, Repeats, Timing, VisitOrder};
use mapper_physics::steady::SteadyState;

/// How often jumps that turn out not to be allowed are taken out and the rest is ordered again.
const ROUNDS: usize = 25;
/// Effort of ordering again, over the first.
const AGAIN_RATIO: f64 = 0.2;

/// Where a plan is made.
pub(crate) struct Stage<'a> {
    request: &'a PlanRequest<'a>,
    /// The request's points, then those that only repeats and the appended jump visit.
    points: Vec<OperatingPoint>,
    targets: Vec<SteadyState>,
    repeated: Option<RepeatedJump>,
    appended: Option<(usize, usize)>,
}

/// How an order is sought.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sought {
    /// For steps of about this length, s.
    pub(crate) dwell_s: f64,
    /// Effort of the search, 1 is normal.
    pub(crate) effort: f64,
    /// Forecasts that may be made to find how long the steps last.
    pub(crate) forecasts: usize,
}

/// An order with its steps.
pub(crate) struct Made {
    order: VisitOrder,
    housing: Housing,
    ordered: Ordered,
    visits: Vec<Visit>,
    walk: Walk,
}

impl Made {
    pub(crate) fn steps(&self) -> &[PlanStep] {
        &self.walk.steps
    }

    /// Each step from its jump to its end.
    pub(crate) fn rows(&self) -> &[Vec<ForecastRow>] {
        &self.walk.rows
    }
}

impl<'a> Stage<'a> {
    /// `reached`: the steady states of the request's points.
    pub(crate) fn of(
        request: &'a PlanRequest<'a>,
        reached: &[SteadyState],
        repeats: Option<(Repeats, Jump)>,
    ) -> Result<Self, PlanError> {
        let (points, targets) = (request.points.to_vec(), reached.to_vec());
        let mut stage = Stage { request, points, targets, repeated: None, appended: None };
        if let Some((repeats, Jump { from, to })) = repeats {
            let (from, to) = (stage.place(from)?, stage.place(to)?);
            let Repeats { every_steps, at_least, .. } = repeats;
            stage.repeated = Some(RepeatedJump { from, to, every_steps, at_least });
        }
        if let Some(Jump { from, to }) = request.appended {
            stage.appended = Some((stage.place(from)?, stage.place(to)?));
        }
        Ok(stage)
    }

    fn place(&mut self, point: OperatingPoint) -> Result<usize, PlanError> {
        if let Some(known) = self.points.iter().position(|other| *other == point) {
            return Ok(known);
        }
        self.targets.extend(reachable(self.request, &[point])?);
        self.points.push(point);
        Ok(self.points.len() - 1)
    }

    /// The plan under an order that is sought with `effort` for steps of `dwell_s`, by what steps are worth where that is known.
    pub(crate) fn made(
        &self,
        order: VisitOrder,
        Sought { dwell_s, effort, forecasts }: Sought,
        worth: Option<&dyn WorthOfStep>,
    ) -> Result<Made, PlanError> {
        let request = &PlanRequest { order, effort, ..self.request.clone() };
        // Only a search for information that knows no worth needs the method at every start of the reduced housing.
        let needs_method = order.needs_method() && worth.is_none();
        let searched = PlanRequest {
            method: request.method.filter(|_| needs_method),
            timing: Timing { dwell_s, ..request.timing },
            ..request.clone()
        };
        let mut housing = Housing::of(&searched, &self.points, &self.targets, None, worth)?;
        housing.returns = request.return_to_first;
        let mut given: Vec<usize> = (0..request.points.len()).collect();
        let mut barred: Vec<String> = Vec::new();
        for round in 0..ROUNDS {
            // Where one jump is taken out, the best order is not far.
            let effort = if round == 0 { effort } else { AGAIN_RATIO * effort };
            let ordered =
                order_on(&housing, &self.points, &given, &PlanRequest { effort, ..request.clone() });
            let mut visits = match self.repeated {
                Some(jump) => with_repeats(&housing, &ordered.order, jump, objective(order)),
                None => plain(&ordered.order),
            };
            let returned = request.return_to_first && put_return(&mut visits);
            if let Some((from, to)) = self.appended {
                append(&mut visits, from, to);
            }
            let route = Route {
                points: &self.points,
                targets: &self.targets,
                visits: &visits,
                repeated: self.repeated.map(|jump| jump.to),
            };
            let walk = walk_until_certain(request, route, dwell_s, forecasts)?;
            if walk.forbidden.is_empty() {
                // What was searched, proven and bounded is an order with its way back.
                let proven = ordered.proven && (returned || !request.return_to_first || given.len() < 2);
                let ordered = Ordered { proven, ..ordered };
                return Ok(Made { order, housing, ordered, visits, walk });
            }
            let before = barred.len();
            for Forbidden { from, to, reasons } in walk.forbidden {
                let text = format!("{} to {}: {reasons}", self.points[from], self.points[to]);
                if !barred.contains(&text) {
                    barred.push(text);
                }
                housing.forbid(from, to);
            }
            given = ordered.order;
            let searched = !matches!(order, VisitOrder::Listed | VisitOrder::SpeedLines);
            if barred.len() == before || !searched {
                break;
            }
        }
        Err(PlanError::NoAdmissibleOrder(barred))
    }
    /// The plan of what was made, with all that is forecast of it.
    pub(crate) fn plan(&self, made: Made) -> Plan {
        let Made { order, housing, ordered, visits, walk } = made;
        let request = &PlanRequest { order, ..self.request.clone() };
        let steps = if request.draft { walk.steps } else { walk.thorough(request).steps };
        finished(request, &housing, &ordered, &visits, self.repeated, steps)
    }
}
