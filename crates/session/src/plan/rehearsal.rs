//! Rehearses a sequence script, or the jumps of a plan, on the nominal machine, so that errors never reach the rig.

use crate::plan::planning::{ScriptedSteps, add_surge_search, hash_inputs, plan};
use crate::rig::drive::drive;
use crate::{Session, SessionError};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::{BackendChoice, SequenceSource};
use mapper_core::{
    Channel, GuardName, GuardSet, OperatingPoint, Plan, PlanRemark, PlanStep, RunEnding, SampleBatch,
    StepMarker, VisitOrder,
};
use mapper_physics::simulation::model::Model;
use mapper_runner::{ObserverError, PlanSteps, RunError, RunObserver, StepSource, StepSourceError};

/// Objective recorded in the plan of a script.
const OBJECTIVE: &str = "sequence";
const REHEARSAL_BACKEND: &str = "virtual_lab";
/// Rehearsed time of each step of a plan after the arrival of P3 and valve, s: shafts follow within seconds.
const JUMP_S: f64 = 10.0;
/// Ratio by which the speed limit is raised to find the highest speed. Judgement: no jump overshoots by half.
const UNLIMITED_RATIO: f64 = 1.5;

/// Result of a rehearsal.
pub struct Rehearsal {
    /// The steps in executed order, with their standard errors.
    pub plan: Plan,
    /// The script's notes.
    pub notes: Vec<String>,
}

/// Runs the script on the virtual lab of the nominal machine, without a recording.
pub fn rehearse(
    session: &Session<'_>,
    campaign: &Campaign,
    model: &Model,
    source: &SequenceSource,
) -> Result<Rehearsal, SessionError> {
    let base = base_plan(campaign, model)?;
    let choice = BackendChoice { name: REHEARSAL_BACKEND.to_owned(), settings: serde_json::json!({}) };
    // Only the script's own steps: the sensors of a rehearsal need no zero.
    let nominal = Campaign { backend: choice, zero: None, ..campaign.clone() };
    let mut backend = session.registry.make_backend(&nominal, model)?;
    let scripted = ScriptedSteps::new(campaign, model, source, &backend.describe())?;
    let mut steps = RehearsalSteps { steps: scripted, notes: Vec::new() };
    let end = drive(&nominal, model, &mut steps, backend.as_mut(), &mut NoObserver, session.stop);
    let failed = |error| match error {
        RunError::Source(error) => SessionError::Script(error),
        error => SessionError::Rehearsal(error),
    };
    match end.map_err(failed)? {
        // The runner reports a failure as an error, and a rehearsal watches no drift.
        RunEnding::Completed | RunEnding::Drifted { .. } | RunEnding::Failed { .. } => {}
        RunEnding::Tripped(trip) => {
            return Err(SessionError::RehearsalTripped { t_s: trip.t_s, reason: trip.reason });
        }
        RunEnding::Interrupted { .. } => return Err(SessionError::Interrupted),
    }
    let mut plan = steps.steps.executed(&base);
    if plan.steps.is_empty() {
        return Err(SessionError::NoSteps(source.path.clone()));
    }
    plan.remarks.extend(plan.avoided_crossing());
    add_surge_search(campaign, model, &mut plan);
    Ok(Rehearsal { plan, notes: steps.notes })
}

impl Session<'_> {
    /// Rehearses the jumps of a plan on the virtual lab of the nominal machine, and returns the first guard trip that would end the run: the
    /// settings of the lab may move P3 and valve otherwise than declared. `None` too if the rehearsal fails, since it says nothing about the campaign then.
    pub fn forecast_guard_trip(
        &self,
        campaign: &Campaign,
        model: &Model,
        plan: &Plan,
    ) -> Result<Option<PlanRemark>, SessionError> {
        let (end, progress) = self.rehearse_jumps(campaign, model, plan)?;
        let (Ok(RunEnding::Tripped(trip)), Some(to)) = (end, progress.to) else { return Ok(None) };
        let mut highest_speed_rpm = None;
        if trip.guard == GuardName::Overspeed {
            let mut unlimited = Campaign { guards: None, ..campaign.clone() };
            unlimited.limits.speed_max_rpm *= UNLIMITED_RATIO;
            highest_speed_rpm = Some(self.rehearse_jumps(&unlimited, model, plan)?.1.highest_rpm);
        }
        Ok(Some(PlanRemark::GuardTrip { guard: trip.guard, to, reason: trip.reason, highest_speed_rpm }))
    }

    fn rehearse_jumps(
        &self,
        campaign: &Campaign,
        model: &Model,
        plan: &Plan,
    ) -> Result<(Result<RunEnding, RunError>, Progress), SessionError> {
        let mut settings = serde_json::json!({});
        if campaign.backend.name == REHEARSAL_BACKEND
            && let Some(actuators) = campaign.backend.settings.get("actuators")
        {
            settings["actuators"] = actuators.clone();
        }
        // A step that is cut short does not reach its speed.
        let guards = Some(GuardSet { speed: None, ..campaign.guard_set() });
        let backend = BackendChoice { name: REHEARSAL_BACKEND.to_owned(), settings };
        let nominal = Campaign { backend, zero: None, guards, ..campaign.clone() };
        let mut backend = self.registry.make_backend(&nominal, model)?;
        let mut jumps = Plan { cool_down_s: 0.0, ..plan.clone() };
        for step in &mut jumps.steps {
            let arrival_s = step.transition.map_or(0.0, |transition| transition.arrival_s);
            step.dwell_s = step.dwell_s.min(JUMP_S + arrival_s);
        }
        let mut progress = Progress::default();
        let mut steps = PlanSteps::new(&jumps);
        match drive(&nominal, model, &mut steps, backend.as_mut(), &mut progress, self.stop) {
            Ok(RunEnding::Interrupted { .. }) => Err(SessionError::Interrupted),
            end => Ok((end, progress)),
        }
    }
}

#[derive(Debug, Default)]
struct Progress {
    to: Option<OperatingPoint>,
    highest_rpm: f64,
}

impl RunObserver for Progress {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.to = marker.to;
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let speeds = batch.column(Channel::ShaftSpeed).unwrap_or_default();
        self.highest_rpm = speeds.iter().copied().fold(self.highest_rpm, f64::max);
        Ok(())
    }
}

struct NoObserver;

impl RunObserver for NoObserver {}

struct RehearsalSteps {
    steps: ScriptedSteps,
    notes: Vec<String>,
}

impl StepSource for RehearsalSteps {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(&self.steps)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(&mut self.steps)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        self.steps.next_step()
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.steps.after_step(marker)?;
        if let (Some(step), Some(result)) = (self.steps.done.last_mut(), &self.steps.finished) {
            step.predicted.sigma_eta = Some(result.sigma_eta()).filter(|sigma| sigma.is_finite());
            step.predicted.sigma_h_rel =
                result.h_w_m2k().map(|h| result.sigma_h_w_m2k() / h).filter(|ratio| ratio.is_finite());
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        let notes = self.steps.take_notes();
        self.notes.extend(notes.iter().cloned());
        notes
    }
}

fn base_plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    // The planner plans one point only; the script selects the others.
    let points = campaign.points.iter().copied().take(1).collect();
    let single_step = Campaign {
        sequence: None,
        repeats: None,
        points,
        order: VisitOrder::Listed,
        surge_search: None,
        ..campaign.clone()
    };
    let (objective, made_from) = (OBJECTIVE.to_owned(), hash_inputs(campaign, model)?);
    Ok(Plan { objective, made_from, ..plan(&single_step, model)? })
}
