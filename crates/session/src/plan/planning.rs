//! The plan of a campaign and its inputs.

use crate::SessionError;
use crate::plan::predicted_method::{Forecaster, Scope};
use crate::plan::surge::add_surge_search;
use crate::plan::zero_forecast;
use crate::recording::identification_config::identification;
use mapper_campaign::Campaign;
use mapper_core::{Method, OperatingPoint, Plan, PlanInputHashes};
use mapper_identify::{IdentifyConfig, ZeroSettings, expected_after_zero};
use mapper_physics::simulation::model::Model;
use mapper_planner::{PlanRequest, PredictedMethod, make_plan, sha256_hex};

/// The nominal model of a campaign.
///
/// # Errors
/// [`SessionError::Model`] if the map cannot be read, which a checked campaign excludes.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, SessionError> {
    Ok(mapper_campaign::nominal_model(campaign)?)
}

/// The plan of a campaign with a grid, including the time of a subsequent surge search.
///
/// # Errors
/// [`SessionError::Plan`] if points cannot be reached or no order is allowed.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    plan_of(campaign, &PlanInputs::of(campaign)?.request(campaign, model))
}

/// Same as [`plan`], for a request that was already made from the campaign.
///
/// # Errors
/// As [`plan`].
pub fn plan_of(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    let mut plan = make_plan(request)?;
    plan.remarks.extend(zero_forecast::zero_remark(campaign));
    add_surge_search(campaign, request.model, &mut plan);
    Ok(plan)
}

/// The points of a campaign in planned order, without any further forecast.
pub(crate) fn order_points(campaign: &Campaign, model: &Model) -> Result<Vec<OperatingPoint>, SessionError> {
    let inputs = PlanInputs::of(campaign)?;
    let request = PlanRequest { method: None, bound: false, ..inputs.request(campaign, model) };
    Ok(make_plan(&request)?.steps.into_iter().map(|step| step.to).collect())
}

/// Hashes of the plan's inputs: a plan with other hashes is stale.
pub(crate) fn hash_inputs(campaign: &Campaign, model: &Model) -> Result<PlanInputHashes, SessionError> {
    let Some(script) = &campaign.sequence else {
        return Ok(mapper_planner::hash_inputs(&PlanInputs::of(campaign)?.request(campaign, model)));
    };
    let without_script = Campaign { sequence: None, repeats: None, ..campaign.clone() };
    let script_sha256 = Some(sha256_hex(&script.text));
    Ok(PlanInputHashes { script_sha256, ..hash_inputs(&without_script, model)? })
}

/// Data that a plan request borrows in addition to campaign and model.
#[derive(Debug)]
pub struct PlanInputs {
    canonical: String,
    method: Option<Box<dyn PredictedMethod>>,
}

impl PlanInputs {
    /// Inputs of a campaign.
    ///
    /// # Errors
    /// [`SessionError::Json`] if the campaign cannot be written as JSON.
    pub fn of(campaign: &Campaign) -> Result<Self, SessionError> {
        Ok(PlanInputs { canonical: serde_json::to_string(campaign)?, method: predicted_method(campaign) })
    }

    /// The plan request for `campaign`, from which these inputs were made.
    pub fn request<'a>(&'a self, campaign: &'a Campaign, model: &'a Model) -> PlanRequest<'a> {
        let transient = matches!(campaign.identification.method, Method::Joint | Method::Dynamic);
        PlanRequest {
            campaign_name: &campaign.name,
            campaign_canonical: &self.canonical,
            model,
            boundary: campaign.boundary,
            follow_outlet: campaign.follow_outlet,
            points: &campaign.points,
            order: campaign.order,
            timing: campaign.timing,
            window: campaign.identification.window,
            settle_bands: campaign.identification.settle_bands,
            limits: campaign.limits,
            appended: None,
            repeats: campaign.repeats,
            return_to_first: campaign.return_to_first && transient,
            method: self.method.as_deref(),
            effort: 1.0,
            bound: true,
            seed: campaign.seed,
        }
    }
}

/// Error forecast of the campaign's method after its zero; `None` for imported points.
fn predicted_method(campaign: &Campaign) -> Option<Box<dyn PredictedMethod>> {
    let config = identification_after_zero(campaign);
    let scope = match campaign.identification.method {
        Method::Joint => Scope::AllSteps,
        Method::Dynamic => Scope::EachStep,
        Method::Steady => Scope::Settled,
        Method::Corrected | Method::Imported => return None,
    };
    Some(Box::new(Forecaster::of(config, scope)))
}

/// Expected identification settings after the zero, as far as known before the run.
fn identification_after_zero(campaign: &Campaign) -> IdentifyConfig {
    let config = identification(campaign);
    match campaign.zero {
        Some(soak) => {
            expected_after_zero(config, &ZeroSettings::from(soak), soak.duration_s, campaign.boundary.p1_pa)
        }
        None => config,
    }
}
