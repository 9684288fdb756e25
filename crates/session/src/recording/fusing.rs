//! Fuses several sensors of a channel into one reading, and uses the measured humidity. All commands use the same procedure.

use crate::recording::recording_file::Recorded;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Recording, RedundantSensors};
use mapper_identify::{IdentifyConfig, PressureTap, with_measured_humidity};
use mapper_observe::declared::{StaticTap, with_total_pressures};
use mapper_observe::fuse::{element_count, harmonise};
use mapper_observe::{FusedChannel, fuse, judge_elements};
use mapper_physics::simulation::model::Model;
use mapper_recording::ChannelMap;
use std::collections::BTreeMap;

/// Recordings with one reading per channel, the declared uncertainty of that reading, and the humidity of the first.
pub(crate) struct FusedRecordings {
    pub(crate) recordings: Vec<Recording>,
    pub(crate) config: IdentifyConfig,
    /// Fusion result by recording; empty if every channel has one sensor.
    pub(crate) channels: Vec<Vec<FusedChannel>>,
}

/// Fuses the sensors of recordings that are compared with each other. A sensor excluded from one is excluded from all.
pub(crate) fn fuse_sensors(
    recordings: Vec<Recording>,
    config: IdentifyConfig,
    campaign: Option<&Campaign>,
    map: &ChannelMap,
) -> FusedRecordings {
    let Some(first) = recordings.first().filter(|first| !first.elements.is_empty()) else {
        let channels = vec![Vec::new(); recordings.len()];
        return FusedRecordings { config: of_first(&recordings, config), recordings, channels };
    };
    let declared = declared(first, campaign, map);
    let colour = config.noise_colour;
    let judged = recordings.iter().map(|recording| judge_elements(recording, &declared, colour)).collect();
    let channels = harmonise(judged, &declared);
    let recordings: Vec<Recording> = recordings
        .into_iter()
        .zip(&channels)
        .map(|(recording, fused)| fuse(recording, &declared, fused))
        .collect();
    let mut config = config;
    for fused in channels.iter().flatten() {
        copy_uncertainty(&mut config, fused, campaign);
    }
    FusedRecordings { config: of_first(&recordings, config), recordings, channels }
}

fn of_first(recordings: &[Recording], config: IdentifyConfig) -> IdentifyConfig {
    recordings.first().map_or(config.clone(), |first| with_measured_humidity(first, &config))
}

impl FusedRecordings {
    /// The same with total pressures in place of those at static taps, for a comparison with a model.
    #[must_use]
    pub(crate) fn with_total_pressures(mut self, campaign: &Campaign) -> Self {
        let taps: Vec<StaticTap> = campaign
            .sensors
            .iter()
            .filter_map(|(&pressure, sensor)| {
                let pipe_diameter_m = sensor.static_tap_pipe_diameter_m?;
                Some(StaticTap { pressure, pipe_diameter_m })
            })
            .collect();
        let recordings = self.recordings.into_iter();
        self.recordings = recordings.map(|recording| with_total_pressures(recording, &taps)).collect();
        (self.config.inlet_tap, self.config.outlet_tap) = (PressureTap::Total, PressureTap::Total);
        self
    }
}

pub(crate) fn take_air_and_probe(model: &mut Model, config: &IdentifyConfig) {
    model.params.t2_probe_diameter_m = config.probe_diameter_m;
    model.params.compressor.humidity_kg_kg = config.air.humidity_kg_kg();
}

pub(crate) fn recordings(recorded: &[Recorded]) -> Vec<Recording> {
    recorded.iter().map(|recorded| recorded.read.recording.clone()).collect()
}

/// Copies the uncertainty of a fused channel into the configuration. For several recordings the largest applies.
fn copy_uncertainty(config: &mut IdentifyConfig, fused: &FusedChannel, campaign: Option<&Campaign>) {
    let DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio } = fused.declared;
    if noise_sigma > 0.0 || offset_sigma > 0.0 || gain_sigma_ratio > 0.0 {
        let entry = config.declared.entry(fused.channel).or_default();
        // If no gain is declared for a sensor, the gain tolerance already in the configuration applies.
        let gain_sigma_ratio = if gain_sigma_ratio > 0.0 { gain_sigma_ratio } else { entry.gain_sigma_ratio };
        *entry = DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio };
    }
    let probes = campaign.and_then(|campaign| campaign.sensors.get(&fused.channel)?.redundant.as_ref());
    if fused.channel == Channel::T2 && probes.is_some() {
        config.probe_diameter_m = fused.probe_diameter_m;
    }
}

/// Declared uncertainty of each of several sensors: by the channel map, else by a campaign with as many; one for the channel holds for all.
fn declared(
    recording: &Recording,
    campaign: Option<&Campaign>,
    map: &ChannelMap,
) -> BTreeMap<Channel, RedundantSensors> {
    let channels = recording.elements.keys().map(|element| element.channel);
    let sensors_of = |channel: Channel| {
        let count = element_count(recording, channel);
        let as_many = |declared: &&RedundantSensors| declared.elements.len() == count;
        let sensor = campaign.and_then(|campaign| campaign.sensors.get(&channel));
        let channel_declaration = map.sensors.get(&channel).copied().or(sensor.map(|sensor| sensor.declared));
        let stated = map.redundant.get(&channel).filter(as_many);
        let stated = stated.or_else(|| {
            sensor?.redundant.as_ref().filter(as_many).filter(|_| !map.sensors.contains_key(&channel))
        });
        stated.cloned().unwrap_or_else(|| {
            RedundantSensors::alike(channel, count, channel_declaration.unwrap_or_default())
        })
    };
    channels.map(|channel| (channel, sensors_of(channel))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, Series};

    /// 75 % at 25 degC and 100 kPa are 15.21 g/kg (CoolProp 8, HAPropsSI). The model of a diagnosis takes in that air.
    #[test]
    fn a_hygrometer_gives_the_air_of_the_model() {
        let readings = [(Channel::RelativeHumidity, 0.75), (Channel::T1, 298.15), (Channel::P1, 100e3)];
        let steady = |(channel, value)| (channel, Series { t_s: vec![0.0, 1.0], values: vec![value; 2] });
        let recording = Recording { series: readings.map(steady).into(), ..Recording::default() };
        let FusedRecordings { config, .. } =
            fuse_sensors(vec![recording], IdentifyConfig::default(), None, &ChannelMap::native());
        let mut model = Model::nominal();
        take_air_and_probe(&mut model, &config);
        assert!((model.params.compressor.humidity_kg_kg / 0.015_21 - 1.0).abs() < 5e-3);
    }
}
