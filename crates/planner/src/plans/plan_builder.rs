//! The points that a plan visits, repeats and appended jump included, made into a plan.

use crate::jumps::visits::{
    RepeatedJump, Visit, append, plain, put_return, repeat_count, value, with_repeats,
};
use crate::jumps::walk::{Forbidden, Walk, walk};
use crate::ordering::order::{Ordered, PROOF_TOLERANCE_RATIO, objective, orders_on};
use crate::plans::fingerprint::made_from;
use crate::plans::plan_figures::{figures, rms_error_eta};
use crate::request::{PlanError, PlanRequest};
use crate::targets::reachable;
use crate::thermal_memory::chain::gradients_k;
use crate::thermal_memory::forecast::Resting;
use crate::thermal_memory::housing::Housing;
use crate::upper_bound::bound::Optimistic;
use crate::upper_bound::relaxation::Repeated;
use mapper_core::{
    Dwell, Jump, NoBound, OperatingPoint, Plan, PlanBound, PlanRemark, PlanStep, Repeats, StepKind,
    VisitOrder,
};
use mapper_physics::simulation::steady::SteadyState;

/// How often jumps that turn out not to be allowed are taken out and the rest is ordered again.
const ROUNDS: usize = 25;
/// Effort of ordering again, over the first: with one jump taken out, the best order is not far.
const AGAIN_RATIO: f64 = 0.2;

/// The most steps that a plan can have: each repeat and the appended jump take two at most.
pub fn max_steps(request: &PlanRequest<'_>) -> usize {
    let points = request.points.len();
    let repeats = request.repeats.map_or(0, |repeats| 2 * repeat_count(repeats, points));
    let appended = if request.appended.is_some() { 2 } else { 0 };
    points + repeats + appended + usize::from(request.return_to_first && points > 1)
}

/// Makes plans of the same points for any dwell.
pub(crate) struct PlanBuilder<'a> {
    request: &'a PlanRequest<'a>,
    /// The request's points, then those that only repeats and the appended jump visit.
    points: Vec<OperatingPoint>,
    targets: Vec<SteadyState>,
    repeated: Option<RepeatedJump>,
    appended: Option<(usize, usize)>,
}

/// An order with its simulated steps.
pub(crate) struct Draft {
    /// How long each step lasts, s; the shortest of them in conventional mapping.
    pub(crate) dwell_s: f64,
    ordered: Ordered,
    visits: Vec<Visit>,
    steps: Vec<PlanStep>,
    resting: Option<Resting>,
    /// The reduced housing that the order was sought on, if it was made for this dwell.
    housing: Option<Housing>,
}

impl Draft {
    pub(crate) fn steps(&self) -> &[PlanStep] {
        &self.steps
    }

    /// Whether a method that identifies all steps together has made a forecast.
    pub(crate) fn is_predicted(&self) -> bool {
        self.resting.is_some()
    }
}

impl<'a> PlanBuilder<'a> {
    /// `targets`: the steady states of the request's points.
    pub(crate) fn of(
        request: &'a PlanRequest<'a>,
        targets: &[SteadyState],
        repeats: Option<(Repeats, Jump)>,
    ) -> Result<Self, PlanError> {
        let (points, targets) = (request.points.to_vec(), targets.to_vec());
        let mut builder = PlanBuilder { request, points, targets, repeated: None, appended: None };
        if let Some((repeats, Jump { from, to })) = repeats {
            let (from, to) = (builder.index_of(from)?, builder.index_of(to)?);
            builder.repeated =
                Some(RepeatedJump { from, to, count: repeat_count(repeats, request.points.len()) });
        }
        if let Some(Jump { from, to }) = request.appended {
            builder.appended = Some((builder.index_of(from)?, builder.index_of(to)?));
        }
        Ok(builder)
    }

    fn index_of(&mut self, point: OperatingPoint) -> Result<usize, PlanError> {
        if let Some(known) = self.points.iter().position(|other| *other == point) {
            return Ok(known);
        }
        self.targets.extend(reachable(self.request, &[point])?);
        self.points.push(point);
        Ok(self.points.len() - 1)
    }

    /// The best order for steps of `dwell_s`.
    pub(crate) fn draft(&self, dwell_s: f64) -> Result<Draft, PlanError> {
        let request = self.request;
        let mut housing = Housing::of(request, &self.points, &self.targets, dwell_s)?;
        housing.returns = request.return_to_first;
        let mut given: Vec<usize> = (0..request.points.len()).collect();
        let mut barred: Vec<String> = Vec::new();
        for round in 0..ROUNDS {
            let effort = if round == 0 { request.effort } else { AGAIN_RATIO * request.effort };
            let orders =
                orders_on(&housing, &self.points, &given, &PlanRequest { effort, ..request.clone() });
            let Some((ordered, visits, returned)) = self.best_of(&housing, orders) else { break };
            let Walk { steps, forbidden, resting } =
                walk(request, &self.points, &self.targets, &visits, dwell_s)?;
            if forbidden.is_empty() {
                // What was searched and proven is an order with its way back.
                let proven = ordered.proven && (returned || !request.return_to_first || given.len() < 2);
                let ordered = Ordered { proven, ..ordered };
                return Ok(Draft { dwell_s, ordered, visits, steps, resting, housing: Some(housing) });
            }
            let before = barred.len();
            for Forbidden { from, to, reasons } in forbidden {
                let text = format!("{} to {}: {reasons}", self.points[from], self.points[to]);
                if !barred.contains(&text) {
                    barred.push(text);
                }
                housing.forbid(from, to);
            }
            given = ordered.order;
            if barred.len() == before || !request.order.is_searched() {
                break;
            }
        }
        Err(PlanError::NoAdmissibleOrder(barred))
    }

    /// The order with the highest value including repeats, its visits, and whether they end with a return to the first point.
    fn best_of(&self, housing: &Housing, orders: Vec<Ordered>) -> Option<(Ordered, Vec<Visit>, bool)> {
        let objective = objective(self.request.order);
        let with_visits = orders.into_iter().map(|ordered| {
            let (visits, returned) = self.visits(housing, &ordered.order);
            (value(housing, &visits, objective), (ordered, visits, returned))
        });
        // Of equal ones the first.
        let better = |best: (f64, _), other: (f64, _)| if other.0 > best.0 { other } else { best };
        with_visits.reduce(better).map(|(_, best)| best)
    }

    /// The visits of an order, and whether they end with a return to the first point.
    fn visits(&self, housing: &Housing, order: &[usize]) -> (Vec<Visit>, bool) {
        let mut visits = match self.repeated {
            Some(jump) => with_repeats(housing, order, jump, objective(self.request.order)),
            None => plain(order),
        };
        let returned = self.request.return_to_first && put_return(&mut visits);
        if let Some((from, to)) = self.appended {
            append(&mut visits, from, to);
        }
        (visits, returned)
    }

    /// The same order with another dwell; another order if a limit forbids one of its jumps then.
    pub(crate) fn with_dwell(&self, draft: Draft, dwell_s: f64) -> Result<Draft, PlanError> {
        if draft.dwell_s == dwell_s {
            return Ok(draft);
        }
        let Walk { steps, forbidden, resting } =
            walk(self.request, &self.points, &self.targets, &draft.visits, dwell_s)?;
        if !forbidden.is_empty() {
            return self.draft(dwell_s);
        }
        // What was proven holds for the dwell that the order was sought for.
        let ordered = Ordered { proven: false, ..draft.ordered };
        Ok(Draft { dwell_s, ordered, steps, resting, housing: None, ..draft })
    }

    /// The plan with its figures, bound and remarks.
    pub(crate) fn plan(&self, draft: Draft) -> Result<Plan, PlanError> {
        let request = self.request;
        let timing = request.timing;
        let steps_s = draft.steps.iter().map(|step| step.dwell_s).sum::<f64>();
        let minutes = (timing.warm_up_s + steps_s + timing.cool_down_s) / 60.0;
        let figures = figures(&draft.steps, minutes, draft.resting);
        let bound = if request.bound { self.bound(&draft)? } else { None };
        Ok(Plan {
            campaign: request.campaign_name.to_owned(),
            objective: request.order.name().to_owned(),
            seed: request.seed,
            made_from: made_from(request),
            warm_up_s: timing.warm_up_s,
            cool_down_s: timing.cool_down_s,
            remarks: self.remarks(&draft),
            figures,
            bound_remark: self.bound_remark(bound.as_ref()),
            bound,
            steps: draft.steps,
            surge_search_s: 0.0,
        })
    }

    /// Upper bounds on the gradients of any order with this dwell, if the order was searched for.
    fn bound(&self, draft: &Draft) -> Result<Option<PlanBound>, PlanError> {
        let request = self.request;
        if !request.order.is_searched() || request.appended.is_some() {
            return Ok(None);
        }
        let made;
        let housing = match &draft.housing {
            Some(housing) => housing,
            None => {
                made = Housing::of(request, &self.points, &self.targets, draft.dwell_s)?;
                &made
            }
        };
        let mut nodes: Vec<usize> = draft.ordered.order.clone();
        let returns = draft.visits.iter().any(|visit| visit.kind == StepKind::Return);
        let counted = nodes.len();
        // The ends of the repeated jump need not be points of the grid.
        let mut place = |index: usize| {
            nodes.iter().position(|node| *node == index).unwrap_or_else(|| {
                nodes.push(index);
                nodes.len() - 1
            })
        };
        let repeated = self.repeated.map(|jump| Repeated {
            from: place(jump.from),
            to: place(jump.to),
            count: jump.count,
        });
        let Some(optimistic) = Optimistic::of(housing, &nodes) else { return Ok(None) };
        let order: Vec<usize> = draft.visits.iter().map(|visit| visit.index).collect();
        let reduced_k = gradients_k(housing, &order);
        let (mut found_k, mut more_k, mut error_k) = (0.0, 0.0, 0.0f64);
        for (step, reduced_k) in draft.steps.iter().skip(1).zip(&reduced_k) {
            let off_k = step.predicted.dtc_k.unwrap_or(0.0).abs() - reduced_k;
            error_k = error_k.max(off_k.abs());
            if step.kind.measures() {
                (found_k, more_k) = (found_k + reduced_k, more_k + off_k);
            }
        }
        let bound = optimistic.bound(counted, repeated, returns, found_k);
        // The bound is one of the reduced housing; what the full model gives more along this plan is added to it.
        let (sum_bound_k, min_bound_k) = (bound.sum_k + f64::max(more_k, 0.0), bound.worst_k + error_k);
        let found = figures(&draft.steps, 0.0, None);
        let below = |figure: f64, bound: f64| (bound > 0.0).then(|| 100.0 * (1.0 - figure / bound));
        Ok(Some(PlanBound {
            sum_gradient_k: sum_bound_k,
            min_gradient_k: min_bound_k,
            gap_percent: match request.order {
                VisitOrder::ThermalGradient => below(found.sum_gradient_k, sum_bound_k),
                _ => found.min_gradient_k.and_then(|min_k| below(min_k, min_bound_k)),
            },
            proven: draft.ordered.proven,
            proof_tolerance_percent: draft.ordered.proven.then_some(100.0 * PROOF_TOLERANCE_RATIO),
            model_error_k: error_k,
        }))
    }

    /// Why the bound is missing.
    fn bound_remark(&self, bound: Option<&PlanBound>) -> Option<NoBound> {
        let request = self.request;
        match () {
            () if bound.is_some() || !request.bound => None,
            () if !request.order.is_searched() => Some(NoBound::OrderNotSearched),
            () if request.appended.is_some() => Some(NoBound::AppendedJump),
            () => Some(NoBound::TooLarge),
        }
    }

    fn remarks(&self, draft: &Draft) -> Vec<PlanRemark> {
        let (request, steps) = (self.request, &draft.steps);
        let mut remarks = Vec::new();
        let repeated = self.repeated.map(|jump| self.points[jump.to]);
        let repeats =
            || steps.iter().filter(|step| step.kind == StepKind::Repeat && Some(step.to) == repeated);
        if let Some(PlanStep { from: Some(from), to, .. }) = repeats().next() {
            remarks.push(PlanRemark::RepeatedJump { from: *from, to: *to, times: repeats().count() });
        }
        if let Some(Jump { from, to }) = request.appended {
            remarks.push(PlanRemark::AppendedJump { from, to });
        }
        if let [first, others @ ..] = steps.as_slice() {
            if steps.iter().any(|step| step.kind == StepKind::Return) {
                remarks.push(PlanRemark::FirstPointAgain { point: first.to });
            } else if others.iter().all(|step| step.to != first.to) {
                remarks.push(PlanRemark::FirstPointWithoutJump { point: first.to });
            }
        }
        if let Some(Resting { eta, max_eta, .. }) =
            draft.resting.filter(|resting| resting.eta > resting.max_eta)
        {
            remarks.push(PlanRemark::RestsOnDeclaration { eta_error: eta, max_eta_error: max_eta });
        }
        if let (Dwell::RequiredSigmaEta(required), Some(found)) = (request.timing.dwell, rms_error_eta(steps))
            && found > required
        {
            remarks.push(PlanRemark::RequiredErrorNotReached {
                dwell_s: draft.dwell_s,
                eta_sigma: found,
                required_eta_sigma: required,
            });
        }
        remarks
    }
}
