//! The way of a stand from one point to the next: ramps of P3 and valve, and what the forecast expects of them.

use crate::{AvoidedCrossing, RigActuators};
use serde::{Deserialize, Serialize};

/// A ramp of a command, from its value before the step to that of the step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Start after the start of the step, s, >= 0.
    pub start_s: f64,
    /// Duration, s, >= 0.
    pub duration_s: f64,
}

impl Ramp {
    /// End after the start of the step, s.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    /// Completed share at `t_s` after the start of the step, 0 to 1.
    pub fn share(&self, t_s: f64) -> f64 {
        if t_s >= self.end_s() {
            1.0
        } else if t_s <= self.start_s {
            0.0
        } else {
            (t_s - self.start_s) / self.duration_s
        }
    }
}

/// Coordinated ramps of P3 and valve. When P3 falls, the valve moves no faster than P3; when it rises, P3 rises no faster than the valve moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramps {
    /// Turbine inlet pressure.
    pub p3: Ramp,
    /// Back-pressure valve.
    pub valve: Ramp,
}

impl Ramps {
    /// Overlapping ramps over these changes, at the rates of the actuators; `shaft_s`: time constant of the shaft. The follower stays behind
    /// the leader's lag.
    pub fn overlapping(
        p3_change_pa: f64,
        opening_change_ratio: f64,
        shaft_s: f64,
        actuators: &RigActuators,
    ) -> Self {
        let RigActuators { p3, valve, .. } = actuators;
        let duration_s = p3.ramp_s(p3_change_pa).max(valve.ramp_s(opening_change_ratio));
        let (p3_delay_s, valve_delay_s) = (p3.dead_time_s + p3.lag_s, valve.dead_time_s + valve.lag_s);
        let ramp = |start_s: f64| Ramp { start_s: start_s.max(0.0), duration_s };
        if p3_change_pa < 0.0 {
            Ramps { p3: ramp(0.0), valve: ramp(p3_delay_s + shaft_s - valve_delay_s) }
        } else {
            Ramps { p3: ramp(valve_delay_s - p3_delay_s), valve: ramp(0.0) }
        }
    }

    /// End of the last ramp after the start of the step, s.
    pub fn end_s(&self) -> f64 {
        self.p3.end_s().max(self.valve.end_s())
    }
}

/// A transition between two points with its forecast on the declared stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transition {
    /// The ramps.
    pub ramps: Ramps,
    /// Time after the start of the step until P3 and valve have arrived, s: 1 % of their change remains.
    pub arrival_s: f64,
    /// Highest shaft speed of the step, rpm.
    pub highest_speed_rpm: f64,
    /// Lowest surge margin of the step: flow over the surge flow at equal corrected speed, minus one.
    pub lowest_surge_margin_ratio: f64,
    /// Highest outlet temperature of the step, K.
    pub highest_t2_k: f64,
    /// The slowest crossing of speeds to avoid; `None` if the shaft is never inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub avoided: Option<AvoidedCrossing>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_runs_from_its_start_to_its_end() {
        let ramp = Ramp { start_s: 2.0, duration_s: 4.0 };
        assert_eq!([0.0, 2.0, 3.0, 6.0, 9.0].map(|t_s| ramp.share(t_s)), [0.0, 0.0, 0.25, 1.0, 1.0]);
        let step = Ramp { start_s: 0.0, duration_s: 0.0 };
        assert_eq!([0.0, 1.0].map(|t_s| step.share(t_s)), [1.0, 1.0]);
    }
}
