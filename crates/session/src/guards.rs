//! What ends a run before harm is done, and what watches its repeats.

use crate::declared::declared;
use mapper_campaign::Campaign;
use mapper_core::{Channel, SURGE_ALLOWED_S};
use mapper_record::ChannelMap;
use mapper_runner::{DriftWatch, Guard, LimitGuard, SilenceGuard, StepSource, SurgeGuard};

/// Silence of a guarded channel longer than this ends a run, s.
const SILENCE_ALLOWED_S: f64 = 3.0;

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
    Some(DriftWatch::new(steps, campaign.on_drift?, declared(campaign, &ChannelMap::native())))
}
