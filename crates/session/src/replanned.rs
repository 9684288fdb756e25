//! The steps of a plan, thought over while they are made: what is left is put in another order where that is forecast to know as
//! much clearly sooner.
//!
//! The machine is followed along the steps as they were made, its housing as it was read. What the steps have told counts by
//! their readings, what is left by its forecast from there. What comes after a step is thought over while that step goes on, beside
//! the run, and holds from its end: nobody waits for it on the rig, and it follows from readings and markers alone. The same
//! recording, the same order.

use crate::SessionError;
use crate::certainty::DwellPrices;
use crate::planning::PlanMaterial;
use crate::thought::{Question, Thought};
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, Plan, PlanStep, Recording, StepKind, StepMarker};
use mapper_identify::StepInformation;
use mapper_numerics::statistics::mean;
use mapper_physics::model::{Model, State};
use mapper_planner::{Now, Reordering, after_step, before_first_step, walk_on};
use mapper_runner::{Certainty, DwellBounds, StepSource, StepSourceError};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;

/// Steps ahead that are thought over: what comes later is not known any better now.
const AHEAD: usize = 60;
/// Another order has to save so much of the time that is left: a forecast knows it no better.
const CLEARLY_RATIO: f64 = 0.02;
/// Steps that are tried for one whose jump is allowed, from where nothing was planned.
const TRIED: usize = 10;

/// Prices that the steps' ends and their order both go by.
pub(crate) struct SharedPrices<'a>(pub(crate) &'a RefCell<DwellPrices>);

impl Certainty for SharedPrices<'_> {
    fn bounds(&mut self, step: &PlanStep) -> Option<DwellBounds> {
        self.0.borrow_mut().bounds(step)
    }

    fn look(&mut self, readings: &Recording, marker: &StepMarker) -> Option<String> {
        self.0.borrow_mut().look(readings, marker)
    }

    fn ended(&mut self, readings: &Recording, marker: &StepMarker) {
        self.0.borrow_mut().ended(readings, marker);
    }

    fn left_out(&mut self) {
        self.0.borrow_mut().left_out();
    }
}

/// What thinking needs, beside the run.
struct Beside {
    campaign: Campaign,
    model: Model,
    /// `None` where nothing could be forecast.
    reordering: Option<Reordering<StepInformation>>,
    warm_up_s: f64,
}

/// The steps of a plan, planned again while they are made.
pub(crate) struct Replanned<'a> {
    beside: Arc<Beside>,
    plan: &'a Plan,
    prices: &'a RefCell<DwellPrices>,
    left: VecDeque<PlanStep>,
    /// Steps that were handed out, as they were forecast then.
    handed_out: Vec<PlanStep>,
    now: Option<PlanStep>,
    /// The machine at the end of the last step.
    state: Option<State>,
    made_s: f64,
    /// Whether the machine is elsewhere than planned, or what is left has changed.
    changed: bool,
    thinking: Option<JoinHandle<Option<Thought>>>,
    /// Indices of the steps that guards have left out.
    left_out: Vec<usize>,
    tried_again: Vec<OperatingPoint>,
    notes: Vec<String>,
    /// All notes so far.
    told: Vec<String>,
}

impl<'a> Replanned<'a> {
    /// The steps of `plan`; whoever ends them sees the same prices.
    ///
    /// # Errors
    /// [`SessionError::Json`] where the campaign cannot be written as JSON.
    pub(crate) fn new(
        campaign: &Campaign,
        model: &Model,
        plan: &'a Plan,
        prices: &'a RefCell<DwellPrices>,
    ) -> Result<Self, SessionError> {
        let material = PlanMaterial::of(campaign)?;
        let reordering = reordering(&material.request(campaign, model), plan, &prices.borrow());
        let failed =
            reordering.as_ref().err().map(|error| format!("what is left cannot be planned again: {error}"));
        let notes: Vec<String> = failed.into_iter().collect();
        let beside = Beside {
            campaign: campaign.clone(),
            model: model.clone(),
            reordering: reordering.ok(),
            warm_up_s: plan.warm_up_s,
        };
        Ok(Replanned {
            beside: Arc::new(beside),
            plan,
            prices,
            left: plan.steps.iter().cloned().collect(),
            handed_out: Vec::new(),
            now: None,
            state: None,
            made_s: 0.0,
            changed: false,
            thinking: None,
            left_out: Vec::new(),
            tried_again: Vec::new(),
            told: notes.clone(),
            notes,
        })
    }

    /// The plan as it was handed out, with what was said of it.
    pub(crate) fn handed_out(&self) -> Plan {
        let mut remarks = self.plan.remarks.clone();
        remarks.extend(self.told.iter().cloned());
        let made = self.handed_out.iter().filter(|step| !self.left_out.contains(&step.index));
        Plan { steps: made.cloned().collect(), remarks, ..self.plan.clone() }
    }

    fn say(&mut self, note: String) {
        self.told.push(note.clone());
        self.notes.push(note);
    }

    /// Follows the machine through a step; the step where it was the one that was to be made.
    fn follow(&mut self, marker: &StepMarker) -> Option<PlanStep> {
        let own = self.now.take();
        let other = || {
            let same = |step: &&PlanStep| Some(step.to) == marker.to;
            let known = self.plan.steps.iter().find(same).or(self.handed_out.last())?;
            Some(PlanStep { to: marker.to.unwrap_or(known.to), ..known.clone() })
        };
        let step = own.clone().or_else(other)?;
        let duration_s = marker.end_s - marker.start_s;
        self.made_s += duration_s;
        let after = self.beside.after(self.state, &step, duration_s);
        let tc_k = self.prices.borrow_mut().take_tc_k().filter(|_| own.is_some());
        self.state = after.map(|state| State { tc_k: tc_k.unwrap_or(state.tc_k), ..state });
        own
    }

    /// Begins to think over what comes after a step.
    fn think(&mut self, step: &PlanStep) {
        let steps: Vec<PlanStep> = self.left.iter().take(AHEAD).cloned().collect();
        if steps.len() < 2 && !self.changed {
            return;
        }
        let (beside, prices, step) = (Arc::clone(&self.beside), self.prices.borrow().clone(), step.clone());
        let (behind, made_s, changed) = (self.left.len() - steps.len(), self.made_s, self.changed);
        let (state, known) = (self.state, self.state.is_some() || self.handed_out.len() == 1);
        self.changed = false;
        let think = move || {
            let state = if known { beside.after(state, &step, step.dwell_s)? } else { return None };
            let next_s = step.start_s + step.dwell_s;
            let material = PlanMaterial::of(&beside.campaign).ok()?;
            let question = Question {
                request: material.request(&beside.campaign, &beside.model),
                reordering: beside.reordering.as_ref()?,
                prices,
                now: Now { state, at: step.to, p3_pa: step.p3_pa, next_s },
                steps,
                before: 1,
                behind,
                made_s,
                changed,
                clearly_ratio: CLEARLY_RATIO,
            };
            question.answer().ok()?
        };
        self.thinking = Some(std::thread::spawn(think));
    }

    /// Takes what came of it.
    fn take(&mut self, thought: Thought) {
        let Thought { steps, to_come, as_it_stands, other, barred } = thought;
        let elsewhere = self.left.iter().zip(&steps).filter(|(before, now)| before.to != now.to).count();
        let next = steps.first().map_or_else(String::new, |step| format!("next {}, ", step.to));
        let (after, count) = (self.handed_out.len(), self.left.len());
        let forecast = |weighed: crate::certainty::left::Weighed| {
            format!("{:.1} min for {:.2} points (rms, open)", weighed.left_s / 60.0, 1e2 * weighed.error)
        };
        let why = barred.map_or_else(String::new, |why| format!("; {why}"));
        let stood = forecast(as_it_stands);
        self.say(match other {
            Some(other) => format!(
                "planned again after step {after}: {elsewhere} of {count} steps to come change places, {next}forecast from that step on {}, \
                 as it stood {stood}{why}",
                forecast(other)
            ),
            None => format!(
                "planned again after step {after}: the order stands, {next}forecast from that step on {stood}{why}"
            ),
        });
        let behind = self.left.len() - steps.len();
        self.prices.borrow_mut().put(to_come, 0, behind);
        for (place, step) in self.left.iter_mut().zip(steps) {
            *place = step;
        }
    }

    /// From where nothing was planned, the first step whose jump is allowed comes first.
    fn put_an_allowed_step_first(&mut self) {
        let (Some(last), Some(state)) = (self.handed_out.last(), self.state) else { return };
        let now = Now { state, at: last.to, p3_pa: last.p3_pa, next_s: last.start_s + last.dwell_s };
        let Ok(material) = PlanMaterial::of(&self.beside.campaign) else { return };
        let request = material.request(&self.beside.campaign, &self.beside.model);
        let barred = |step: &PlanStep| -> Option<String> {
            let walked = walk_on(&request, &now, std::slice::from_ref(step), 0.0).ok()?;
            walked.forbidden.into_iter().next().map(|(_, _, why)| why)
        };
        let Some((to, why)) = self.left.front().and_then(|step| Some((step.to, barred(step)?))) else {
            return;
        };
        let allowed = self.left.iter().take(TRIED).position(|step| barred(step).is_none());
        let instead = allowed.and_then(|place| self.left.remove(place));
        let note = match instead {
            Some(step) => {
                let note = format!("{} to {to} is forbidden: {why}; {} comes first", now.at, step.to);
                self.left.push_front(step);
                note
            }
            None => format!("{} to {to} is forbidden: {why}; the guards have the say", now.at),
        };
        self.say(note);
    }
}

/// The points of a plan on the reduced housing.
pub(crate) fn reordering(
    request: &mapper_planner::PlanRequest<'_>,
    plan: &Plan,
    prices: &DwellPrices,
) -> Result<Reordering<StepInformation>, SessionError> {
    let dwells_s: Vec<f64> = plan.steps.iter().map(|step| step.dwell_s).collect();
    let dwell_s = mean(&dwells_s).unwrap_or(request.timing.dwell_s).round();
    Ok(Reordering::of(request, &plan.steps, dwell_s, |rows| prices.tells(plan.steps.first()?, rows))?)
}

impl Beside {
    /// The machine after a step; `state`: before it, or none before the first one.
    fn after(&self, state: Option<State>, step: &PlanStep, duration_s: f64) -> Option<State> {
        let material = PlanMaterial::of(&self.campaign).ok()?;
        let request = material.request(&self.campaign, &self.model);
        let before = match state {
            Some(state) => state,
            None => before_first_step(&request, step, self.warm_up_s).ok()?,
        };
        after_step(&request, before, step, duration_s).ok()
    }
}

impl StepSource for Replanned<'_> {
    fn warm_up_s(&self) -> f64 {
        self.plan.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        self.plan.cool_down_s
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        if self.changed {
            self.put_an_allowed_step_first();
        }
        let Some(step) = self.left.pop_front() else { return Ok(None) };
        let last = self.handed_out.last();
        let step = PlanStep {
            index: self.handed_out.len(),
            from: last.map_or(step.from, |last| Some(last.to)),
            start_s: last.map_or(step.start_s, |last| last.start_s + last.dwell_s),
            ..step
        };
        self.handed_out.push(step.clone());
        self.now = Some(step.clone());
        self.think(&step);
        Ok(Some(step))
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let thought = self.thinking.take().and_then(|thinking| thinking.join().ok().flatten());
        match (self.follow(marker), thought) {
            (Some(_), Some(thought)) => self.take(thought),
            (Some(_), None) => {}
            // What others put in between leaves the machine elsewhere than planned.
            (None, _) => self.changed = true,
        }
        Ok(())
    }

    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        // It was about a step that is none.
        drop(self.thinking.take().map(JoinHandle::join));
        let Some(step) = self.follow(marker) else { return Ok(()) };
        self.left_out.push(step.index);
        self.changed = true;
        if step.kind == StepKind::Point && !self.tried_again.contains(&step.to) {
            self.tried_again.push(step.to);
            // Behind all other points, before the first one is visited again.
            let behind = self.left.iter().rev().take_while(|step| step.kind == StepKind::Return).count();
            let place = self.left.len() - behind;
            let mut prices = self.prices.borrow_mut();
            prices.try_again(&step, behind);
            drop(prices);
            self.left.insert(place, step.clone());
            self.say(format!(
                "{} was left out: it is tried again, behind the other points as things stand",
                step.to
            ));
        } else {
            self.say(format!("{} was left out: the other steps have to tell what it would have", step.to));
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }
}
