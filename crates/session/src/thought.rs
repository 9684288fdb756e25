//! What is left of a plan, thought over: the better of the order as it stands and of another one, each with the dwells that it
//! would get.

use crate::SessionError;
use crate::certainty::DwellPrices;
use crate::certainty::left::{ToCome, Weighed};
use mapper_core::{OperatingPoint, PlanStep};
use mapper_identify::StepInformation;
use mapper_planner::{Now, PlanRequest, Reordering, Walked, walk_on};

/// What another order has to be worth more, over the sum of all points' variances, to be gone through in full.
const WORTH_A_LOOK_RATIO: f64 = 0.01;
/// Orders with forbidden jumps that are found before the order stands.
const ROUNDS: usize = 4;

/// What is thought over.
pub(crate) struct Question<'a> {
    pub(crate) request: PlanRequest<'a>,
    pub(crate) reordering: &'a Reordering<StepInformation>,
    /// What is known and forecast of all steps.
    pub(crate) prices: DwellPrices,
    /// Where the machine is when the first of the steps begins.
    pub(crate) now: Now,
    /// The steps whose order is in question.
    pub(crate) steps: Vec<PlanStep>,
    /// Steps to come before them, and behind them.
    pub(crate) before: usize,
    pub(crate) behind: usize,
    /// Time of the steps that were made, s.
    pub(crate) made_s: f64,
    /// Whether the machine is elsewhere than it was planned, or the steps are others.
    pub(crate) changed: bool,
    /// What another order has to save, over the time that is left.
    pub(crate) clearly_ratio: f64,
}

/// What came of it.
pub(crate) struct Thought {
    /// The steps in their order, with their dwells.
    pub(crate) steps: Vec<PlanStep>,
    /// The same for the prices.
    pub(crate) to_come: ToCome,
    pub(crate) as_it_stands: Weighed,
    /// `None` where the order stands.
    pub(crate) other: Option<Weighed>,
    /// Why the order as it stands is not allowed.
    pub(crate) barred: Option<String>,
}

impl Question<'_> {
    /// `None` where the order stands and nothing has changed.
    ///
    /// # Errors
    /// [`SessionError`] where a forecast fails.
    pub(crate) fn answer(mut self) -> Result<Option<Thought>, SessionError> {
        let (Some(worth), Some(weighed)) = (self.prices.worth_now(), self.prices.weighed()) else {
            return Ok(None);
        };
        let variances = weighed.error.powi(2) * self.prices.points() as f64;
        let mut forbidden: Vec<(OperatingPoint, OperatingPoint)> = Vec::new();
        let forbid = |forbidden: &mut Vec<_>, walked: &Walked| {
            forbidden.extend(walked.forbidden.iter().map(|(from, to, _)| (*from, *to)));
        };
        // From elsewhere than planned the jumps were never held against the limits.
        let mut stays = None;
        if self.changed {
            let walked = self.walked(&self.steps)?;
            forbid(&mut forbidden, &walked);
            stays = Some(walked);
        }
        let mut other = None;
        for _ in 0..ROUNDS {
            let better = self.reordering.better(&self.now, &self.steps, &forbidden, |tells| worth.of(tells));
            let Some((order, _)) = better.filter(|(_, gain)| *gain > WORTH_A_LOOK_RATIO * variances) else {
                break;
            };
            let order: Vec<PlanStep> = order.into_iter().map(|i| self.steps[i].clone()).collect();
            let walked = self.walked(&order)?;
            if walked.forbidden.is_empty() {
                other = Some(walked);
                break;
            }
            forbid(&mut forbidden, &walked);
        }
        if other.is_none() && !self.changed {
            return Ok(None);
        }
        let stays = match stays {
            Some(stays) => stays,
            None => self.walked(&self.steps)?,
        };
        self.chosen(stays, other)
    }

    fn chosen(&mut self, stays: Walked, other: Option<Walked>) -> Result<Option<Thought>, SessionError> {
        let barred =
            stays.forbidden.first().map(|(from, to, why)| format!("{from} to {to} is forbidden: {why}"));
        let Some(as_it_stands) = self.with(&stays) else { return Ok(None) };
        if let Some(other) = other
            && let Some(weighed) = self.with(&other)
        {
            let saved_s = self.saved_s(as_it_stands, weighed);
            if saved_s > self.clearly_ratio * as_it_stands.left_s || barred.is_some() {
                let (steps, walked) = self.with_dwells(other.steps)?;
                // With its dwells the machine comes by in other states.
                if walked.forbidden.is_empty() {
                    let to_come = self.prices.to_come(&steps, other.rows);
                    return Ok(Some(Thought { steps, to_come, as_it_stands, other: Some(weighed), barred }));
                }
            }
        }
        if !self.changed {
            return Ok(None);
        }
        let _ = self.with(&stays);
        let (steps, _) = self.with_dwells(stays.steps)?;
        let to_come = self.prices.to_come(&steps, stays.rows);
        Ok(Some(Thought { steps, to_come, as_it_stands, other: None, barred }))
    }

    /// What the run comes to with these steps.
    fn with(&mut self, walked: &Walked) -> Option<Weighed> {
        let to_come = self.prices.to_come(&walked.steps, walked.rows.clone());
        self.prices.put(to_come, self.before, self.behind);
        self.prices.weighed()
    }

    /// The steps that the prices have now, with the dwells that they get, gone through once more.
    fn with_dwells(&self, steps: Vec<PlanStep>) -> Result<(Vec<PlanStep>, Walked), SessionError> {
        let dwells_s = self.prices.left_dwells_s().into_iter().skip(self.before);
        let retimed: Vec<PlanStep> =
            steps.into_iter().zip(dwells_s).map(|(step, dwell_s)| PlanStep { dwell_s, ..step }).collect();
        let walked = walk_on(&self.request, &self.now, &retimed, 0.0)?;
        Ok((walked.steps.clone(), walked))
    }

    fn walked(&self, steps: &[PlanStep]) -> Result<Walked, SessionError> {
        let longest_s = self.request.required_sigma_eta.map_or(0.0, |_| self.request.timing.dwell_s);
        Ok(walk_on(&self.request, &self.now, steps, longest_s)?)
    }

    /// What one way is better than another, as time of the run, s: errors fall with the root of the time.
    fn saved_s(&self, than: Weighed, with: Weighed) -> f64 {
        let cost = |weighed: Weighed| weighed.error.powi(2) * (self.made_s + weighed.left_s);
        (1.0 - cost(with) / cost(than)) * (self.made_s + than.left_s)
    }
}
