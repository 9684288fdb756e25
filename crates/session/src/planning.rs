//! The plan of a campaign, and what it is made from.

use crate::SessionError;
use crate::declared::identification;
use crate::predicted_method::{Forecaster, Scope};
use crate::surge::count_surge_search;
use crate::zero_forecast;
use mapper_campaign::Campaign;
use mapper_core::{JointSettings, MadeFrom, Method, OperatingPoint, Plan};
use mapper_identify::{IdentifyConfig, ZeroSettings, expected_after_zero};
use mapper_physics::model::Model;
use mapper_planner::{PlanRequest, PredictedMethod, made_from, make_plan, sha256_hex};

/// The nominal model of a campaign.
///
/// # Errors
/// [`SessionError::Model`] where the map cannot be read; a checked campaign has none of that.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, SessionError> {
    Ok(mapper_campaign::nominal_model(campaign)?)
}

/// The plan of a campaign with a grid, with what seeking surge behind it takes.
///
/// # Errors
/// [`SessionError::Plan`] where points cannot be reached or no order is allowed.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    plan_of(campaign, &PlanInputs::of(campaign)?.request(campaign, model))
}

/// The same of a request that was made from the campaign.
///
/// # Errors
/// As [`plan`].
pub fn plan_of(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    let mut plan = make_plan(request)?;
    plan.remarks.extend(zero_forecast::sentence(campaign));
    count_surge_search(campaign, request.model, &mut plan);
    Ok(plan)
}

/// The points of a campaign in the order of its plan, which is not forecast any further.
///
/// # Errors
/// As [`plan`].
pub(crate) fn best_order(campaign: &Campaign, model: &Model) -> Result<Vec<OperatingPoint>, SessionError> {
    let inputs = PlanInputs::of(campaign)?;
    let request = PlanRequest { method: None, bound: false, ..inputs.request(campaign, model) };
    Ok(make_plan(&request)?.steps.into_iter().map(|step| step.to).collect())
}

/// What the plan of a campaign is made from: a plan whose hashes differ is stale.
///
/// # Errors
/// [`SessionError::Json`] where the campaign cannot be written as JSON.
pub(crate) fn fingerprint(campaign: &Campaign, model: &Model) -> Result<MadeFrom, SessionError> {
    let Some(script) = &campaign.sequence else {
        return Ok(made_from(&PlanInputs::of(campaign)?.request(campaign, model)));
    };
    let without_script = Campaign { sequence: None, repeats: None, ..campaign.clone() };
    let script_sha256 = Some(sha256_hex(&script.text));
    Ok(MadeFrom { script_sha256, ..fingerprint(&without_script, model)? })
}

/// What a request for a plan borrows besides campaign and model.
#[derive(Debug)]
pub struct PlanInputs {
    canonical: String,
    method: Option<Box<dyn PredictedMethod>>,
}

impl PlanInputs {
    /// Those of a campaign.
    ///
    /// # Errors
    /// [`SessionError::Json`] where the campaign cannot be written as JSON.
    pub fn of(campaign: &Campaign) -> Result<Self, SessionError> {
        Ok(PlanInputs { canonical: serde_json::to_string(campaign)?, method: predicted_method(campaign) })
    }

    /// The request for the plan of `campaign`, from which these were made.
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

/// The campaign's method as the planner sees it, after the zero that the campaign asks for; `None` for points that are imported.
fn predicted_method(campaign: &Campaign) -> Option<Box<dyn PredictedMethod>> {
    let config = identification_after_zero(campaign);
    let scope = match campaign.identification.method {
        Method::Joint if config.joint != JointSettings::all_off() => Scope::AllSteps,
        Method::Dynamic | Method::Joint => Scope::EachStep,
        Method::Steady => Scope::Settled,
        Method::Imported => return None,
    };
    Some(Box::new(Forecaster::of(config, scope)))
}

/// How the campaign's recording will be identified, as far as it is known before its zero.
fn identification_after_zero(campaign: &Campaign) -> IdentifyConfig {
    let config = identification(campaign);
    match campaign.zero {
        Some(soak) => expected_after_zero(config, &ZeroSettings::from(soak), soak.duration_s),
        None => config,
    }
}
