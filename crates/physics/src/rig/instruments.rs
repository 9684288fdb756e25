//! Instruments between the machine and the recording: response of each sensor, and response of P3 to its command.

use crate::simulation::model::{Outputs, PreparedModel, State};
use mapper_core::{CHANNELS, Channel};

/// Response of one channel: `y' = (gain x - y)/lag`, plus an offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelPath {
    /// Gain; 1.
    pub gain_ratio: f64,
    /// Offset in the channel's unit; 0.
    pub offset: f64,
    /// Time constant of its first-order lag, s, >= 0; 0 follows at once.
    pub lag_s: f64,
}

/// Declared lag of the turbine inlet pressure behind its command, s.
pub const NOMINAL_P3_LAG_S: f64 = 0.3;

/// All channels, and the actuator of P3.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruments {
    paths: [ChannelPath; CHANNELS.len()],
    /// First-order lag of P3 behind its command, s, >= 0; [`NOMINAL_P3_LAG_S`].
    pub p3_lag_s: f64,
}

impl Default for Instruments {
    fn default() -> Self {
        let path = ChannelPath { gain_ratio: 1.0, offset: 0.0, lag_s: 0.0 };
        Instruments { paths: [path; CHANNELS.len()], p3_lag_s: NOMINAL_P3_LAG_S }
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
}

/// The input of the sensor of `channel` on a running machine, before its own lag, gain and offset, in the channel's unit;
/// `None` for commands, which no sensor measures.
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

    #[test]
    fn a_lag_answers_a_ramp_late_by_its_time_constant_and_vanishes_smoothly() {
        let read = |lag_s: f64| {
            let mut follower = ChannelFollower::new(ChannelPath { gain_ratio: 1.0, offset: 0.0, lag_s });
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
