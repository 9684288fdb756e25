//! Guards that end a step or a run before damage, and the drift watch on repeats.

use crate::SessionError;
use crate::recording::identification_config::declared;
use mapper_campaign::Campaign;
use mapper_core::{GuardName, RigDescription};
use mapper_recording::ChannelMap;
use mapper_runner::{
    BatchWatch, DriftWatch, FirstLook, Guard, ReadChannel, ReaderWatch, RigWatch, SignalWatch, StepSource,
    SurgeWatch,
};

/// Guards for a run of this campaign on this rig. A default guard is omitted if the rig does not deliver its signal. Declared or required guards
/// are always included and trip without their signal.
pub fn guards(campaign: &Campaign, rig: &RigDescription, read: &[ReadChannel]) -> Vec<Box<dyn Guard>> {
    let set = campaign.guard_set();
    let mut guards: Vec<Box<dyn Guard>> = vec![Box::new(BatchWatch::default())];
    for spec in set.signals {
        let wanted = campaign.guards.is_some() || rig.needs_guarded.contains(&spec.name);
        if wanted || rig.channels.contains(&spec.channel) {
            guards.push(Box::new(SignalWatch::new(spec)));
        }
    }
    guards.extend(set.surge.map(|spec| Box::new(SurgeWatch::new(spec)) as Box<dyn Guard>));
    if !read.is_empty() {
        guards.push(Box::new(ReaderWatch::new(read.to_vec())));
    }
    if rig.controls {
        guards.push(Box::new(RigWatch::default()));
        guards.push(Box::new(FirstLook::new(rig.channels.clone())));
    }
    guards
}

/// Checks that every guard the rig requires is present, and that its channel is delivered.
///
/// # Errors
/// [`SessionError::Unguarded`] with all missing guards, [`SessionError::GuardBlind`] with the channels.
pub fn check_guards(campaign: &Campaign, rig: &RigDescription) -> Result<(), SessionError> {
    let set = campaign.guard_set();
    let missing: Vec<GuardName> =
        rig.needs_guarded.iter().copied().filter(|name| !set.ends_on(*name)).collect();
    if !missing.is_empty() {
        let names = missing.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        return Err(SessionError::Unguarded { backend: rig.backend.clone(), guards: names });
    }
    let wanted = |name: &GuardName| campaign.guards.is_some() || rig.needs_guarded.contains(name);
    let blind = set.signals.iter().filter(|spec| wanted(&spec.name) && !rig.channels.contains(&spec.channel));
    let blind: Vec<String> = blind.map(|spec| format!("{} (guard `{}`)", spec.channel, spec.name)).collect();
    match blind.is_empty() {
        true => Ok(()),
        false => Err(SessionError::GuardBlind { backend: rig.backend.clone(), channels: blind.join(", ") }),
    }
}

/// Watches the repeats of a run if the campaign defines a reaction to drift; otherwise returns the steps.
///
/// # Errors
/// The steps themselves, if no watch was requested; this is not a fault.
pub fn drift_watch<'a>(
    campaign: &Campaign,
    steps: &'a mut dyn StepSource,
) -> Result<DriftWatch<'a>, &'a mut dyn StepSource> {
    match campaign.on_drift {
        Some(on_drift) => Ok(DriftWatch::new(steps, on_drift, declared(campaign, &ChannelMap::native()))),
        None => Err(steps),
    }
}
