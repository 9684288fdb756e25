//! From a campaign to its plan, and a stored plan held against it.

use crate::SessionError;
use crate::declared::identification;
use crate::files::read_text;
use crate::predicted_method::{Dynamic, Joint};
use mapper_campaign::Campaign;
use mapper_core::{JointSettings, Method, Plan};
use mapper_identify::{ZeroSettings, expected_after_zero};
use mapper_physics::model::Model;
use mapper_planner::{PlanRequest, PredictedMethod, make_plan};
use std::path::Path;

/// The nominal model of a campaign.
///
/// # Errors
/// [`SessionError::Model`] where the map cannot be read; a checked campaign has none of that.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, SessionError> {
    Ok(mapper_campaign::nominal_model(campaign)?)
}

/// The plan of a campaign with a grid.
///
/// # Errors
/// [`SessionError::Plan`] where points cannot be reached or no order is allowed.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    with_plan_request(campaign, model, |request| Ok(make_plan(request)?))
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
    let canonical = serde_json::to_string(campaign).map_err(SessionError::from)?;
    let method = predicted_method(campaign);
    let of_transients = method.is_some();
    then(&PlanRequest {
        campaign_name: &campaign.name,
        campaign_canonical: &canonical,
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
        return_to_first: campaign.return_to_first && of_transients,
        required_sigma_eta: campaign.required_sigma_eta,
        method: method.as_deref(),
        effort: 1.0,
        seed: campaign.seed,
    })
}

/// The campaign's method as the planner sees it, after the zero that the campaign asks for; `None` for a method that waits
/// until nothing moves.
fn predicted_method(campaign: &Campaign) -> Option<Box<dyn PredictedMethod>> {
    let config = identification(campaign);
    let config = match campaign.zero {
        Some(soak) => expected_after_zero(config, &ZeroSettings::from(soak), soak.duration_s),
        None => config,
    };
    match campaign.identification.method {
        Method::Joint if config.joint != JointSettings::all_off() => Some(Box::new(Joint::of(config))),
        Method::Dynamic | Method::Joint => Some(Box::new(Dynamic::of(config))),
        Method::Steady | Method::Imported => None,
    }
}

/// A plan from a file, refused where what it was made from has changed; `made` is the plan made again.
///
/// # Errors
/// [`SessionError::StalePlan`] with what has changed; [`SessionError::NotAPlan`] and [`SessionError::File`] where the
/// file does not hold a plan.
pub fn stored_plan(path: &Path, made: &Plan) -> Result<Plan, SessionError> {
    let stored: Plan = serde_json::from_str(&read_text(path)?)
        .map_err(|source| SessionError::NotAPlan { path: path.to_owned(), source })?;
    let (then, now) = (&stored.made_from, &made.made_from);
    let changed: Vec<&str> = [
        ("the campaign", then.campaign_sha256 != now.campaign_sha256),
        ("the nominal model", then.model_sha256 != now.model_sha256),
        ("the sequence script", then.script_sha256 != now.script_sha256),
    ]
    .into_iter()
    .filter_map(|(what, changed)| changed.then_some(what))
    .collect();
    if changed.is_empty() {
        Ok(stored)
    } else {
        Err(SessionError::StalePlan { path: path.to_owned(), changed })
    }
}
