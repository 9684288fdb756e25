//! From a checked campaign to what each crate of the way needs: model, plan request, guards, identification.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::predicted_method::Dynamic;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::{self, Order, WindowChoice};
use mapper_core::{Channel, DeclaredUncertainty, Method, Plan};
use mapper_identify::{IdentifyConfig, PressureTap, Stabilisation, WindowRule};
use mapper_observe::declared_uncertainties;
use mapper_physics::model::Model;
use mapper_planner::{PlanLimits, PlanRequest, PlanTiming, Repeats, SettleBands, VisitOrder, make_plan};
use mapper_runner::{DriftWatch, Guard, LimitGuard, OnDrift, SilenceGuard, StepSource, SurgeGuard};
use std::collections::BTreeMap;

/// Surge longer than this ends a run, s: a jump may touch the line, a point may not stay beyond it.
const SURGE_ALLOWED_S: f64 = 5.0;
/// Silence of a guarded channel longer than this ends a run, s.
const SILENCE_ALLOWED_S: f64 = 3.0;

/// The nominal model of a campaign.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, Failure> {
    mapper_campaign::nominal_model(campaign).map_err(|error| Failure::new(Code::BadInput, error))
}

/// The plan of a campaign.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, Failure> {
    with_plan_request(campaign, model, |request| {
        make_plan(request).map_err(|error| Failure::new(Code::NoPlan, error))
    })
}

/// Does something with what the plan of a campaign is made from.
pub fn with_plan_request<T>(
    campaign: &Campaign,
    model: &Model,
    then: impl FnOnce(&PlanRequest<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let canonical = serde_json::to_string(campaign).map_err(|error| Failure::new(Code::Failure, error))?;
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

/// What ends a run of this campaign before harm is done.
pub fn guards(campaign: &Campaign, delivered: &[Channel]) -> Vec<Box<dyn Guard>> {
    let limits = &campaign.limits;
    let above = [
        (Channel::ShaftSpeed, Some(limits.speed_max_rpm)),
        (Channel::P3, Some(limits.p3_max_pa)),
        (Channel::T2, limits.t2_max_k),
        (Channel::T3, limits.t3_max_k),
    ];
    let mut guards: Vec<Box<dyn Guard>> = above
        .into_iter()
        .filter_map(|(channel, limit)| Some(Box::new(LimitGuard::new(channel, limit?)) as Box<dyn Guard>))
        .collect();
    let watched = [Channel::ShaftSpeed, Channel::P2, Channel::T2]
        .into_iter()
        .filter(|channel| delivered.contains(channel))
        .collect();
    guards.push(Box::new(SilenceGuard::new(watched, SILENCE_ALLOWED_S)));
    guards.push(Box::new(SurgeGuard::new(SURGE_ALLOWED_S)));
    guards
}

/// Watches the repeats of a run, where the campaign says what to do about drift.
pub fn drift_watch<'a>(campaign: &Campaign, steps: &'a mut dyn StepSource) -> Option<DriftWatch<'a>> {
    let on_drift = match campaign.on_drift? {
        campaign::OnDrift::Hold => OnDrift::Hold,
        campaign::OnDrift::Continue => OnDrift::Continue,
        campaign::OnDrift::Zero => OnDrift::Zero,
    };
    Some(DriftWatch::new(steps, on_drift, declared(campaign, &BTreeMap::new())))
}

/// How the recordings of this campaign are identified.
pub fn identification(campaign: &Campaign) -> IdentifyConfig {
    let chosen = &campaign.identification;
    let tap = |channel: Channel| {
        let sensor = campaign.sensors.get(&channel);
        match sensor.and_then(|sensor| sensor.static_tap_pipe_diameter_m) {
            Some(pipe_diameter_m) => PressureTap::Static { pipe_diameter_m },
            None => PressureTap::Total,
        }
    };
    IdentifyConfig {
        method: chosen.method,
        window: match chosen.window {
            WindowChoice::Fixed { start_s, end_s } => WindowRule::Fixed { start_s, end_s },
            WindowChoice::Auto => WindowRule::Auto(Stabilisation {
                speed_ratio: chosen.stabilisation.speed_ratio,
                flow_ratio: chosen.stabilisation.flow_ratio,
                pressure_ratio_ratio: chosen.stabilisation.pressure_ratio_ratio,
                ..Stabilisation::default()
            }),
        },
        alpha_area_ratio: chosen.alpha_area_ratio,
        outlet_diameter_m: campaign.machine.params.compressor.outlet_diameter_m,
        probe_diameter_m: campaign.machine.params.t2_probe_diameter_m,
        joint: chosen.joint,
        internal_area_m2: campaign.machine.params.compressor.internal_area_m2,
        reference: campaign.reference,
        inlet_tap: tap(Channel::P1),
        outlet_tap: tap(Channel::P2),
        declared: declared(campaign, &BTreeMap::new()),
        ..IdentifyConfig::default()
    }
}

/// What is declared of the sensors of a recording that is read by a channel map with these declarations.
pub fn declared(
    campaign: &Campaign,
    channel_map: &BTreeMap<Channel, DeclaredUncertainty>,
) -> BTreeMap<Channel, DeclaredUncertainty> {
    let sensors = campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    declared_uncertainties(&sensors, &campaign.tolerances, channel_map)
}
