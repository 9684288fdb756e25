//! Guards that end a step or a run before damage.

use crate::SessionError;
use mapper_campaign::{Campaign, DEFAULT_MAX_AGE_S};
use mapper_core::{Channel, GuardName, RigDescription};
use mapper_runner::{
    AvoidedSpeedWatch, BatchWatch, Guard, REQUIRED_CHANNELS, RigWatch, SignalWatch, SilenceWatch, StartCheck,
    SurgeWatch, UnguardedChannel,
};

/// Makes the guards for a run of this campaign on this rig. A default guard is omitted if the rig does not deliver its signal. Declared and
/// required guards are always included; they trip if their signal is missing.
pub fn make_guards(
    campaign: &Campaign,
    rig: &RigDescription,
    auxiliary_channels: &[UnguardedChannel],
) -> Vec<Box<dyn Guard>> {
    let set = campaign.guard_set();
    let guarded: Vec<Channel> = set.signals.iter().map(|spec| spec.channel).collect();
    let mut guards: Vec<Box<dyn Guard>> = vec![Box::new(BatchWatch::default())];
    for spec in set.signals {
        let required = campaign.guards.is_some() || rig.needs_guarded.contains(&spec.name);
        if required || rig.channels.contains(&spec.channel) {
            guards.push(Box::new(SignalWatch::new(spec)));
        }
    }
    if !campaign.limits.avoid.is_empty() {
        guards.push(Box::new(AvoidedSpeedWatch::new(campaign.limits.avoid)));
    }
    guards.extend(set.surge.map(|spec| Box::new(SurgeWatch::new(spec)) as Box<dyn Guard>));
    if rig.controls {
        let mut watched = auxiliary_channels.to_vec();
        let is_new = |channel: &&Channel| {
            !guarded.contains(channel) && !auxiliary_channels.iter().any(|other| other.channel == **channel)
        };
        let required = REQUIRED_CHANNELS.iter().filter(|channel| rig.channels.contains(channel));
        watched.extend(required.filter(is_new).map(|channel| UnguardedChannel {
            source: rig.backend.clone(),
            channel: *channel,
            age_s: max_age_s(campaign, rig),
            frozen: None,
        }));
        for one in watched.iter_mut().filter(|one| one.channel == Channel::CompressorFlow) {
            one.frozen = set.frozen_flow;
        }
        guards.push(Box::new(SilenceWatch::new(watched)));
        guards.push(Box::new(RigWatch::default()));
        guards.push(Box::new(StartCheck::new(rig.channels.clone())));
    }
    guards
}

/// Number of samples that a source may miss before it counts as silent.
const MAX_MISSED_SAMPLES: f64 = 3.0;

/// Age after which a channel of this source is silent, s.
pub(crate) fn max_age_s(campaign: &Campaign, source: &RigDescription) -> f64 {
    let age_s = campaign.guard_set().signals.first().map_or(DEFAULT_MAX_AGE_S, |guard| guard.age_s);
    age_s.max(MAX_MISSED_SAMPLES / source.sample_rate_hz.max(1e-3))
}

/// Checks that every guard the rig requires is present, and that its channel is delivered.
///
/// # Errors
/// [`SessionError::MissingGuards`] with all missing guards, [`SessionError::GuardWithoutChannel`] with the channels.
pub fn check_guards(campaign: &Campaign, rig: &RigDescription) -> Result<(), SessionError> {
    let set = campaign.guard_set();
    let missing: Vec<GuardName> =
        rig.needs_guarded.iter().copied().filter(|name| !set.ends_on(*name)).collect();
    if !missing.is_empty() {
        let names = missing.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        return Err(SessionError::MissingGuards { backend: rig.backend.clone(), guards: names });
    }
    let is_required = |name: &GuardName| campaign.guards.is_some() || rig.needs_guarded.contains(name);
    let without_channel: Vec<String> = set
        .signals
        .iter()
        .filter(|spec| is_required(&spec.name) && !rig.channels.contains(&spec.channel))
        .map(|spec| format!("{} (guard `{}`)", spec.channel, spec.name))
        .collect();
    if without_channel.is_empty() {
        return Ok(());
    }
    Err(SessionError::GuardWithoutChannel {
        backend: rig.backend.clone(),
        channels: without_channel.join(", "),
    })
}
