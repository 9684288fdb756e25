//! Declared uncertainty of a recording, total pressures included.

use mapper_core::{
    Channel, DeclaredUncertainty, Dimension, ModelTolerances, NoiseColour, Recording, RigActuators,
    StructureTolerances,
};
use mapper_physics::gas::pressure_tap::static_to_total_pa;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::sensor_fault::ExactReadings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Noise of a sample of shaft speed, rpm. Bound: eddy-current counters resolve some tens of rpm.
const USUAL_NOISE_RPM: f64 = 30.0;
/// Noise of a sample of flow, kg/s. Bound: 0.3 % of a usual flow.
const USUAL_NOISE_KG_S: f64 = 1.5e-4;
/// Noise of a sample of pressure, Pa. Bound: 0.02 % of a range of 3 bar.
const USUAL_NOISE_PA: f64 = 60.0;
/// Noise of a sample of temperature, K. Bound: thermocouples in gas have 0.1 to 0.3 K.
const USUAL_NOISE_K: f64 = 0.2;

/// Offset of a thermometer without declaration, K. Source: class 1 of IEC 60584-1, 1.5 K, as the limits of a rectangular distribution.
const USUAL_OFFSET_K: f64 = 0.9;
/// Offset of a pressure sensor without declaration, Pa. Bound: 0.25 % of a range of 4 bar, as the limits of a rectangular distribution.
const USUAL_OFFSET_PA: f64 = 600.0;

/// Merges the declared uncertainties of every sensor of a recording, by a rule common to all programs.
///
/// The most specific declaration applies. `channel_map` describes the sensors of this recording: for a channel declared there, its noise and
/// offset replace those of the campaign's `sensors`. A gain of 0 means that none was declared. The campaign's gain then replaces the channel
/// map's; for a flow meter without either, the tolerances' `flow_meter_gain_ratio` applies.
pub fn declared_uncertainties(
    sensors: &BTreeMap<Channel, DeclaredUncertainty>,
    tolerances: &ModelTolerances,
    channel_map: &BTreeMap<Channel, DeclaredUncertainty>,
) -> BTreeMap<Channel, DeclaredUncertainty> {
    let mut declared = sensors.clone();
    for (channel, mapped) in channel_map {
        let entry = declared.entry(*channel).or_default();
        let gain_sigma_ratio = declared_or(mapped.gain_sigma_ratio, entry.gain_sigma_ratio);
        *entry = DeclaredUncertainty { gain_sigma_ratio, ..*mapped };
    }
    for (channel, entry) in &mut declared {
        if channel.info().dimension == Dimension::MassFlow {
            entry.gain_sigma_ratio = declared_or(entry.gain_sigma_ratio, tolerances.flow_meter_gain_ratio);
        }
    }
    declared
}

fn declared_or(declared: f64, default: f64) -> f64 {
    if declared > 0.0 { declared } else { default }
}

/// Declared uncertainties from all sources.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// Noise, offset and gain of each sensor, as [`declared_uncertainties`] merges them.
    pub sensors: BTreeMap<Channel, DeclaredUncertainty>,
    /// Time correlation of the noise.
    pub noise_colour: NoiseColour,
    /// Tolerances of the model.
    pub tolerances: ModelTolerances,
    /// Nominal boundary conditions for channels that are not recorded.
    pub nominal: BoundaryConditions,
    /// Offsets common to several sensors, in addition to their own.
    pub common_offsets: Vec<CommonOffset>,
    /// Motion of the actuators; `None` if undeclared.
    pub actuators: Option<RigActuators>,
}

/// A common offset of several sensors of one dimension: it remains after an isothermal zero, which only compares them with each other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CommonOffset {
    /// The sensors.
    pub channels: Vec<Channel>,
    /// One standard deviation, K or Pa.
    pub sigma: f64,
    /// Their common reading at rest, K or Pa.
    #[serde(default)]
    pub reading: f64,
}

/// Readings of the isothermal zero, from which gain errors count.
pub fn rest(common: &[CommonOffset]) -> ExactReadings {
    let of = |channel| common.iter().find(|common| common.channels.contains(&channel));
    let (pressure, temperature) = (of(Channel::P1), of(Channel::T2));
    let without = ExactReadings::default();
    ExactReadings {
        pressure_pa: pressure.map_or(without.pressure_pa, |common| common.reading),
        temperature_k: temperature.map_or(without.temperature_k, |common| common.reading),
    }
}

impl Declared {
    /// The declaration of a channel; zero if there is none.
    pub fn of(&self, channel: Channel) -> DeclaredUncertainty {
        self.sensors.get(&channel).copied().unwrap_or_default()
    }

    /// The same without declared errors of the model's equations: a reference recording measures them.
    #[must_use]
    pub fn with_exact_equations(mut self) -> Self {
        self.tolerances.structure = StructureTolerances::default();
        self
    }

    /// Readings from which gain errors count.
    pub fn rest(&self) -> ExactReadings {
        rest(&self.common_offsets)
    }

    /// Noise of one sample, in the channel's unit: the declared one, otherwise that of a typical sensor.
    pub fn noise_sigma(&self, channel: Channel) -> f64 {
        declared_or(self.of(channel).noise_sigma, usual_noise_sigma(channel))
    }

    /// Remaining fixed offset after calibration, in the channel's unit.
    pub fn offset_sigma(&self, channel: Channel) -> f64 {
        self.of(channel).offset_sigma
    }
}

/// Noise of one sample of a typical sensor of a gas stand, in the channel's unit.
pub fn usual_noise_sigma(channel: Channel) -> f64 {
    match channel.info().dimension {
        Dimension::RotationalSpeed => USUAL_NOISE_RPM,
        Dimension::MassFlow => USUAL_NOISE_KG_S,
        Dimension::Pressure => USUAL_NOISE_PA,
        Dimension::Temperature | Dimension::Ratio => USUAL_NOISE_K,
    }
}

/// Offset of a usual thermometer or pressure sensor of a gas stand, one standard deviation, K or Pa.
pub fn usual_offset_sigma(channel: Channel) -> f64 {
    if channel.info().dimension == Dimension::Pressure { USUAL_OFFSET_PA } else { USUAL_OFFSET_K }
}

/// Errors of a usual sensor of a gas stand, of which nothing is declared.
pub fn usual_sensor(channel: Channel) -> DeclaredUncertainty {
    let noise_sigma = usual_noise_sigma(channel);
    match channel.info().dimension {
        Dimension::MassFlow => DeclaredUncertainty {
            noise_sigma,
            gain_sigma_ratio: ModelTolerances::default().flow_meter_gain_ratio,
            ..DeclaredUncertainty::default()
        },
        _ => DeclaredUncertainty {
            noise_sigma,
            offset_sigma: usual_offset_sigma(channel),
            ..DeclaredUncertainty::default()
        },
    }
}

/// A static tap: the pressure's channel, and the inner diameter of the pipe, m, > 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticTap {
    /// P1, P2 or P3; the outlet of a turbine is defined by its static pressure.
    pub pressure: Channel,
    /// Inner diameter of the pipe at the tap, m.
    pub pipe_diameter_m: f64,
}

impl StaticTap {
    /// Flow and total temperature at the tap; `None` for a channel whose static pressure is the quantity itself.
    fn stream(self) -> Option<(Channel, Channel)> {
        match self.pressure {
            Channel::P1 => Some((Channel::CompressorFlow, Channel::T1)),
            Channel::P2 => Some((Channel::CompressorFlow, Channel::T2)),
            Channel::P3 => Some((Channel::TurbineFlow, Channel::T3)),
            _ => None,
        }
    }
}

/// The recording with total pressures at `taps`. A reading without flow or temperature stays as it is.
pub fn with_total_pressures(mut recording: Recording, taps: &[StaticTap]) -> Recording {
    for tap in taps {
        let Some((flow, temperature)) = tap.stream() else { continue };
        let Recording { series, .. } = &recording;
        let streams = series.get(&tap.pressure).zip(series.get(&flow)).zip(series.get(&temperature));
        let Some(((pressure, flow), temperature)) = streams else { continue };
        let total_pa = |(t_s, static_pa): (&f64, &f64)| {
            let flow_kg_s = flow.interpolate(*t_s);
            let total = flow_kg_s.zip(temperature.interpolate(*t_s)).map(|(flow_kg_s, temperature_k)| {
                static_to_total_pa(*static_pa, flow_kg_s, temperature_k, tap.pipe_diameter_m)
            });
            total.filter(|total_pa| total_pa.is_finite()).unwrap_or(*static_pa)
        };
        let values: Vec<f64> = pressure.t_s.iter().zip(&pressure.values).map(total_pa).collect();
        if let Some(pressure) = recording.series.get_mut(&tap.pressure) {
            pressure.values = values;
        }
    }
    recording
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(noise_sigma: f64, offset_sigma: f64, gain_sigma_ratio: f64) -> DeclaredUncertainty {
        DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio }
    }

    #[test]
    fn the_most_specific_word_counts() {
        let flow = Channel::CompressorFlow;
        let tolerances = ModelTolerances { flow_meter_gain_ratio: 0.005, ..ModelTolerances::default() };
        let merged = |campaign: f64, map: Option<f64>| {
            let campaign = [(flow, sensor(1.0, 2.0, campaign))].into();
            let map = map.map(|gain| (flow, sensor(3.0, 0.0, gain))).into_iter().collect();
            declared_uncertainties(&campaign, &tolerances, &map)[&flow]
        };
        assert_eq!(merged(0.0, None), sensor(1.0, 2.0, 0.005));
        // For a meter calibrated better than the tolerance, the declaration applies.
        assert_eq!(merged(0.002, None), sensor(1.0, 2.0, 0.002));
        assert_eq!(merged(0.002, Some(0.0)), sensor(3.0, 0.0, 0.002));
        assert_eq!(merged(0.002, Some(0.01)), sensor(3.0, 0.0, 0.01));
        assert_eq!(merged(0.0, Some(0.0)), sensor(3.0, 0.0, 0.005));
    }

    #[test]
    fn only_flow_meters_have_the_gain_of_the_tolerances() {
        let sensors =
            [(Channel::P2, sensor(60.0, 100.0, 0.0)), (Channel::TurbineFlow, sensor(1e-4, 0.0, 0.0))];
        let declared = declared_uncertainties(&sensors.into(), &ModelTolerances::default(), &BTreeMap::new());
        assert_eq!(declared[&Channel::P2].gain_sigma_ratio, 0.0);
        assert_eq!(
            declared[&Channel::TurbineFlow].gain_sigma_ratio,
            ModelTolerances::default().flow_meter_gain_ratio
        );
    }
}

#[cfg(test)]
mod total_pressure_tests {
    use super::*;
    use mapper_core::Series;
    use mapper_physics::gas::pressure_tap::total_to_static_pa;

    /// 0.08 kg/s through 40 mm at 298.15 K and 100 kPa: 1.7 kPa of dynamic pressure. A total of 100 kPa is found again; without flow the reading
    /// stays.
    #[test]
    fn a_wall_pressure_becomes_the_total_pressure_of_its_flow() {
        let static_pa = total_to_static_pa(100e3, 0.08, 298.15, 0.04).unwrap();
        assert!((1500.0..2000.0).contains(&(100e3 - static_pa)), "{static_pa}");
        let series = |values: [f64; 2]| Series { t_s: vec![0.0, 1.0], values: values.to_vec() };
        let recording = Recording {
            series: [
                (Channel::P1, series([100e3, static_pa])),
                (Channel::CompressorFlow, series([0.0, 0.08])),
                (Channel::T1, series([298.15; 2])),
            ]
            .into(),
            ..Recording::default()
        };
        let tap = StaticTap { pressure: Channel::P1, pipe_diameter_m: 0.04 };
        let total = with_total_pressures(recording, &[tap]);
        let values = &total.series[&Channel::P1].values;
        assert!(values.iter().all(|total_pa| (total_pa - 100e3).abs() < 1e-3), "{values:?}");
    }
}
