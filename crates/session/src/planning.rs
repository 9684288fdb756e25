//! From a campaign to its plan, and a stored plan held against it.

use crate::SessionError;
use crate::declared::identification;
use crate::files::read_text;
use crate::guards::SURGE_ALLOWED_S;
use crate::predicted_method::Dynamic;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::{Order, WindowChoice};
use mapper_core::{Method, Plan};
use mapper_physics::model::Model;
use mapper_planner::{PlanLimits, PlanRequest, PlanTiming, Repeats, SettleBands, VisitOrder, make_plan};
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
    let dynamic = Dynamic::of(identification(campaign));
    let (window_start_s, window_end_s) = match campaign.identification.window {
        WindowChoice::Auto => (None, None),
        WindowChoice::Fixed { start_s, end_s } => (Some(start_s), Some(end_s)),
    };
    let stabilisation = &campaign.identification.stabilisation;
    let limits = &campaign.limits;
    then(&PlanRequest {
        campaign_name: &campaign.name,
        campaign_canonical: &canonical,
        model,
        boundary: campaign.boundary,
        follow_outlet: campaign.follow_outlet,
        points: &campaign.points,
        order: match campaign.order {
            Order::SumGradient => VisitOrder::SumGradient,
            Order::WorstGradient => VisitOrder::WorstGradient,
            Order::Information => VisitOrder::Information,
            Order::Time => VisitOrder::Time,
            Order::Greedy => VisitOrder::GreedyGradient,
            Order::Listed => VisitOrder::Listed,
        },
        timing: PlanTiming {
            warm_up_s: campaign.timing.warm_up_s,
            dwell_s: campaign.timing.dwell_s,
            cool_down_s: campaign.timing.cool_down_s,
            window_start_s,
            window_end_s,
        },
        settle_bands: SettleBands {
            speed_ratio: stabilisation.speed_ratio,
            flow_ratio: stabilisation.flow_ratio,
            pressure_ratio_ratio: stabilisation.pressure_ratio_ratio,
        },
        limits: PlanLimits {
            speed_max_rpm: limits.speed_max_rpm,
            p3_min_pa: limits.p3_min_pa,
            p3_max_pa: limits.p3_max_pa,
            t3_max_k: limits.t3_max_k,
            t2_max_k: limits.t2_max_k,
            surge_margin_min_ratio: limits.surge_margin_min_ratio,
            surge_allowed_s: SURGE_ALLOWED_S,
            housing_gradient_max_k: limits.housing_gradient_max_k,
            p3_slew_max_pa_s: limits
                .p3_stroke_s
                .map(|stroke_s| (limits.p3_max_pa - limits.p3_min_pa) / stroke_s),
        },
        appended: None,
        repeats: campaign.repeats.map(|repeats| Repeats {
            jump: repeats.jump.map(|jump| (jump.from, jump.to)),
            every_steps: repeats.every_steps,
            at_least: repeats.at_least,
        }),
        required_sigma_eta: campaign.required_sigma_eta,
        method: match campaign.identification.method {
            Method::Dynamic | Method::Joint => Some(&dynamic),
            Method::Steady | Method::Imported => None,
        },
        effort: 1.0,
        seed: campaign.seed,
    })
}

/// A plan from a file, refused where what it was made from has changed; `made` is the plan made anew.
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
