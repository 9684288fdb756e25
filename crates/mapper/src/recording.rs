//! Recordings: of runs, and of other programs.

use crate::campaign::Campaign;
use crate::error::Error;
use crate::plugins::plugins;
use mapper_core::{Channel, Event, Series, StepMarker};
use mapper_recording::{ChannelMap, ChannelMapError};
use mapper_session::{Recorded, Registry, SessionError, channel_map};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Samples, steps and events of a rig in SI units, with the channel map that they were read by. Cheap to clone.
#[derive(Clone)]
pub struct Recording {
    pub(crate) contents: Arc<Contents>,
    pub(crate) plugins: Arc<Registry>,
}

pub(crate) struct Contents {
    path: PathBuf,
    pub(crate) channels: ChannelMap,
    /// A resumed run has several parts.
    parts: Vec<Recorded>,
}

impl Recording {
    /// Reads a run's directory or a recording of this program (MCAP).
    ///
    /// # Errors
    /// If it cannot be read, or the campaign in it has mistakes.
    pub fn open(path: impl AsRef<Path>) -> Result<Recording, Error> {
        Recording::read(path.as_ref(), ChannelMap::native(), None, plugins())
    }

    /// Reads a log of another program (CSV, Excel, MDF 4 and others): `channels` is the file that says which column is which channel.
    ///
    /// # Errors
    /// If log or channel map cannot be read, or the channel map has mistakes.
    pub fn open_log(path: impl AsRef<Path>, channels: impl AsRef<Path>) -> Result<Recording, Error> {
        Recording::read(path.as_ref(), channel_map(channels.as_ref())?, None, plugins())
    }

    /// Reads either with everything given: the channel map, the campaign in place of the recording's own, the plug-ins.
    ///
    /// # Errors
    /// As [`Recording::open_log`].
    pub fn read(
        path: &Path,
        channels: ChannelMap,
        campaign: Option<&Campaign>,
        plugins: Registry,
    ) -> Result<Recording, Error> {
        let parts = Recorded::read_run(&plugins, path, &channels, campaign.map(Campaign::settings))?;
        Ok(Recording {
            contents: Arc::new(Contents { path: path.to_owned(), channels, parts }),
            plugins: Arc::new(plugins),
        })
    }

    /// Reads a log from memory with the text of its channel map. `name`: its name in messages.
    ///
    /// # Errors
    /// As [`Recording::open_log`].
    pub fn from_bytes(
        content: &[u8],
        name: &str,
        channels_yaml: &str,
        plugins: Registry,
    ) -> Result<Recording, Error> {
        let channels = ChannelMap::from_yaml(channels_yaml, Path::new("channels.yaml"))
            .map_err(|findings| SessionError::from(ChannelMapError::Mistakes(Box::new(findings))))?;
        let path = PathBuf::from(name);
        let parts = vec![Recorded::read_bytes(&plugins, content, &path, &channels, None)?];
        Ok(Recording { contents: Arc::new(Contents { path, channels, parts }), plugins: Arc::new(plugins) })
    }

    /// What was read from each file: a resumed run has several.
    pub fn parts(&self) -> &[Recorded] {
        &self.contents.parts
    }

    /// Settings of the campaign in the recording; `None` for a log.
    pub fn campaign(&self) -> Option<&mapper_campaign::Campaign> {
        self.parts().first().and_then(|first| first.campaign.as_ref())
    }

    /// Samples of a channel; those of the first part.
    pub fn series(&self, channel: Channel) -> Option<&Series> {
        self.parts().first().and_then(|first| first.read.recording.series.get(&channel))
    }

    /// Steps of all parts.
    pub fn steps(&self) -> impl Iterator<Item = &StepMarker> {
        self.parts().iter().flat_map(|part| &part.read.recording.steps)
    }

    /// Events of all parts.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.parts().iter().flat_map(|part| &part.read.recording.events)
    }

    /// Problems of the files that did not prevent reading them.
    pub fn warnings(&self) -> Vec<String> {
        self.parts().iter().flat_map(|part| &part.read.warnings).map(ToString::to_string).collect()
    }

    pub(crate) fn described_by(&self, campaign: Option<&Campaign>) -> Result<Vec<Recorded>, SessionError> {
        let given = campaign.map(Campaign::settings);
        // Which steps of a resumed run count depends on the campaign.
        if given.is_some() && self.parts().len() > 1 {
            return Recorded::read_run(&self.plugins, &self.contents.path, &self.contents.channels, given);
        }
        let described = |part: &Recorded| Recorded {
            campaign: given.or(part.campaign.as_ref()).cloned(),
            ..part.clone()
        };
        Ok(self.parts().iter().map(described).collect())
    }

    pub(crate) fn only_part(&self, campaign: &Campaign) -> Result<Recorded, SessionError> {
        let mut parts = self.described_by(Some(campaign))?;
        match parts.len() {
            1 => Ok(parts.remove(0)),
            0 => Err(SessionError::NoRecording),
            _ => Err(SessionError::SeveralRecordings(self.contents.path.clone())),
        }
    }
}
