//! The plan of a campaign.

use crate::SessionError;
use crate::certainty::retimed;
use crate::planning::with_plan_request;
use mapper_campaign::Campaign;
use mapper_core::Plan;
use mapper_physics::model::Model;
use mapper_planner::make_plan;

/// The plan of a campaign with a grid; where steps end when enough is known, with the dwells that they are expected to have.
///
/// # Errors
/// [`SessionError::Plan`] where points cannot be reached or no order is allowed.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    with_plan_request(campaign, model, |request| retimed(campaign, request, make_plan(request)?))
}
