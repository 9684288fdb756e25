//! From a checked campaign to what each crate of the way needs: model, plan request, guards, identification.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::predicted_method::Dynamic;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Method, Plan, SURGE_ALLOWED_S};
use mapper_identify::{IdentifyConfig, PressureTap};
use mapper_physics::model::Model;
use mapper_planner::{PlanRequest, make_plan};
use mapper_runner::{DriftWatch, Guard, LimitGuard, SilenceGuard, StepSource, SurgeGuard};
use std::collections::BTreeMap;

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
    let on_drift = campaign.on_drift?;
    let mut declared: BTreeMap<Channel, DeclaredUncertainty> =
        campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    // The gain of the flow meter may stand with the model's tolerances.
    if let Some(flow) = declared.get_mut(&Channel::CompressorFlow) {
        flow.gain_sigma_ratio = flow.gain_sigma_ratio.max(campaign.tolerances.flow_meter_gain_ratio);
    }
    Some(DriftWatch::new(steps, on_drift, declared))
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
        window: chosen.window,
        settle_bands: chosen.settle_bands,
        alpha_area_ratio: chosen.alpha_area_ratio,
        outlet_diameter_m: campaign.machine.params.compressor.outlet_diameter_m,
        probe_diameter_m: campaign.machine.params.t2_probe_diameter_m,
        joint: chosen.joint,
        internal_area_m2: campaign.machine.params.compressor.internal_area_m2,
        reference: campaign.reference,
        inlet_tap: tap(Channel::P1),
        outlet_tap: tap(Channel::P2),
        declared: declared(campaign),
        ..IdentifyConfig::default()
    }
}

/// What is declared of the sensors; a flow meter without a gain of its own has that of the tolerances.
fn declared(campaign: &Campaign) -> BTreeMap<Channel, DeclaredUncertainty> {
    let mut declared: BTreeMap<Channel, DeclaredUncertainty> =
        campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    if let Some(flow) = declared.get_mut(&Channel::CompressorFlow)
        && flow.gain_sigma_ratio == 0.0
    {
        flow.gain_sigma_ratio = campaign.tolerances.flow_meter_gain_ratio;
    }
    declared
}
