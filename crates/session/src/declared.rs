//! Converts a campaign's declarations into the configuration of identification and diagnosis.

use mapper_campaign::Campaign;
use mapper_core::{ALPHA_AREA_SIGMA_RATIO, Channel, DeclaredUncertainty, Method, ReferenceState, WindowRule};
use mapper_identify::{IdentifyConfig, PressureTap};
use mapper_observe::declared_uncertainties;
use mapper_physics::air::Air;
use mapper_record::{ChannelMap, MachineConstants};
use std::collections::BTreeMap;

/// Identification settings for the recordings of this campaign.
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
        alpha_area_sigma_ratio: chosen.alpha_area_sigma_ratio,
        inlet_convection: campaign.machine.params.compressor.inlet_convection,
        inlet_diameter_m: campaign.machine.params.compressor.inlet_diameter_m,
        outlet_diameter_m: campaign.machine.params.compressor.outlet_diameter_m,
        probe_diameter_m: campaign.machine.params.t2_probe_diameter_m,
        joint: chosen.joint,
        internal_area_m2: campaign.machine.params.compressor.internal_area_m2,
        air: campaign.machine.params.compressor.air(),
        humidity_sigma_kg_kg: campaign.report.humidity_sigma_kg_kg(&campaign.boundary),
        reference: campaign.reference,
        inlet_tap: tap(Channel::P1),
        outlet_tap: tap(Channel::P2),
        declared: declared(campaign, &ChannelMap::native()),
        ..IdentifyConfig::default()
    }
}

/// Declared uncertainty of the sensors in a recording that is read with this channel map.
pub fn declared(campaign: &Campaign, map: &ChannelMap) -> BTreeMap<Channel, DeclaredUncertainty> {
    let sensors = campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    declared_uncertainties(&sensors, &campaign.tolerances, &map.sensors)
}

/// Same as [`identification`], for a recording that is read with this channel map. The map overrides the campaign for sensors, noise and window.
pub fn identification_with(campaign: &Campaign, map: &ChannelMap) -> IdentifyConfig {
    let identification = identification(campaign);
    IdentifyConfig {
        declared: declared(campaign, map),
        noise_colour: map.noise_colour.unwrap_or(identification.noise_colour),
        window: map.window.map_or(identification.window, |window| WindowRule::Fixed {
            start_s: window.start_s,
            end_s: window.end_s,
        }),
        ..identification
    }
}

/// Identification settings for a recording that has a channel map but no campaign. A pipe diameter in the map always means a static tap.
pub(crate) fn identification_of(machine: &MachineConstants, map: &ChannelMap) -> IdentifyConfig {
    let usual = IdentifyConfig::default();
    let tap = |diameter_m: Option<f64>| {
        diameter_m.map_or(PressureTap::Total, |pipe_diameter_m| PressureTap::Static { pipe_diameter_m })
    };
    let (inlet_m, outlet_m) = (machine.compressor_inlet_diameter_m, machine.compressor_outlet_diameter_m);
    IdentifyConfig {
        method: Method::Joint,
        alpha_area_ratio: machine.alpha_area_ratio,
        alpha_area_sigma_ratio: ALPHA_AREA_SIGMA_RATIO,
        internal_area_m2: machine.compressor_internal_area_m2,
        probe_diameter_m: machine.t2_probe_diameter_m,
        inlet_tap: tap(inlet_m),
        outlet_tap: tap(outlet_m),
        inlet_diameter_m: inlet_m.unwrap_or(usual.inlet_diameter_m),
        outlet_diameter_m: outlet_m.unwrap_or(usual.outlet_diameter_m),
        reference: map.reference.unwrap_or(ReferenceState::SAE),
        air: Air::DRY,
        window: map.window.map_or_else(WindowRule::default, |window| WindowRule::Fixed {
            start_s: window.start_s,
            end_s: window.end_s,
        }),
        declared: map.sensors.clone(),
        noise_colour: map.noise_colour.unwrap_or_default(),
        ..usual
    }
}
