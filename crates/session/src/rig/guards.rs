//! Guards that end a step or a run before damage.

use crate::SessionError;
use mapper_campaign::Campaign;
use mapper_core::{GuardName, RigDescription};
use mapper_runner::{
    BatchWatch, Guard, InstrumentChannel, InstrumentWatch, RigWatch, SignalWatch, StartCheck, SurgeWatch,
};

/// Makes the guards for a run of this campaign on this rig. A default guard is omitted if the rig does not deliver its signal. Declared and
/// required guards are always included; they trip if their signal is missing.
pub fn make_guards(
    campaign: &Campaign,
    rig: &RigDescription,
    instruments: &[InstrumentChannel],
) -> Vec<Box<dyn Guard>> {
    let set = campaign.guard_set();
    let mut guards: Vec<Box<dyn Guard>> = vec![Box::new(BatchWatch::default())];
    for spec in set.signals {
        let required = campaign.guards.is_some() || rig.needs_guarded.contains(&spec.name);
        if required || rig.channels.contains(&spec.channel) {
            guards.push(Box::new(SignalWatch::new(spec)));
        }
    }
    guards.extend(set.surge.map(|spec| Box::new(SurgeWatch::new(spec)) as Box<dyn Guard>));
    if !instruments.is_empty() {
        guards.push(Box::new(InstrumentWatch::new(instruments.to_vec())));
    }
    if rig.controls {
        guards.push(Box::new(RigWatch::default()));
        guards.push(Box::new(StartCheck::new(rig.channels.clone())));
    }
    guards
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
