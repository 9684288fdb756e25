//! Several sensors of a channel become one reading before anything is made of a recording: one way for all commands.

use crate::recorded::Recorded;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Recording, RedundantSensors};
use mapper_identify::IdentifyConfig;
use mapper_observe::fuse::{alike, element_count};
use mapper_observe::{FusedChannel, fuse, judge_elements};
use mapper_record::ChannelMap;
use std::collections::BTreeMap;

/// Recordings with one reading of each channel, and what is declared of it.
pub(crate) struct Fused {
    pub(crate) recordings: Vec<Recording>,
    pub(crate) config: IdentifyConfig,
    /// What became of the sensors, by recording; empty where every channel has one.
    pub(crate) channels: Vec<Vec<FusedChannel>>,
}

/// Fuses the sensors of recordings that are compared with each other: what is left out of one is left out of all.
pub(crate) fn fused(
    recordings: Vec<Recording>,
    config: IdentifyConfig,
    campaign: Option<&Campaign>,
    map: &ChannelMap,
) -> Fused {
    let Some(first) = recordings.first().filter(|first| !first.elements.is_empty()) else {
        let channels = vec![Vec::new(); recordings.len()];
        return Fused { recordings, config, channels };
    };
    let declared = declared(first, campaign, map);
    let colour = config.noise_colour;
    let judged = recordings.iter().map(|recording| judge_elements(recording, &declared, colour)).collect();
    let channels = alike(judged, &declared);
    let recordings = recordings
        .into_iter()
        .zip(&channels)
        .map(|(recording, fused)| fuse(recording, &declared, fused))
        .collect();
    let mut config = config;
    for fused in channels.iter().flatten() {
        take_over(&mut config, fused, campaign);
    }
    Fused { recordings, config, channels }
}

/// The recordings of several runs as they are on file.
pub(crate) fn recordings(recorded: &[Recorded]) -> Vec<Recording> {
    recorded.iter().map(|recorded| recorded.read.recording.clone()).collect()
}

/// Puts the uncertainty of a fused channel into the configuration; of several recordings the widest counts.
fn take_over(config: &mut IdentifyConfig, fused: &FusedChannel, campaign: Option<&Campaign>) {
    let DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio } = fused.declared;
    if noise_sigma > 0.0 || offset_sigma > 0.0 || gain_sigma_ratio > 0.0 {
        let entry = config.declared.entry(fused.channel).or_default();
        // A gain that nobody declares for a sensor is that of the tolerances, which is in the configuration already.
        let gain_sigma_ratio = if gain_sigma_ratio > 0.0 { gain_sigma_ratio } else { entry.gain_sigma_ratio };
        *entry = DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio };
    }
    let probes = campaign.and_then(|campaign| campaign.sensors.get(&fused.channel)?.redundant.as_ref());
    if fused.channel == Channel::T2 && probes.is_some() {
        config.probe_diameter_m = fused.probe_diameter_m;
    }
}

/// What is declared of each sensor of the channels that have several. The channel map speaks of the sensors of this very
/// recording; the campaign counts where it has as many. What is said of a channel with one sensor holds for each of several.
fn declared(
    recording: &Recording,
    campaign: Option<&Campaign>,
    map: &ChannelMap,
) -> BTreeMap<Channel, RedundantSensors> {
    let channels = recording.elements.keys().map(|element| element.channel);
    let of = |channel: Channel| {
        let count = element_count(recording, channel);
        let as_many = |declared: &&RedundantSensors| declared.elements.len() == count;
        let sensor = campaign.and_then(|campaign| campaign.sensors.get(&channel));
        let each = map.sensors.get(&channel).copied().or(sensor.map(|sensor| sensor.declared));
        let said = map.redundant.get(&channel).filter(as_many);
        let said = said.or_else(|| {
            sensor?.redundant.as_ref().filter(as_many).filter(|_| !map.sensors.contains_key(&channel))
        });
        said.cloned().unwrap_or_else(|| RedundantSensors::alike(channel, count, each.unwrap_or_default()))
    };
    channels.map(|channel| (channel, of(channel))).collect()
}
