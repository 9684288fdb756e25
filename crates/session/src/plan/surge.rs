//! The surge search: control near surge, forecast of its duration, and its marks.

use crate::recording::identification_config::declared;
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, Plan, PlanRemark, Predicted, Recording};
use mapper_identify::IdentifyConfig;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::hold_speed;
use mapper_physics::simulation::model::Model;
use mapper_recording::ChannelMap;
use mapper_runner::surge::{SurgeErrors, SurgeMarks};
use mapper_runner::{HoldConditions, SurgeSearch, surge};

/// Setpoints and predicted readings of the nominal machine at a point near or beyond its surge line. `None` if P3 or T2 would exceed the
/// campaign's limits.
pub fn hold_near_surge(campaign: &Campaign, model: &Model, point: OperatingPoint) -> Option<HoldConditions> {
    let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
    let steady = hold_speed(model, point.speed_rpm, &boundary, campaign.follow_outlet).ok()?;
    let (limits, outputs) = (&campaign.limits, &steady.outputs);
    let p3_pa = steady.boundary.p3_pa;
    let within = (limits.p3_min_pa..=limits.p3_max_pa).contains(&p3_pa)
        && limits.t2_max_k.is_none_or(|limit_k| outputs.t2_k <= limit_k);
    within.then(|| HoldConditions {
        p3_pa,
        t3_k: steady.boundary.t3_k,
        oil_temperature_k: steady.boundary.oil_temperature_k,
        predicted: Predicted::settled(outputs.flow_kg_s, outputs.pressure_ratio, outputs.t2_k, 0.0),
        surge_margin_ratio: steady.surge_margin_ratio(model),
    })
}

/// Adds the search, as forecast on the nominal machine, to a plan's duration and remarks.
pub(crate) fn add_surge_search(campaign: &Campaign, model: &Model, plan: &mut Plan) {
    let Some(seek) = campaign.surge_search else { return };
    let mut ends: Vec<OperatingPoint> = Vec::new();
    for step in &plan.steps {
        match ends.iter_mut().find(|end| (end.speed_rpm - step.to.speed_rpm).abs() < 1e-3) {
            Some(end) if end.valve_opening_ratio <= step.to.valve_opening_ratio => {}
            Some(end) => *end = step.to,
            None => ends.push(step.to),
        }
    }
    let margin = |end: &OperatingPoint| {
        hold_near_surge(campaign, model, *end).map_or(1.0, |steady| steady.surge_margin_ratio)
    };
    let approaches: usize = ends.iter().map(|end| surge::expected_readings(margin(end), &seek)).sum();
    plan.surge_search_s = approaches as f64 * seek.dwell_s + ends.len() as f64 * SurgeSearch::AROUND_S;
    plan.figures.minutes = plan.duration_s() / 60.0;
    plan.remarks.push(PlanRemark::SurgeSearch {
        lines: ends.len(),
        closest_margin_ratio: seek.closest_margin_ratio,
        steps: approaches + 2 * ends.len(),
        duration_s: plan.surge_search_s,
    });
}

/// Finds the surge marks in the approaches of a recording.
pub(crate) fn find_surge_marks(
    approaches: &Recording,
    campaign: Option<&Campaign>,
    config: &IdentifyConfig,
) -> SurgeMarks {
    let errors = campaign.map_or_else(SurgeErrors::default, |campaign| {
        SurgeErrors::of(&declared(campaign, &ChannelMap::native()))
    });
    surge::find_surge_marks(approaches, config.reference, errors)
}
