//! What a campaign declares, as identification and diagnosis need it.

use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, WindowRule};
use mapper_identify::{IdentifyConfig, PressureTap};
use mapper_record::ChannelMap;
use std::collections::BTreeMap;

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
pub fn declared(campaign: &Campaign) -> BTreeMap<Channel, DeclaredUncertainty> {
    let mut declared: BTreeMap<Channel, DeclaredUncertainty> =
        campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    if let Some(flow) = declared.get_mut(&Channel::CompressorFlow)
        && flow.gain_sigma_ratio == 0.0
    {
        flow.gain_sigma_ratio = campaign.tolerances.flow_meter_gain_ratio;
    }
    declared
}

/// As [`identification`], with what a channel map says of the sensors of this very recording before it.
pub fn identification_with(campaign: &Campaign, map: &ChannelMap) -> IdentifyConfig {
    let mut identification = identification(campaign);
    for (channel, declared) in &map.sensors {
        let known = identification.declared.get(channel).map_or(0.0, |known| known.gain_sigma_ratio);
        let gain_sigma_ratio = declared.gain_sigma_ratio.max(known);
        identification.declared.insert(*channel, DeclaredUncertainty { gain_sigma_ratio, ..*declared });
    }
    identification.noise_colour = map.noise_colour.unwrap_or(identification.noise_colour);
    if let Some(window) = map.window {
        identification.window = WindowRule::Fixed { start_s: window.start_s, end_s: window.end_s };
    }
    identification
}
