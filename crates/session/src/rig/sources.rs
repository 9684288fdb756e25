//! The data sources of a campaign: the rig and auxiliary instruments.

use crate::rig::drive::max_age_s;
use crate::{Registry, SessionError};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::ReaderChoice;
use mapper_core::{Backend, BackendError, Channel, RigDescription};
use mapper_physics::simulation::model::Model;
use mapper_runner::{AuxiliaryInstrument, RigWithInstruments, UnguardedChannel};
use std::time::Duration;

/// Connection timeout of an auxiliary instrument, equal to that of a rig.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(11);

#[derive(Debug, thiserror::Error)]
enum ReaderProblem {
    #[error(
        "{0} accepts setpoints, but an auxiliary instrument is only read; make it the `backend`, or name a driver that only reads"
    )]
    Controls(String),
    #[error("it does not deliver {channel}; its channels are {delivers}")]
    MissingChannel { channel: Channel, delivers: String },
    #[error(
        "{channel} also comes from {other}; list the channels to use from this instrument under `channels`"
    )]
    DuplicateChannel { channel: Channel, other: String },
}

/// Name of the auxiliary instrument that provides a channel; `None` for the rig.
type Provider = Option<String>;

/// The rig with its auxiliary instruments, and their channels for the guards.
pub struct Sources {
    /// All sources combined into one backend.
    pub backend: Box<dyn Backend>,
    /// Every channel of an auxiliary instrument.
    pub auxiliary_channels: Vec<UnguardedChannel>,
    /// Names of instruments that only one run may use at a time.
    pub exclusive: Vec<String>,
}

impl Registry {
    /// The rig of a campaign with all auxiliary instruments, not yet connected.
    pub fn make_sources(&self, campaign: &Campaign, model: &Model) -> Result<Sources, SessionError> {
        let rig = self.make_backend(campaign, model)?;
        if campaign.readers.is_empty() {
            return Ok(Sources { backend: rig, auxiliary_channels: Vec::new(), exclusive: Vec::new() });
        }
        let rig_description = rig.describe();
        let mut providers: Vec<(Channel, Provider)> =
            rig_description.channels.iter().map(|channel| (*channel, None)).collect();
        let (mut readers, mut auxiliary_channels, mut exclusive) = (Vec::new(), Vec::new(), Vec::new());
        for choice in &campaign.readers {
            let at = format!("readers.{}.backend.{}", choice.name, choice.backend.name);
            let wrong = |error| match error {
                BackendError::Settings { path, source, .. } => {
                    SessionError::Reader { at: at.clone(), setting: path, source }
                }
                other => {
                    SessionError::Reader { at: at.clone(), setting: String::new(), source: Box::new(other) }
                }
            };
            let backend = self.make_named_backend(&choice.backend, campaign, model).map_err(wrong)?;
            let rig = backend.describe();
            let channels = select_channels(choice, &rig, &mut providers)?;
            let age_s = max_age_s(campaign, &rig);
            let as_read = |channel: &Channel| UnguardedChannel {
                source: choice.name.clone(),
                channel: *channel,
                age_s,
                frozen: None,
            };
            auxiliary_channels.extend(channels.iter().map(as_read));
            exclusive.extend(rig.exclusive);
            readers.push(AuxiliaryInstrument { name: choice.name.clone(), backend, channels });
        }
        let backend =
            RigWithInstruments::new(rig, readers, CONNECT_TIMEOUT).map_err(SessionError::Backend)?;
        Ok(Sources { backend: Box::new(backend), auxiliary_channels, exclusive })
    }
}

fn select_channels(
    choice: &ReaderChoice,
    rig: &RigDescription,
    providers: &mut Vec<(Channel, Provider)>,
) -> Result<Vec<Channel>, SessionError> {
    let below = |key: &str| format!("readers.{}.{key}", choice.name);
    let wrong = |at: String, problem: ReaderProblem| {
        Err(SessionError::Reader { at, setting: String::new(), source: Box::new(problem) })
    };
    if rig.controls {
        return wrong(below("backend"), ReaderProblem::Controls(format!("`{}`", choice.backend.name)));
    }
    let (channels, at) = match &choice.channels {
        Some(listed) => (listed.clone(), below("channels")),
        None => (rig.channels.clone(), below("backend")),
    };
    if let Some(channel) = channels.iter().find(|channel| !rig.channels.contains(channel)) {
        let delivers = rig.channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ");
        return wrong(at, ReaderProblem::MissingChannel { channel: *channel, delivers });
    }
    for channel in &channels {
        let provider = providers.iter().find(|(known, _)| known == channel).map(|(_, provider)| provider);
        // A listed channel replaces the rig's own.
        if let Some(provider) = provider.filter(|other| choice.channels.is_none() || other.is_some()) {
            let other = provider.as_ref().map_or_else(|| "the rig".to_owned(), |name| format!("`{name}`"));
            return wrong(at, ReaderProblem::DuplicateChannel { channel: *channel, other });
        }
    }
    providers.retain(|(channel, _)| !channels.contains(channel));
    providers.extend(channels.iter().map(|channel| (*channel, Some(choice.name.clone()))));
    Ok(channels)
}
