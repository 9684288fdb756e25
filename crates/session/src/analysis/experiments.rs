//! Experiments that can distinguish causes: the planner's jumps, accepted steps of T3 and oil temperature, and a soak.

use crate::plan::planning::PlanInputs;
use crate::recording::identification_config::{expected_rest, identification_with};
use crate::{Registry, SessionError};
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, RigMode, SetpointRanges, Setpoints};
use mapper_diagnose::gap::{AllowedJump, AlsoChanged, AtRest, Experiment};
use mapper_identify::{ZeroSettings, expected_after_zero};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::reach;
use mapper_physics::simulation::model::Model;
use mapper_planner::PlanRequest;
use mapper_recording::ChannelMap;

/// Maximum number of points for which all jumps are simulated to check the limits.
const MAX_POINTS: usize = 40;
/// Candidate changes of turbine inlet temperature and oil temperature, K.
const T3_STEPS_K: [f64; 3] = [100.0, 50.0, -100.0];
const OIL_STEPS_K: [f64; 2] = [40.0, -20.0];
/// Margin to the maximum T3, K. The test cell fluctuates, sensors may read high, and a guard watches this limit.
const T3_MARGIN_K: f64 = 15.0;
/// Duration of such a step, s. Housings need minutes to respond.
const DWELL_S: f64 = 300.0;
/// Duration of a soak, s, as in the shipped campaigns.
const SOAK_S: f64 = 1800.0;

/// All permitted experiments.
pub(crate) fn experiments(
    registry: &Registry,
    campaign: &Campaign,
    map: &ChannelMap,
    model: &Model,
) -> Result<Vec<Experiment>, SessionError> {
    let mut all: Vec<Experiment> =
        allowed_jumps(campaign, model)?.into_iter().map(Experiment::jump).collect();
    // Temperature steps need a declared range of accepted setpoints.
    if let Some(accepts) = registry.setpoint_ranges(campaign, model) {
        let places = corners(&campaign.points);
        all.extend(places.iter().flat_map(|point| temperature_steps(campaign, model, *point, &accepts)));
    }
    all.extend(soak(campaign, map));
    Ok(all)
}

/// A soak before the next run, if the campaign has none.
fn soak(campaign: &Campaign, map: &ChannelMap) -> Option<Experiment> {
    if campaign.zero.is_some() {
        return None;
    }
    let settings = ZeroSettings::default();
    let residual_sigma =
        expected_after_zero(identification_with(campaign, map), &settings, SOAK_S, expected_rest(campaign))
            .declared;
    let offset_sigma_k = |channel| {
        residual_sigma
            .get(&channel)
            .map_or(settings.temperature_sigma_k, |residual_sigma| residual_sigma.offset_sigma)
    };
    let soak = AtRest {
        duration_s: SOAK_S,
        left_sigma_k: std::array::from_fn(|place| offset_sigma_k(AtRest::CHANNELS[place])),
    };
    let rest =
        OperatingPoint { speed_rpm: 0.0, valve_opening_ratio: campaign.points.first()?.valve_opening_ratio };
    let jump = AllowedJump { from: rest, to: rest, from_p3_pa: 0.0, to_p3_pa: 0.0, dwell_s: SOAK_S };
    Some(Experiment { jump, also: AlsoChanged::Soak(soak) })
}

/// Jumps between the campaign's points that the planner allows. Empty for grids too large to simulate and for campaigns without a grid.
fn allowed_jumps(campaign: &Campaign, model: &Model) -> Result<Vec<AllowedJump>, SessionError> {
    if campaign.points.len() > MAX_POINTS {
        return Ok(Vec::new());
    }
    let inputs = PlanInputs::of(campaign)?;
    // The check of a jump does not depend on the expected error after it.
    let request = PlanRequest { method: None, ..inputs.request(campaign, model) };
    let Ok(jumps) = mapper_planner::forecast_all_jumps(&request) else { return Ok(Vec::new()) };
    let allowed = jumps.iter().filter(|jump| jump.rejections.is_empty());
    Ok(allowed
        .map(|jump| AllowedJump {
            from: jump.from,
            to: jump.to,
            from_p3_pa: jump.p3_pa - jump.p3_change_pa,
            to_p3_pa: jump.p3_pa,
            dwell_s: request.timing.dwell.fixed_or_usual_s(),
        })
        .collect())
}

/// The slowest and the fastest points, each with the smallest and the largest opening.
fn corners(points: &[OperatingPoint]) -> Vec<OperatingPoint> {
    let mut sorted = points.to_vec();
    let key = |p: &OperatingPoint| (p.speed_rpm, p.valve_opening_ratio);
    sorted.sort_by(|a, b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let lines: Vec<&[OperatingPoint]> = sorted.chunk_by(|a, b| a.speed_rpm == b.speed_rpm).collect();
    let ends = [lines.first(), lines.last()].into_iter().flatten();
    let mut corners: Vec<OperatingPoint> =
        ends.flat_map(|line| [line.first(), line.last()]).flatten().copied().collect();
    corners.dedup();
    corners
}

/// Accepted steps of T3 and oil temperature within the limits, at constant speed and valve opening.
fn temperature_steps(
    campaign: &Campaign,
    model: &Model,
    point: OperatingPoint,
    accepts: &SetpointRanges,
) -> Vec<Experiment> {
    let now = campaign.boundary;
    let is_below_limit =
        |to_k: &f64| campaign.limits.t3_max_k.is_none_or(|limit_k| *to_k <= limit_k - T3_MARGIN_K);
    let held = |boundary: &BoundaryConditions| {
        let steady = reach(model, point, boundary, campaign.follow_outlet, &campaign.limits).ok()?;
        let BoundaryConditions { p3_pa, t3_k, oil_temperature_k, .. } = steady.boundary;
        let valve_opening_ratio = point.valve_opening_ratio;
        let setpoints =
            Setpoints { mode: RigMode::Running, p3_pa, t3_k, valve_opening_ratio, oil_temperature_k };
        accepts.check(&setpoints).is_ok().then_some(p3_pa)
    };
    let Some(from_p3_pa) = held(&now) else { return Vec::new() };
    let step = |to_p3_pa: f64, also: AlsoChanged| Experiment {
        jump: AllowedJump { from: point, to: point, from_p3_pa, to_p3_pa, dwell_s: DWELL_S },
        also,
    };
    let (t3_k, oil_k) = (now.t3_k, now.oil_temperature_k);
    let t3_follows = campaign.follow_outlet.turbine_inlet;
    let to_k = T3_STEPS_K.iter().filter(|_| !t3_follows).map(|by_k| t3_k + by_k).filter(is_below_limit);
    let t3_steps = to_k.filter_map(|to_k| {
        Some(step(held(&BoundaryConditions { t3_k: to_k, ..now })?, AlsoChanged::T3 { from_k: t3_k, to_k }))
    });
    let oil_steps = OIL_STEPS_K.iter().filter(|_| !campaign.follow_outlet.oil).filter_map(|by_k| {
        let to_k = oil_k + by_k;
        let held_pa = held(&BoundaryConditions { oil_temperature_k: to_k, ..now })?;
        Some(step(held_pa, AlsoChanged::Oil { from_k: oil_k, to_k }))
    });
    t3_steps.chain(oil_steps).collect()
}
