//! `rig:`, the motion of the stand's actuators.

use crate::units::{Duration, Fraction, PressureRate, Quantity, RatioRate, TemperatureRate};
use mapper_core::{ActuatorMotion, Limits, RigActuators};
use schemars::JsonSchema;
use serde::Deserialize;

/// The gas stand: how fast its actuators follow their commands.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigFile {
    /// Motion of the actuators, as `mapper plan` forecasts each jump and `mapper run` commands it: a kind of stand (`fast_valve`, the default, `blow_down` or `screw_compressor`), or its values.
    #[schemars(example = &"screw_compressor")]
    actuators: Option<ActuatorsFile>,
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum ActuatorsFile {
    Named(KindOfStand),
    Settings(ActuatorSettingsFile),
}

/// Kinds of gas stands by their supply of air.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum KindOfStand {
    #[default]
    FastValve,
    BlowDown,
    ScrewCompressor,
}

/// Motion of the actuators; values that are not given are those of the kind.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ActuatorSettingsFile {
    /// Kind of stand whose values apply where none are given: `fast_valve`, the default, `blow_down` or `screw_compressor`.
    #[schemars(example = &"blow_down")]
    like: Option<KindOfStand>,
    /// Turbine inlet pressure, P3.
    turbine_inlet_pressure: Option<PressureActuatorFile>,
    /// Back-pressure valve.
    valve: Option<ValveActuatorFile>,
    /// Turbine inlet temperature, T3.
    turbine_inlet_temperature: Option<TemperatureActuatorFile>,
}

/// Motion of the turbine inlet pressure behind its command.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureActuatorFile {
    /// Time constant of its lag.
    #[schemars(extend("x-min" = "0 s", "x-max" = "10 min"), example = &"3 s")]
    lag: Option<Quantity<Duration>>,
    /// Highest rate of change. `limits.turbine_inlet_pressure.stroke` sets it too.
    #[schemars(extend("x-min" = "0.1 kPa/s", "x-max" = "10000 kPa/s"), example = &"20 kPa/s")]
    rate: Option<Quantity<PressureRate>>,
    /// Time before it begins to move.
    #[schemars(extend("x-min" = "0 s", "x-max" = "1 min"), example = &"1 s")]
    dead_time: Option<Quantity<Duration>>,
}

/// Motion of the back-pressure valve behind its command.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ValveActuatorFile {
    /// Time constant of its lag.
    #[schemars(extend("x-min" = "0 s", "x-max" = "10 min"), example = &"0.5 s")]
    lag: Option<Quantity<Duration>>,
    /// Highest rate of the opening relative to its nominal area.
    #[schemars(extend("x-min" = "0.001 1/s", "x-max" = "1000 1/s"), example = &"0.5 1/s")]
    rate: Option<Quantity<RatioRate>>,
    /// Play of its drive: the opening by which a reversing command moves before the valve follows.
    #[schemars(extend("x-min" = "0 %", "x-max" = "20 %"), example = &"2 %")]
    play: Option<Quantity<Fraction>>,
    /// Change of the commanded opening below which the positioner does not move.
    #[schemars(extend("x-min" = "0 %", "x-max" = "20 %"), example = &"0.5 %")]
    dead_band: Option<Quantity<Fraction>>,
}

/// Motion of the turbine inlet temperature behind its command.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TemperatureActuatorFile {
    /// Time constant of its lag.
    #[schemars(extend("x-min" = "0 s", "x-max" = "1 h"), example = &"20 s")]
    lag: Option<Quantity<Duration>>,
    /// Highest rate of change.
    #[schemars(extend("x-min" = "0.01 K/s", "x-max" = "1000 K/s"), example = &"10 K/s")]
    rate: Option<Quantity<TemperatureRate>>,
}

impl KindOfStand {
    fn actuators(self) -> RigActuators {
        match self {
            KindOfStand::FastValve => RigActuators::FAST_VALVE,
            KindOfStand::BlowDown => RigActuators::BLOW_DOWN,
            KindOfStand::ScrewCompressor => RigActuators::SCREW_COMPRESSOR,
        }
    }
}

impl RigFile {
    /// The actuators of the stand. A rate of P3 that the file does not give is that of its stroke.
    pub(crate) fn actuators(self, limits: &Limits) -> RigActuators {
        let file = match self.actuators {
            None => ActuatorSettingsFile::default(),
            Some(ActuatorsFile::Named(kind)) => {
                ActuatorSettingsFile { like: Some(kind), ..ActuatorSettingsFile::default() }
            }
            Some(ActuatorsFile::Settings(settings)) => settings,
        };
        let mut actuators = file.like.unwrap_or_default().actuators();
        if let Some(slew_pa_s) = limits.p3_slew_max_pa_s() {
            actuators.p3.rate_per_s = slew_pa_s;
        }
        if let Some(p3) = file.turbine_inlet_pressure {
            set_motion(&mut actuators.p3, p3.lag, p3.rate.map(|rate| rate.value), p3.dead_time);
        }
        if let Some(valve) = file.valve {
            set_motion(&mut actuators.valve, valve.lag, valve.rate.map(|rate| rate.value), None);
            set_ratio(&mut actuators.valve_play_ratio, valve.play);
            set_ratio(&mut actuators.valve_dead_band_ratio, valve.dead_band);
        }
        if let Some(t3) = file.turbine_inlet_temperature {
            set_motion(&mut actuators.t3, t3.lag, t3.rate.map(|rate| rate.value), None);
        }
        actuators
    }
}

fn set_motion(
    motion: &mut ActuatorMotion,
    lag: Option<Quantity<Duration>>,
    rate_per_s: Option<f64>,
    dead_time: Option<Quantity<Duration>>,
) {
    motion.lag_s = lag.map_or(motion.lag_s, |lag| lag.value);
    motion.rate_per_s = rate_per_s.unwrap_or(motion.rate_per_s);
    motion.dead_time_s = dead_time.map_or(motion.dead_time_s, |dead_time| dead_time.value);
}

fn set_ratio(ratio: &mut f64, given: Option<Quantity<Fraction>>) {
    *ratio = given.map_or(*ratio, |given| given.value);
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed_max_rpm: 180e3,
        p3_min_pa: 100e3,
        p3_max_pa: 400e3,
        p3_stroke_s: None,
        t3_max_k: None,
        t2_max_k: None,
        surge_margin_min_ratio: None,
        housing_gradient_max_k: None,
        overshoot_max_ratio: None,
        avoid: mapper_core::AvoidedSpeeds::NONE,
    };

    fn read(text: &str, limits: &Limits) -> RigActuators {
        crate::testing::any::<RigFile>(text).unwrap().actuators(limits)
    }

    #[test]
    fn every_key_lands_in_its_own_field() {
        let text = "{actuators: {turbine_inlet_pressure: {lag: 3 s, rate: 20 kPa/s, dead_time: 1 s}, \
                    valve: {lag: 0.4 s, rate: 0.2 1/s, play: 2 %, dead_band: 0.5 %}, turbine_inlet_temperature: {lag: 7 s, rate: 4 K/s}}}";
        let expected = RigActuators {
            p3: ActuatorMotion { lag_s: 3.0, rate_per_s: 20e3, dead_time_s: 1.0 },
            valve: ActuatorMotion { lag_s: 0.4, rate_per_s: 0.2, dead_time_s: 0.0 },
            valve_play_ratio: 0.02,
            valve_dead_band_ratio: 0.005,
            t3: ActuatorMotion { lag_s: 7.0, rate_per_s: 4.0, dead_time_s: 0.0 },
        };
        assert_eq!(read(text, &LIMITS), expected);
    }

    #[test]
    fn a_kind_gives_what_the_file_leaves_out_and_a_stroke_the_rate() {
        assert_eq!(read("{}", &LIMITS), RigActuators::FAST_VALVE);
        assert_eq!(read("{actuators: screw_compressor}", &LIMITS), RigActuators::SCREW_COMPRESSOR);
        let mixed = read("{actuators: {like: blow_down, valve: {lag: 3 s}}}", &LIMITS);
        assert_eq!((mixed.p3, mixed.valve.lag_s), (RigActuators::BLOW_DOWN.p3, 3.0));
        let stroke = Limits { p3_stroke_s: Some(60.0), ..LIMITS };
        assert_eq!(read("{}", &stroke).p3.rate_per_s, 5e3, "300 kPa in 60 s");
        let declared = read("{actuators: {turbine_inlet_pressure: {rate: 8 kPa/s}}}", &stroke);
        assert_eq!(declared.p3.rate_per_s, 8e3, "the declared rate takes precedence");
    }
}
