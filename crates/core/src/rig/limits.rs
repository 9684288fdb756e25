//! Limits and settings of a run: limits of the machine, soak, speed control, run-down, reaction to drift.

use crate::rig::avoided_speeds::BAND_RATIO;
use crate::{
    AvoidedSpeeds, Channel, OperatingPoint, RigMode, SafeTrajectory, SetpointRange, SetpointRanges, Setpoints,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum time beyond the surge line, s. Bound: a jump may touch the line, but a point may not stay beyond it.
pub const SURGE_ALLOWED_S: f64 = 5.0;

/// Limits of a rig and its machine. They apply to points, to jumps, and to a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Lowest allowed setpoint of the turbine inlet pressure, Pa.
    pub p3_min_pa: f64,
    /// Highest allowed setpoint of the turbine inlet pressure, Pa.
    pub p3_max_pa: f64,
    /// Time of the rig from the lowest to the highest turbine inlet pressure, s, > 0; `None` if it is not considered.
    pub p3_stroke_s: Option<f64>,
    /// Highest turbine inlet temperature, K.
    pub t3_max_k: Option<f64>,
    /// Highest compressor outlet temperature, K; also during jumps.
    pub t2_max_k: Option<f64>,
    /// Smallest surge margin of a point: flow over the surge flow at equal corrected speed, minus one. `None`
    /// means the surge line itself, 0.
    pub surge_margin_min_ratio: Option<f64>,
    /// Largest change of the compressor housing within a window, K.
    pub housing_gradient_max_k: Option<f64>,
    /// Largest overshoot of the shaft speed in a transition, relative to the higher of its two targets; `None` means
    /// [`Limits::OVERSHOOT_RATIO`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overshoot_max_ratio: Option<f64>,
    /// Speeds that a jump crosses and no step holds.
    #[serde(default, skip_serializing_if = "AvoidedSpeeds::is_empty")]
    pub avoid: AvoidedSpeeds,
}

impl Limits {
    /// Maximum rate of the turbine inlet pressure, Pa/s; `None` if no stroke is given.
    pub fn p3_slew_max_pa_s(&self) -> Option<f64> {
        self.p3_stroke_s.map(|stroke_s| (self.p3_max_pa - self.p3_min_pa) / stroke_s)
    }

    /// Default of the largest overshoot. Bound: twice the band within which guards expect the speed of a step.
    pub const OVERSHOOT_RATIO: f64 = 0.02;
    /// Default of the smallest surge margin of a transition. Bound: the usual uncertainty of a surge line.
    pub const TRANSITION_MARGIN_RATIO: f64 = 0.05;
    /// Room below the margins of two close points for the jump between them. Bound: warm housings heat the outlet gas, which takes some
    /// tenths of a per cent of the valve's flow.
    const CLOSE_POINT_RATIO: f64 = 0.01;

    /// Largest allowed overshoot, relative to the higher of the two targets of a transition.
    pub fn overshoot_ratio(&self) -> f64 {
        self.overshoot_max_ratio.unwrap_or(Self::OVERSHOOT_RATIO)
    }

    /// Minimum surge margin of a transition between points with these margins: the declared one, or
    /// [`Limits::TRANSITION_MARGIN_RATIO`]. A point that is closer is reached with nearly its own margin.
    pub fn transition_margin_ratio(&self, from_ratio: f64, to_ratio: f64) -> f64 {
        let ends_ratio = from_ratio.min(to_ratio) - Self::CLOSE_POINT_RATIO;
        let limit_ratio = self.surge_margin_min_ratio.unwrap_or(Self::TRANSITION_MARGIN_RATIO);
        limit_ratio.min(ends_ratio.max(self.surge_margin_floor_ratio().min(0.0)))
    }

    /// Minimum surge margin of a point: the declared one, or the surge line.
    pub fn surge_margin_floor_ratio(&self) -> f64 {
        self.surge_margin_min_ratio.unwrap_or(0.0)
    }
}

/// Reaction if two repeats of a jump differ from its first visit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::enums::flatten_to_names)]
pub enum OnDrift {
    /// The run ends in the safe state, for inspection by an operator.
    Hold,
    /// The run continues; the recording has a note.
    Continue,
    /// The run ends in the safe state, without flow, and asks for a zero of the sensors.
    Zero,
}

/// Setpoint at which a heater does not heat, K. Bound: below any gas that a compressor delivers.
const HEATER_OFF_K: f64 = 293.15;

impl SafeTrajectory {
    /// Setpoints at the time `after_s` of a shutdown that began at the setpoints `from`: heater off, valve open, P3 falling at its slew rate. `None` means that the air
    /// must be cut off: without a slew rate at once, otherwise at the end of the shutdown or once P3 has reached `p3_min_pa`.
    ///
    /// Heater and valve setpoints are limited to the ranges of the rig. A rig that does not accept 293 K gets its lowest setpoint, because a
    /// rejected command would cut off the air at full pressure.
    pub fn setpoints(
        &self,
        from: &Setpoints,
        after_s: f64,
        p3_min_pa: f64,
        accepts: Option<&SetpointRanges>,
    ) -> Option<Setpoints> {
        let p3_pa = from.p3_pa - self.p3_slew_pa_s? * after_s;
        let is_running = from.mode == RigMode::Running && after_s <= self.within_s && p3_pa > p3_min_pa;
        let clamp_to = |value: f64, range: Option<SetpointRange>| match range {
            Some(SetpointRange { low, high }) => value.min(high).max(low),
            None => value,
        };
        let opening =
            from.valve_opening_ratio.max(self.valve_opening_ratio).min(OperatingPoint::OPENING_MAX_RATIO);
        is_running.then_some(Setpoints {
            p3_pa,
            t3_k: clamp_to(HEATER_OFF_K, accepts.map(|accepts| accepts.t3_k)),
            valve_opening_ratio: clamp_to(opening, accepts.map(|accepts| accepts.valve_opening_ratio)),
            ..*from
        })
    }
}

/// Soaks the machine before the run until sensors see one temperature and one pressure, so that their offsets can be zeroed:
/// the isothermal zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Soak {
    /// Time at rest, s, > 0; if the soak ends when the sensors rest, the shortest.
    pub duration_s: f64,
    /// Whether the soak goes on until T1, T2, P1 and P2 rest, at most for [`Soak::LONGEST_S`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub until_settled: bool,
    /// Oil inlet temperature during the soak, K: equal to that of cell and inlet air.
    pub oil_temperature_k: f64,
    /// Temperature non-uniformity: standard deviation of the true temperature at a sensor about the mean of all, K, >= 0.
    pub temperature_sigma_k: f64,
    /// Standard deviation of the pressure taps at rest, Pa, >= 0.
    pub pressure_sigma_pa: f64,
}

impl Soak {
    /// Groups of sensors that must read the same at standstill: temperatures, pressures of the compressor, and of the turbine.
    pub const EQUAL_AT_REST: [&'static [Channel]; 3] = {
        use Channel::{P1, P2, P3, P4, T1, T2, T3, T4, TOil, Tc, Tt};
        [&[T1, T2, Tc, TOil, T3, T4, Tt], &[P1, P2], &[P3, P4]]
    };
    /// Shortest soak that ends when the sensors rest, s. Bound: gas in pipes settles within a minute, and two and a half minutes of noise of 0.1 K
    /// are known to 0.01 K.
    pub const SHORTEST_S: f64 = 300.0;
    /// Longest soak that ends when the sensors rest, s. Bound: a housing is then within 1 K of the cell, and waiting longer costs more than a
    /// declared offset.
    pub const LONGEST_S: f64 = 1800.0;
    /// Maximum drift of a thermometer at rest, K/min. Bound: housings of 10 minutes are then within 1 K of their limit.
    pub const MAX_DRIFT_K_MIN: f64 = 0.1;
    /// Default temperature non-uniformity of a soak, K. Judgement: a closed cell after an hour; a campaign declares its own.
    pub const TEMPERATURE_SIGMA_K: f64 = 0.05;
    /// Default of [`Soak::pressure_sigma_pa`], Pa. Bound: draughts of a cell at rest.
    pub const PRESSURE_SIGMA_PA: f64 = 5.0;
}

/// The nominal machine around a steady state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedResponse {
    /// Change of the steady shaft speed with P3, rpm/Pa, > 0.
    pub rpm_per_pa: f64,
    /// Relative change of P3 per relative change of the turbine's power, ratio, > 0.
    pub p3_per_power: f64,
    /// Time constant with which the speed follows P3's command, the actuator's lag included, s, > 0.
    pub time_constant_s: f64,
    /// Lag and dead time of P3 behind its command, s, >= 0.
    pub delay_s: f64,
}

/// The closed loop over the shaft speed, as declared in the campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedControlSettings {
    /// Deviation from the target within which the speed counts as reached, ratio, > 0.
    pub band_ratio: f64,
}

impl SpeedControlSettings {
    /// Default band, ratio.
    pub const BAND_RATIO: f64 = BAND_RATIO;
}

impl Default for SpeedControlSettings {
    fn default() -> Self {
        SpeedControlSettings { band_ratio: SpeedControlSettings::BAND_RATIO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_is_reported_nothing_that_it_refuses() {
        let safe = SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 20.0 };
        let from = Setpoints {
            mode: RigMode::Running,
            p3_pa: 300e3,
            t3_k: 873.15,
            valve_opening_ratio: 0.6,
            oil_temperature_k: 323.15,
        };
        let range = |low, high| SetpointRange { low, high };
        let accepts = SetpointRanges {
            p3_pa: range(105e3, 400e3),
            t3_k: range(400.0, 900.0),
            valve_opening_ratio: range(0.1, 0.9),
            oil_temperature_k: range(280.0, 400.0),
        };
        let free = safe.setpoints(&from, 1.0, 105e3, None).unwrap();
        assert_eq!((free.p3_pa, free.t3_k, free.valve_opening_ratio), (250e3, 293.15, 1.0));
        let bounded = safe.setpoints(&from, 1.0, 105e3, Some(&accepts)).unwrap();
        assert_eq!((bounded.t3_k, bounded.valve_opening_ratio), (400.0, 0.9));
        assert!(accepts.check(&bounded).is_ok());
        // (300 - 105) kPa at 50 kPa/s are 3.9 s.
        assert!(safe.setpoints(&from, 3.8, 105e3, Some(&accepts)).is_some());
        assert_eq!(safe.setpoints(&from, 4.0, 105e3, Some(&accepts)), None);
        assert_eq!(SafeTrajectory { p3_slew_pa_s: None, ..safe }.setpoints(&from, 0.1, 0.0, None), None);
    }
}
