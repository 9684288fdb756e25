//! The motion of a stand's actuators as a commissioning measured it, next to what the campaign declares.

use crate::model_inputs::actuator_fit::{Fitted, FittedMotion, fit_motion, fit_valve};
use mapper_core::unit_factors::PA_PER_KPA;
use mapper_core::{ActuatorMotion, Channel, Recording, RigActuators};
use serde::Serialize;

/// A measured value of an actuator, by its keys in `rig.actuators`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeasuredValue {
    /// The actuator.
    pub actuator: &'static str,
    /// The key.
    pub key: &'static str,
    /// Its unit in campaigns.
    pub unit: &'static str,
    /// What the campaign declares or assumes, in this unit.
    pub declared: f64,
    /// What was measured, in this unit.
    pub measured: Fitted,
}

impl MeasuredValue {
    /// Whether the declared value lies within the measured interval.
    pub fn agrees(&self) -> bool {
        self.measured.contains(self.declared)
    }

    /// The value to declare: the declared one if it agrees, otherwise the measured one, or the lowest possible rate if none limits the motion.
    pub fn to_declare(&self) -> f64 {
        match self.measured {
            _ if self.agrees() => self.declared,
            Fitted { value, low, .. } if value.is_infinite() => low,
            Fitted { value, .. } => value,
        }
    }
}

/// Measures the actuators in the recording of a commissioning; `pipe`: nominal P1, Pa, and volume before the valve, m3. What the recording does not
/// show is left out.
pub fn measure_actuators(
    recording: &Recording,
    declared: &RigActuators,
    pipe: (f64, f64),
) -> Vec<MeasuredValue> {
    let p3 = fit_motion(recording, Channel::P3, Channel::P3Command);
    let t3 = fit_motion(recording, Channel::T3, Channel::T3Command);
    let valve = fit_valve(recording, pipe);
    let mut values = Vec::new();
    if let Some(motion) = &p3 {
        values.extend(lag_and_rate("turbine_inlet_pressure", &declared.p3, motion, ("kPa/s", PA_PER_KPA)));
        values.push(MeasuredValue {
            actuator: "turbine_inlet_pressure",
            key: "dead_time",
            unit: "s",
            declared: declared.p3.dead_time_s,
            measured: motion.dead_time_s,
        });
    }
    if let Some(valve) = &valve {
        values.extend(lag_and_rate("valve", &declared.valve, &valve.motion, ("1/s", 1.0)));
        let percent = |key, declared_ratio: f64, measured: Fitted| MeasuredValue {
            actuator: "valve",
            key,
            unit: "%",
            declared: 100.0 * declared_ratio,
            measured: measured.times(100.0),
        };
        values.push(percent("play", declared.valve_play_ratio, valve.play_ratio));
        values.push(percent("dead_band", declared.valve_dead_band_ratio, valve.dead_band_ratio));
    }
    if let Some(motion) = &t3 {
        values.extend(lag_and_rate("turbine_inlet_temperature", &declared.t3, motion, ("K/s", 1.0)));
    }
    values
}

fn lag_and_rate(
    actuator: &'static str,
    declared: &ActuatorMotion,
    motion: &FittedMotion,
    (unit, per_unit): (&'static str, f64),
) -> [MeasuredValue; 2] {
    let value =
        |key, unit, declared: f64, measured| MeasuredValue { actuator, key, unit, declared, measured };
    let rate = motion.rate_per_s.times(1.0 / per_unit);
    [
        value("lag", "s", declared.lag_s, motion.lag_s),
        value("rate", unit, declared.rate_per_s / per_unit, rate),
    ]
}
