//! What the plan of a campaign is made from.

use crate::SessionError;
use crate::declared::identification;
use crate::predicted_method::{Dynamic, Joint};
use mapper_campaign::Campaign;
use mapper_core::{JointSettings, Method};
use mapper_identify::{IdentifyConfig, ZeroSettings, expected_after_zero};
use mapper_physics::model::Model;
use mapper_planner::{PlanRequest, PredictedMethod, Simulations};

/// The nominal model of a campaign.
///
/// # Errors
/// [`SessionError::Model`] where the map cannot be read; a checked campaign has none of that.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, SessionError> {
    Ok(mapper_campaign::nominal_model(campaign)?)
}

/// Does something with what the plan of a campaign is made from.
///
/// # Errors
/// Those of `then`.
pub fn with_plan_request<T, E: From<SessionError>>(
    campaign: &Campaign,
    model: &Model,
    then: impl FnOnce(&PlanRequest<'_>) -> Result<T, E>,
) -> Result<T, E> {
    then(&PlanMaterial::of(campaign)?.request(campaign, model))
}

/// What a plan's request borrows besides campaign and model.
#[derive(Debug)]
pub(crate) struct PlanMaterial {
    canonical: String,
    method: Option<Box<dyn PredictedMethod>>,
    simulations: Simulations,
}

impl PlanMaterial {
    pub(crate) fn of(campaign: &Campaign) -> Result<Self, SessionError> {
        let canonical = serde_json::to_string(campaign)?;
        Ok(PlanMaterial {
            canonical,
            method: predicted_method(campaign),
            simulations: Simulations::new(campaign.timing.dwell_s, campaign.points.len()),
        })
    }

    /// `campaign`: the one that this was made of, and `model` always the same.
    pub(crate) fn request<'a>(&'a self, campaign: &'a Campaign, model: &'a Model) -> PlanRequest<'a> {
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
            return_to_first: campaign.return_to_first && self.method.is_some(),
            required_sigma_eta: campaign.required_sigma_eta,
            method: self.method.as_deref(),
            simulations: Some(&self.simulations),
            effort: 1.0,
            draft: false,
            gradient_share: campaign.gradient_share,
            seed: campaign.seed,
        }
    }
}

/// The campaign's method as the planner sees it, after the zero that the campaign asks for; `None` for a method that waits
/// until nothing moves.
fn predicted_method(campaign: &Campaign) -> Option<Box<dyn PredictedMethod>> {
    let config = identification_after_zero(campaign);
    match campaign.identification.method {
        Method::Joint if config.joint != JointSettings::all_off() => Some(Box::new(Joint::of(config))),
        Method::Dynamic | Method::Joint => Some(Box::new(Dynamic::of(config))),
        Method::Steady | Method::Imported => None,
    }
}

/// How the campaign's recording will be identified, as far as it is known before its zero.
pub(crate) fn identification_after_zero(campaign: &Campaign) -> IdentifyConfig {
    let config = identification(campaign);
    match campaign.zero {
        Some(soak) => expected_after_zero(config, &ZeroSettings::from(soak), soak.duration_s),
        None => config,
    }
}
