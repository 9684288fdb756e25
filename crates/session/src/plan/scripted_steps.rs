//! Runs a sequence script: passes its steps to the runner and their results to the script.

use crate::SessionError;
use crate::plan::planning::order_points;
use crate::recording::identification_config::identification;
use crate::rig::observers::{append_samples, config_for_single_steps, retain_last_two_steps};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::SequenceSource;
use mapper_core::{
    IdentifiedPoint, Plan, PlanStep, Recording, RigDescription, SampleBatch, SetpointRanges, StepMarker,
    step_number,
};
use mapper_identify::{IdentifyConfig, identify_each};
use mapper_physics::simulation::model::Model;
use mapper_runner::{StepSource, StepSourceError};
use mapper_sequence::{EndCondition, Script, SequenceRequest, SequenceRunner, SettleWatch, StepResult};

/// The steps of a script, each identified as soon as it ends.
pub(crate) struct ScriptedSteps {
    script: SequenceRunner,
    config: IdentifyConfig,
    warm_up_s: f64,
    cool_down_s: f64,
    /// The last two steps with their samples. Identification of the last step needs only these.
    recent: Recording,
    current_step: Option<PlanStep>,
    settling: Option<SettleWatch>,
    pub(crate) finished: Option<StepResult>,
    /// Ended steps with their actual times.
    pub done: Vec<PlanStep>,
}

impl ScriptedSteps {
    /// The steps of a campaign's script on this rig.
    pub fn new(
        campaign: &Campaign,
        model: &Model,
        source: &SequenceSource,
        rig: &RigDescription,
    ) -> Result<Self, SessionError> {
        let script = Script { path: source.path.clone(), text: source.text.clone() };
        let script = SequenceRunner::start(script, request(campaign, model, rig.accepts))?;
        Ok(ScriptedSteps {
            script,
            // A script gets each step immediately; the joint method identifies all steps at the end.
            config: config_for_single_steps(identification(campaign)),
            warm_up_s: campaign.timing.warm_up_s,
            cool_down_s: campaign.timing.cool_down_s,
            recent: Recording::default(),
            current_step: None,
            settling: None,
            finished: None,
            done: Vec::new(),
        })
    }

    /// The executed steps as a plan, with all other fields from `base`.
    pub fn executed(&self, base: &Plan) -> Plan {
        with_steps(base.clone(), self.done.clone())
    }
}

impl StepSource for ScriptedSteps {
    fn warm_up_s(&self) -> f64 {
        self.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        self.cool_down_s
    }

    fn is_ready(&mut self) -> bool {
        self.script.request_step(self.finished.take());
        self.script.is_ready()
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.script.next_step(self.finished.take()).map_err(StepSourceError::new)?;
        let Some(next) = next else { return Ok(None) };
        self.settling = match next.end {
            EndCondition::Dwell => None,
            EndCondition::UntilSettled(rule) => Some(SettleWatch::new(rule, next.step.start_s)),
        };
        self.current_step = Some(next.step.clone());
        Ok(Some(next.step))
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        append_samples(&mut self.recent, batch);
        self.settling.as_mut().is_some_and(|watch| watch.has_settled(batch))
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let Some(mut step) = self.current_step.take() else { return Ok(()) };
        retain_last_two_steps(&mut self.recent, marker);
        let identified = identify_each(&self.recent, &self.config).map_err(StepSourceError::new)?.pop();
        self.finished = Some(result_of(&step, marker, identified.and_then(Result::ok)));
        (step.start_s, step.dwell_s) = (marker.start_s, marker.end_s - marker.start_s);
        step.predicted.minutes = step.dwell_s / 60.0;
        self.done.push(step);
        Ok(())
    }

    /// Reports to the script that a result is missing.
    fn after_skipped_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let Some(step) = self.current_step.take() else { return Ok(()) };
        self.finished = Some(result_of(&step, marker, None));
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.script.take_notes()
    }
}

fn result_of(step: &PlanStep, marker: &StepMarker, identified: Option<IdentifiedPoint>) -> StepResult {
    StepResult {
        number: step_number(step.index),
        target: step.to,
        from: step.from,
        start_s: marker.start_s,
        end_s: marker.end_s,
        identified,
    }
}

fn with_steps(mut plan: Plan, steps: Vec<PlanStep>) -> Plan {
    plan.steps = steps;
    let gradients = || plan.steps.iter().filter_map(|step| step.predicted.dtc_k).map(f64::abs);
    let (sum_k, min_k) = (gradients().sum(), gradients().min_by(f64::total_cmp));
    plan.figures.sum_gradient_k = sum_k;
    plan.figures.min_gradient_k = min_k;
    plan.figures.worst_sigma_eta =
        plan.steps.iter().filter_map(|step| step.predicted.sigma_eta).max_by(f64::total_cmp);
    plan.figures.minutes = plan.duration_s() / 60.0;
    plan
}

/// Campaign data available to a script.
fn request(campaign: &Campaign, model: &Model, accepts: Option<SetpointRanges>) -> SequenceRequest {
    let (planned, machine) = (campaign.clone(), model.clone());
    SequenceRequest {
        points: campaign.points.clone(),
        timing: campaign.timing,
        window: campaign.identification.window,
        settle_bands: campaign.identification.settle_bands,
        model: model.clone(),
        boundary: campaign.boundary,
        follow_outlet: campaign.follow_outlet,
        limits: campaign.limits,
        accepts,
        actuators: campaign.rig_actuators(),
        order: Box::new(move |points| {
            // The script itself decides on repeat visits.
            let subset = Campaign {
                points: points.to_vec(),
                sequence: None,
                repeats: None,
                return_to_first: false,
                ..planned.clone()
            };
            order_points(&subset, &machine).map_err(|error| error.to_string())
        }),
    }
}
