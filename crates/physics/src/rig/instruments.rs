//! Instruments between the machine and the recording: response of each sensor, and responses of P3 and the valve to their commands.

use crate::machine::params::Params;
use crate::simulation::model::{Outputs, PreparedModel, State};
use mapper_core::{CHANNELS, Channel};

/// Response of one channel: `y' = (gain x - y)/lag`, plus an offset, of a quantity that its [`Surroundings`] change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelPath {
    /// Gain; 1.
    pub gain_ratio: f64,
    /// Offset in the channel's unit; 0.
    pub offset: f64,
    /// Time constant of its first-order lag, s, >= 0; 0 follows at once.
    pub lag_s: f64,
    /// Conduction of a probe: share of the difference between wall and gas that is added to the gas temperature; 0.
    pub towards_wall_ratio: f64,
    /// Error at [`FULL_FLUX_KG_M2S`] in the channel's unit, proportional to the square of the flow; 0.
    pub with_flow_squared: f64,
    /// Error at a valve opening of 1 in the channel's unit, proportional to the opening; 0.
    pub with_valve: f64,
}

/// Flow per area of the inlet pipe to which errors that grow with the flow refer, kg/(s m2): 100 m/s of air at 20 degC and 1 atm.
pub const FULL_FLUX_KG_M2S: f64 = 120.0;

/// Influences on a sensor in addition to its quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// Temperature of the wall around the probe, K.
    pub wall_k: f64,
    /// Flow through the inlet pipe of the sensor's side, as a ratio to [`FULL_FLUX_KG_M2S`].
    pub flow_ratio: f64,
    /// Valve opening.
    pub opening_ratio: f64,
}

impl Surroundings {
    /// The housing and the flow meter of the side of the machine on which a sensor is.
    pub fn channels(channel: Channel) -> (Channel, Channel) {
        match channel {
            Channel::TurbineFlow | Channel::P3 | Channel::T3 | Channel::P4 | Channel::T4 | Channel::Tt => {
                (Channel::Tt, Channel::TurbineFlow)
            }
            _ => (Channel::Tc, Channel::CompressorFlow),
        }
    }

    /// The flow ratio of a flow through the inlet pipe of the side of `channel`.
    pub fn flow_ratio(params: &Params, channel: Channel, flow_kg_s: f64) -> f64 {
        let diameter_m = match Surroundings::channels(channel).1 {
            Channel::TurbineFlow => params.turbine.inlet_diameter_m,
            _ => params.compressor.inlet_diameter_m,
        };
        flow_kg_s / (std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m * FULL_FLUX_KG_M2S)
    }

    fn of(channel: Channel, prepared: &PreparedModel<'_>, state: &State, outputs: &Outputs) -> Surroundings {
        let (wall_k, flow_kg_s) = match Surroundings::channels(channel).0 {
            Channel::Tt => (state.tt_k, outputs.turbine_flow_kg_s),
            _ => (state.tc_k, outputs.flow_kg_s),
        };
        Surroundings {
            wall_k,
            flow_ratio: Surroundings::flow_ratio(&prepared.model().params, channel, flow_kg_s),
            opening_ratio: prepared.boundary().valve_opening_ratio,
        }
    }
}

impl ChannelPath {
    /// Whether surroundings change its quantity.
    pub fn depends_on_surroundings(&self) -> bool {
        self.towards_wall_ratio != 0.0 || self.with_flow_squared != 0.0 || self.with_valve != 0.0
    }

    /// The quantity at the sensor, before its lag, gain and offset.
    pub fn at_sensor(&self, value: f64, around: &Surroundings) -> f64 {
        value
            + self.towards_wall_ratio * (around.wall_k - value)
            + self.with_flow_squared * around.flow_ratio * around.flow_ratio
            + self.with_valve * around.opening_ratio
    }

    /// The true value behind a quantity at the sensor: the inverse of [`ChannelPath::at_sensor`].
    pub fn behind(&self, at_sensor: f64, around: &Surroundings) -> f64 {
        let added = self.with_flow_squared * around.flow_ratio * around.flow_ratio
            + self.with_valve * around.opening_ratio;
        (at_sensor - added - self.towards_wall_ratio * around.wall_k) / (1.0 - self.towards_wall_ratio)
    }
}

/// Declared lag of the turbine inlet pressure behind its command, s.
pub const NOMINAL_P3_LAG_S: f64 = 0.3;

/// Motion of the back-pressure valve in addition to the declared one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ValveMotion {
    /// Time constant in addition to its lag, s; 0.
    pub lag_s: f64,
    /// Play of its drive, opening, >= 0; 0.
    pub play_ratio: f64,
    /// Share of its commanded motion that it does not make, 0 to 1; 0.
    pub stuck_ratio: f64,
}

/// Opening at which a valve that does not follow stands: its nominal area, open in the safe state.
const STANDS_AT_RATIO: f64 = 1.0;

impl ValveMotion {
    /// The opening to which a command leads.
    pub fn reached(&self, command_ratio: f64) -> f64 {
        command_ratio + self.stuck_ratio * (STANDS_AT_RATIO - command_ratio)
    }
}

/// All channels, and the actuators of P3 and of the valve.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruments {
    paths: [ChannelPath; CHANNELS.len()],
    /// First-order lag of P3 behind its command, s, >= 0; [`NOMINAL_P3_LAG_S`].
    pub p3_lag_s: f64,
    /// Additional motion of the valve.
    pub valve: ValveMotion,
}

impl Default for Instruments {
    fn default() -> Self {
        Instruments {
            paths: [ChannelPath::default(); CHANNELS.len()],
            p3_lag_s: NOMINAL_P3_LAG_S,
            valve: ValveMotion::default(),
        }
    }
}

impl Default for ChannelPath {
    fn default() -> Self {
        ChannelPath {
            gain_ratio: 1.0,
            offset: 0.0,
            lag_s: 0.0,
            towards_wall_ratio: 0.0,
            with_flow_squared: 0.0,
            with_valve: 0.0,
        }
    }
}

impl Instruments {
    /// The response of `channel`.
    pub fn path(&self, channel: Channel) -> &ChannelPath {
        &self.paths[channel as usize]
    }

    /// The response of `channel`, to be changed.
    pub fn path_mut(&mut self, channel: Channel) -> &mut ChannelPath {
        &mut self.paths[channel as usize]
    }

    /// The quantity at the sensor of `channel` with what its surroundings add, before its lag, gain and offset, in the channel's unit;
    /// `None` for commands.
    pub fn at_sensor(
        &self,
        channel: Channel,
        prepared: &PreparedModel<'_>,
        state: &State,
        outputs: &Outputs,
    ) -> Option<f64> {
        let (value, path) = (true_value(channel, prepared, state, outputs)?, self.path(channel));
        let around = || Surroundings::of(channel, prepared, state, outputs);
        Some(if path.depends_on_surroundings() { path.at_sensor(value, &around()) } else { value })
    }
}

/// The value of the quantity of `channel` on a running machine, in the channel's unit; `None` for commands, which no sensor measures, and for
/// channels that the model does not have.
pub fn true_value(
    channel: Channel,
    prepared: &PreparedModel<'_>,
    state: &State,
    outputs: &Outputs,
) -> Option<f64> {
    let boundary = prepared.boundary();
    let value = match channel {
        Channel::ShaftSpeed => state.shaft_speed_rpm(),
        Channel::CompressorFlow => outputs.flow_kg_s,
        Channel::P1 => boundary.p1_pa,
        Channel::T1 => boundary.t1_k,
        Channel::P2 => state.p2_pa,
        Channel::T2 => outputs.t2_probe_k,
        Channel::Tc => state.tc_k,
        Channel::TurbineFlow => outputs.turbine_flow_kg_s,
        Channel::P3 => boundary.p3_pa,
        Channel::T3 => boundary.t3_k,
        Channel::P4 => boundary.p4_pa,
        Channel::T4 => outputs.turbine.t4_k,
        Channel::Tt => state.tt_k,
        Channel::TOil => boundary.oil_temperature_k,
        Channel::TAmb => boundary.ambient_temperature_k,
        Channel::P3Command | Channel::T3Command | Channel::ValveCommand | Channel::TOilCommand => {
            return None;
        }
        Channel::TOilOut | Channel::OilFlow | Channel::TWater | Channel::TWaterOut | Channel::WaterFlow => {
            return None;
        }
        Channel::RelativeHumidity | Channel::DewPoint => return None,
        Channel::P1Variation | Channel::P2Variation => return None,
    };
    let hooks = &prepared.model().hooks;
    Some(if hooks.is_empty() { value } else { hooks.reading(&prepared.site(state, outputs), channel, value) })
}

/// Follows one channel from sample to sample; starts settled at its first value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelFollower {
    path: ChannelPath,
    /// Time, input and lagged value of the last sample.
    last: Option<(f64, f64, f64)>,
}

impl ChannelFollower {
    /// A follower without any sample.
    pub fn new(path: ChannelPath) -> Self {
        ChannelFollower { path, last: None }
    }

    /// Switches to another signal path and keeps the current output.
    pub fn turn_to(&mut self, path: ChannelPath) {
        self.path = path;
    }

    /// The reading of `value` at `t_s`, which rises from call to call. Between samples the input is taken as linear,
    /// for which the lag is exact; a lag of 0 is the limit of small ones.
    pub fn read(&mut self, t_s: f64, value: f64) -> f64 {
        let lagged = match self.last {
            Some((before_s, before, lagged)) if self.path.lag_s > 0.0 && t_s > before_s => {
                let (dt_s, lag_s) = (t_s - before_s, self.path.lag_s);
                let slope = (value - before) / dt_s;
                // Solution of y' = (x - y)/lag for x = before + slope (t - t0).
                let follows = value - slope * lag_s;
                follows + (lagged - (before - slope * lag_s)) * (-dt_s / lag_s).exp()
            }
            _ => value,
        };
        self.last = Some((t_s, value, lagged));
        self.path.gain_ratio * lagged + self.path.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tap that reads the static instead of the total pressure is low by m^2/(2 rho A^2), at the full flux of air of 1.2 kg/m3 by 6 kPa.
    #[test]
    fn what_surroundings_add_can_be_taken_away() {
        let path = ChannelPath { with_flow_squared: -6e3, ..ChannelPath::default() };
        let around = Surroundings { wall_k: 350.0, flow_ratio: 0.5, opening_ratio: 0.7 };
        assert_eq!(path.at_sensor(100e3, &around), 98.5e3);
        let path = ChannelPath { towards_wall_ratio: 0.1, with_valve: 2.0, ..path };
        assert!((path.behind(path.at_sensor(300.0, &around), &around) - 300.0).abs() < 1e-9);
        let area_m2 = std::f64::consts::FRAC_PI_4 * 0.04 * 0.04;
        let ratio = Surroundings::flow_ratio(&Params::default(), Channel::P1, 60.0 * area_m2);
        assert!((ratio - 0.5).abs() < 1e-12 && (120.0f64.powi(2) / (2.0 * 1.2) - 6e3).abs() < 1e-9);
    }

    #[test]
    fn a_lag_answers_a_ramp_late_by_its_time_constant_and_vanishes_smoothly() {
        let read = |lag_s: f64| {
            let mut follower = ChannelFollower::new(ChannelPath { lag_s, ..ChannelPath::default() });
            (0..=100).map(|i| follower.read(f64::from(i) * 0.1, f64::from(i) * 0.2)).collect::<Vec<f64>>()
        };
        // A ramp of 2 per second, 10 s after its start: behind by 2 tau (1 - exp(-10/tau)).
        for tau_s in [0.5f64, 2.0] {
            let expected = 20.0 - 2.0 * tau_s * (1.0 - (-10.0 / tau_s).exp());
            assert!((read(tau_s)[100] - expected).abs() < 1e-12);
        }
        assert!((read(1e-4)[50] - read(0.0)[50]).abs() < 1e-3);
    }
}
