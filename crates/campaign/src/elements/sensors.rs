//! `sensors:`

use crate::checking::Check;
use crate::si::or;
use crate::units::{
    Dimension, Fraction, Length, MassFlow, PressureDifference, Quantity, Speed, TemperatureDifference,
};
use mapper_core::{Channel, DeclaredUncertainty};
use mapper_yaml::FindingKind;
use mapper_yaml::steps;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One sensor as declared; one standard deviation throughout, in the channel's unit (K, Pa, kg/s, rpm).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SensorDeclaration {
    /// Noise, offset left after calibration, gain.
    pub declared: DeclaredUncertainty,
    /// Inner diameter of the pipe at a static tap, m; `None` where the total value is measured.
    pub static_tap_pipe_diameter_m: Option<f64>,
    /// Diameter of the probe's tip, m; 0 is a probe without inertia.
    pub probe_diameter_m: f64,
}

/// Declared uncertainty of each measured channel, by its symbol; one standard deviation throughout.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SensorsFile {
    /// Shaft speed.
    #[serde(rename = "N")]
    n: SpeedSensor,
    /// Compressor mass flow.
    m_c: FlowSensor,
    /// Compressor inlet pressure.
    #[serde(rename = "P1")]
    p1: PressureSensor,
    /// Compressor inlet total temperature.
    #[serde(rename = "T1")]
    t1: TemperatureSensor,
    /// Compressor outlet pressure.
    #[serde(rename = "P2")]
    p2: PressureSensor,
    /// Compressor outlet total temperature.
    #[serde(rename = "T2")]
    t2: ProbeSensor,
    /// Compressor housing temperature.
    #[serde(rename = "Tc")]
    tc: TemperatureSensor,
    /// Turbine mass flow.
    m_t: Option<FlowSensor>,
    /// Turbine inlet pressure.
    #[serde(rename = "P3")]
    p3: Option<PressureSensor>,
    /// Turbine inlet total temperature.
    #[serde(rename = "T3")]
    t3: Option<TemperatureSensor>,
    /// Turbine outlet pressure.
    #[serde(rename = "P4")]
    p4: Option<PressureSensor>,
    /// Turbine outlet total temperature.
    #[serde(rename = "T4")]
    t4: Option<TemperatureSensor>,
    /// Turbine housing temperature.
    #[serde(rename = "Tt")]
    tt: Option<TemperatureSensor>,
    /// Oil inlet temperature.
    #[serde(rename = "T_oil")]
    t_oil: Option<TemperatureSensor>,
    /// Ambient temperature.
    #[serde(rename = "T_amb")]
    t_amb: Option<TemperatureSensor>,
}

impl SensorsFile {
    /// Diameter of the T2 probe's tip, m.
    pub(crate) fn probe_diameter_m(&self) -> f64 {
        or(self.t2.probe_diameter, 0.0)
    }

    /// What is declared of each channel that has a sensor.
    pub(crate) fn declarations(&self) -> BTreeMap<Channel, SensorDeclaration> {
        let all = [
            (Channel::ShaftSpeed, Some(self.n.declaration())),
            (Channel::CompressorFlow, Some(self.m_c.declaration())),
            (Channel::P1, Some(self.p1.declaration())),
            (Channel::T1, Some(self.t1.declaration())),
            (Channel::P2, Some(self.p2.declaration())),
            (Channel::T2, Some(self.t2.declaration())),
            (Channel::Tc, Some(self.tc.declaration())),
            (Channel::TurbineFlow, self.m_t.as_ref().map(FlowSensor::declaration)),
            (Channel::P3, self.p3.as_ref().map(PressureSensor::declaration)),
            (Channel::T3, self.t3.as_ref().map(TemperatureSensor::declaration)),
            (Channel::P4, self.p4.as_ref().map(PressureSensor::declaration)),
            (Channel::T4, self.t4.as_ref().map(TemperatureSensor::declaration)),
            (Channel::Tt, self.tt.as_ref().map(TemperatureSensor::declaration)),
            (Channel::TOil, self.t_oil.as_ref().map(TemperatureSensor::declaration)),
            (Channel::TAmb, self.t_amb.as_ref().map(TemperatureSensor::declaration)),
        ];
        all.into_iter().filter_map(|(channel, declaration)| Some((channel, declaration?))).collect()
    }
}

fn declaration<D: Dimension>(
    noise: Quantity<D>,
    offset: Option<Quantity<D>>,
    gain: Option<Quantity<Fraction>>,
) -> SensorDeclaration {
    SensorDeclaration {
        declared: DeclaredUncertainty {
            noise_sigma: noise.inside,
            offset_sigma: or(offset, 0.0),
            gain_sigma_ratio: or(gain, 0.0),
        },
        static_tap_pipe_diameter_m: None,
        probe_diameter_m: 0.0,
    }
}

/// Symbols of all channels that have a sensor.
pub(crate) const CALIBRATED: [&str; 15] =
    ["N", "m_c", "P1", "T1", "P2", "T2", "Tc", "m_t", "P3", "T3", "P4", "T4", "Tt", "T_oil", "T_amb"];

/// Speed sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpeedSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 rpm"), example = &"30 rpm")]
    noise: Quantity<Speed>,
    /// Fixed offset left after calibration; 0 if none is given.
    #[schemars(extend("x-min" = "0 rpm"), example = &"0 rpm")]
    offset: Option<Quantity<Speed>>,
    /// Fixed error of the gain; 0 if none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    gain: Option<Quantity<Fraction>>,
}

impl SpeedSensor {
    fn declaration(&self) -> SensorDeclaration {
        declaration(self.noise, self.offset, self.gain)
    }
}

/// Flow meter.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FlowSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 kg/s"))]
    noise: Quantity<MassFlow>,
    /// Fixed offset left after calibration; 0 if none is given.
    #[schemars(extend("x-min" = "0 kg/s"), example = &"0 kg/s")]
    offset: Option<Quantity<MassFlow>>,
    /// Fixed error of the gain; 0 if none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    gain: Option<Quantity<Fraction>>,
}

impl FlowSensor {
    fn declaration(&self) -> SensorDeclaration {
        declaration(self.noise, self.offset, self.gain)
    }
}

/// Pressure sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 Pa"), example = &"20 Pa")]
    noise: Quantity<PressureDifference>,
    /// Fixed offset left after calibration; 0 if none is given.
    #[schemars(extend("x-min" = "0 Pa"))]
    offset: Option<Quantity<PressureDifference>>,
    /// Fixed error of the gain; 0 if none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    gain: Option<Quantity<Fraction>>,
    /// What the tap feels: `total` (the default), or `static`, converted with `pipe_diameter`.
    tap: Option<TapName>,
    /// Inner diameter of the pipe at the tap; needed for a static tap.
    #[schemars(extend("x-above" = "0 mm", "x-max" = "1 m"), example = &"40 mm")]
    pipe_diameter: Option<Quantity<Length>>,
}

impl PressureSensor {
    fn declaration(&self) -> SensorDeclaration {
        let diameter = self.pipe_diameter.map(|diameter| diameter.inside);
        let static_tap_pipe_diameter_m = diameter.filter(|_| self.tap == Some(TapName::Static));
        SensorDeclaration { static_tap_pipe_diameter_m, ..declaration(self.noise, self.offset, self.gain) }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TapName {
    Total,
    Static,
}

/// Temperature sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TemperatureSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 K"), example = &"0.1 K")]
    noise: Quantity<TemperatureDifference>,
    /// Fixed offset left after calibration; 0 if none is given.
    #[schemars(extend("x-min" = "0 K"))]
    offset: Option<Quantity<TemperatureDifference>>,
    /// Fixed error of the gain; 0 if none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    gain: Option<Quantity<Fraction>>,
}

impl TemperatureSensor {
    fn declaration(&self) -> SensorDeclaration {
        declaration(self.noise, self.offset, self.gain)
    }
}

/// Temperature probe with its own inertia.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 K"), example = &"0.1 K")]
    noise: Quantity<TemperatureDifference>,
    /// Fixed offset left after calibration; 0 if none is given.
    #[schemars(extend("x-min" = "0 K"))]
    offset: Option<Quantity<TemperatureDifference>>,
    /// Fixed error of the gain; 0 if none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    gain: Option<Quantity<Fraction>>,
    /// Diameter of the probe's tip; 0 mm, the default, is a probe without inertia.
    #[schemars(extend("x-min" = "0 mm", "x-max" = "20 mm"), example = &"1.5 mm")]
    probe_diameter: Option<Quantity<Length>>,
}

impl ProbeSensor {
    fn declaration(&self) -> SensorDeclaration {
        SensorDeclaration {
            probe_diameter_m: or(self.probe_diameter, 0.0),
            ..declaration(self.noise, self.offset, self.gain)
        }
    }
}

/// A static tap knows the pipe it sits in.
pub(crate) fn check(check: &mut Check<'_>) {
    for symbol in ["P1", "P2", "P3", "P4"] {
        let tap = steps!["sensors", symbol, "tap"];
        let has_diameter = check.get(&steps!["sensors", symbol, "pipe_diameter"]).is_some();
        if check.text(&tap) == Some("static") && !has_diameter {
            let message =
                "a static tap needs the pipe's inner diameter to become a total pressure".to_owned();
            check.note(FindingKind::MissingKey, &tap, message, "add e.g. `pipe_diameter: 40 mm`");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_static_tap_keeps_its_pipe_and_a_total_one_has_none() {
        for (tap, diameter_m) in [("static", Some(0.04)), ("total", None)] {
            let text = format!("{{noise: 20 Pa, tap: {tap}, pipe_diameter: 40 mm}}");
            let sensor: PressureSensor = crate::testing::any(&text).unwrap();
            assert_eq!(sensor.declaration().static_tap_pipe_diameter_m, diameter_m, "{tap}");
        }
    }

    #[test]
    fn the_symbols_are_those_of_the_channels_with_a_key() {
        let schema = serde_json::to_value(schemars::schema_for!(SensorsFile)).unwrap();
        let keys: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
        assert_eq!(keys.len(), CALIBRATED.len());
        for symbol in CALIBRATED {
            assert!(keys.iter().any(|key| *key == symbol), "{symbol}");
            serde_json::from_value::<Channel>(symbol.into()).unwrap();
        }
    }
}
