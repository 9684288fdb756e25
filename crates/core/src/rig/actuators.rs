//! Motion of a stand's actuators: supply of the turbine, back-pressure valve and heater, as a campaign declares them.

use serde::{Deserialize, Serialize};

/// Motion of one actuator: it follows its command after a dead time, with a first-order lag and at a limited rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorMotion {
    /// Time constant of the lag, s, >= 0.
    pub lag_s: f64,
    /// Maximum rate, unit of the actuator per second, > 0.
    pub rate_per_s: f64,
    /// Time before it begins to move, s, >= 0.
    pub dead_time_s: f64,
}

/// Lags after which 1 % of a change remains. Source: ln 100.
const ARRIVED_LAGS: f64 = 4.605_170_185_988_091;

impl ActuatorMotion {
    /// Shortest duration of a ramp of the command by `change`, s: the actuator follows such a ramp with its lag alone.
    pub fn ramp_s(&self, change: f64) -> f64 {
        change.abs() / self.rate_per_s
    }

    /// Time after the end of a ramp of the command until 1 % of the change remains, s.
    pub fn follow_s(&self) -> f64 {
        self.dead_time_s + ARRIVED_LAGS * self.lag_s
    }
}

/// Actuators of a gas stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigActuators {
    /// Turbine inlet pressure; rate in Pa/s.
    pub p3: ActuatorMotion,
    /// Opening of the back-pressure valve, relative to its nominal area; rate in 1/s.
    pub valve: ActuatorMotion,
    /// Play of the valve's drive, opening: the range of commands that do not move a valve which reverses.
    pub valve_play_ratio: f64,
    /// Change of the command below which the positioner does not move, opening.
    pub valve_dead_band_ratio: f64,
    /// Turbine inlet temperature; rate in K/s.
    pub t3: ActuatorMotion,
}

impl RigActuators {
    /// Air from a fast control valve, and a fast back-pressure valve: the rig of the paper, whose pressure follows within a second.
    /// Source: Burke et al., section 3, for the pressure; data sheets of electric positioners (a stroke in a second) for the valve.
    pub const FAST_VALVE: RigActuators = RigActuators {
        p3: ActuatorMotion { lag_s: 0.3, rate_per_s: 200e3, dead_time_s: 0.0 },
        valve: ActuatorMotion { lag_s: 0.2, rate_per_s: 1.0, dead_time_s: 0.0 },
        valve_play_ratio: 0.0,
        valve_dead_band_ratio: 0.0,
        t3: ActuatorMotion { lag_s: 20.0, rate_per_s: 10.0, dead_time_s: 0.0 },
    };

    /// Air from a screw compressor, whose inverter sets the pressure. Source: data sheets of inverters, which ramp over the range of
    /// pressure in 10 to 60 s, and of pneumatic positioners, with a play of about 2 %.
    pub const SCREW_COMPRESSOR: RigActuators = RigActuators {
        p3: ActuatorMotion { lag_s: 4.0, rate_per_s: 10e3, dead_time_s: 1.0 },
        valve: ActuatorMotion { lag_s: 0.5, rate_per_s: 0.5, dead_time_s: 0.2 },
        valve_play_ratio: 0.02,
        valve_dead_band_ratio: 0.005,
        t3: ActuatorMotion { lag_s: 30.0, rate_per_s: 5.0, dead_time_s: 1.0 },
    };

    /// Air from a vessel through a control valve. Source: data sheets of large control valves, which stroke
    /// in 5 to 10 s.
    pub const BLOW_DOWN: RigActuators = RigActuators {
        p3: ActuatorMotion { lag_s: 1.0, rate_per_s: 50e3, dead_time_s: 0.3 },
        valve: ActuatorMotion { lag_s: 0.5, rate_per_s: 0.5, dead_time_s: 0.2 },
        valve_play_ratio: 0.01,
        valve_dead_band_ratio: 0.005,
        t3: ActuatorMotion { lag_s: 20.0, rate_per_s: 10.0, dead_time_s: 0.5 },
    };
}

impl Default for RigActuators {
    fn default() -> Self {
        RigActuators::FAST_VALVE
    }
}
