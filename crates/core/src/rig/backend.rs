//! The interfaces to the outside: a rig, and the clock that paces a run.

use crate::{Channel, GuardName, SafeTrajectory, SampleBatch, with_unit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether gas flows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "Mode")]
pub enum RigMode {
    /// Air off, shaft at rest; for soaks and zeros.
    Standstill,
    /// Air on.
    Running,
}

/// All setpoints of a rig, effective at once.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setpoints {
    /// Air on or off.
    pub mode: RigMode,
    /// Turbine inlet total pressure (station 3), Pa.
    pub p3_pa: f64,
    /// Turbine inlet total temperature (station 3), K.
    pub t3_k: f64,
    /// Back-pressure valve opening relative to the nominal area, 0..2.5.
    pub valve_opening_ratio: f64,
    /// Oil inlet temperature, K.
    pub oil_temperature_k: f64,
}

/// A rig's description before the backend is armed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RigDescription {
    /// Name of the backend, e.g. `virtual_lab`.
    pub backend: String,
    /// Version of the backend.
    pub version: String,
    /// Channels it delivers.
    pub channels: Vec<Channel>,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Whether time is simulated: a simulated rig is never paced by the wall clock.
    pub simulated_time: bool,
    /// Whether setpoints have an effect; false for a recording that is played back.
    pub controls: bool,
    /// Unique name of a physical rig, e.g. its address: two runs cannot use it at once. `None` for a simulation, of
    /// which each run has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exclusive: Option<String>,
    /// Network address, e.g. host and port of its controller: two runs cannot use it at once either, whatever the name of
    /// the rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached_at: Option<String>,
    /// Guards that a run must have, with a reaction that ends the run; the rig is not armed without them.
    #[serde(default)]
    pub needs_guarded: Vec<GuardName>,
    /// Accepted setpoints; `None` if the rig checks them only when they are sent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepts: Option<SetpointRanges>,
    /// Own safe shutdown; a campaign may declare another.
    #[serde(default)]
    pub safe: SafeTrajectory,
}

/// Lowest and highest value of a setpoint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SetpointRange {
    /// Lowest, SI.
    pub low: f64,
    /// Highest, SI.
    pub high: f64,
}

/// Setpoints that a rig accepts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SetpointRanges {
    /// Turbine inlet total pressure, Pa.
    pub p3_pa: SetpointRange,
    /// Turbine inlet total temperature, K.
    pub t3_k: SetpointRange,
    /// Back-pressure valve opening, ratio.
    pub valve_opening_ratio: SetpointRange,
    /// Oil inlet temperature, K.
    pub oil_temperature_k: SetpointRange,
}

impl SetpointRanges {
    /// Rejects setpoints outside the ranges, and those that are not numbers.
    pub fn check(&self, setpoints: &Setpoints) -> Result<(), BackendError> {
        for (quantity, value, unit, range) in [
            ("P3", setpoints.p3_pa, "Pa", self.p3_pa),
            ("T3", setpoints.t3_k, "K", self.t3_k),
            ("valve opening", setpoints.valve_opening_ratio, "1", self.valve_opening_ratio),
            ("T_oil", setpoints.oil_temperature_k, "K", self.oil_temperature_k),
        ] {
            let SetpointRange { low, high } = range;
            if !(low..=high).contains(&value) {
                return Err(BackendError::SetpointOutOfRange { quantity, value, unit, low, high });
            }
        }
        Ok(())
    }
}

/// A gas stand, real or simulated. It owns its time; all data are owned.
///
/// Life cycle: [`describe`](Backend::describe), [`arm`](Backend::arm), then any number of
/// [`set`](Backend::set), [`hold`](Backend::hold) and [`poll`](Backend::poll), then [`disarm`](Backend::disarm).
/// [`make_safe`](Backend::make_safe) is allowed at any time after arming, also after an error.
pub trait Backend: Send {
    /// Describes the rig and its measurements.
    fn describe(&self) -> RigDescription;

    /// Takes control of the rig; run time 0 starts here.
    ///
    /// # Errors
    /// [`BackendError::OutOfOrder`] if the backend is armed already, [`BackendError::Lost`] if it cannot be reached.
    fn arm(&mut self) -> Result<(), BackendError>;

    /// Sends new setpoints, effective from the time of the last poll on.
    ///
    /// # Errors
    /// [`BackendError::OutOfOrder`] before the backend is armed, [`BackendError::SetpointOutOfRange`],
    /// [`BackendError::Simulation`] or [`BackendError::Lost`] if the rig cannot follow.
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError>;

    /// Lets the rig run until `until_s` (seconds since arming) and returns the samples since the last poll.
    ///
    /// # Errors
    /// [`BackendError::OutOfOrder`] before the backend is armed and has setpoints, [`BackendError::Simulation`] and
    /// [`BackendError::Lost`] with the time at which it stopped.
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError>;

    /// Holds the last setpoints while an operator inspects the run. A rig that keeps its setpoints does nothing;
    /// a rig with a controller sends them again, which shows whether the controller still accepts them.
    fn hold(&mut self) -> Result<(), BackendError> {
        Ok(())
    }

    /// Brings the rig into its safe state: air off, valve open.
    ///
    /// # Errors
    /// [`BackendError::OutOfOrder`] before the backend is armed, [`BackendError::Lost`] if it cannot be reached.
    fn make_safe(&mut self) -> Result<(), BackendError>;

    /// Releases control of the rig.
    ///
    /// # Errors
    /// [`BackendError::OutOfOrder`] before the backend is armed, [`BackendError::Lost`] if it cannot be reached.
    fn disarm(&mut self) -> Result<(), BackendError>;
}

/// Reason why a call of a backend failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BackendError {
    #[error("`{call}` was called while the rig is {state}, not {needed}: a defect of the calling program")]
    OutOfOrder { call: &'static str, state: &'static str, needed: &'static str },
    #[error(
        "{quantity} = {} is outside the range of the rig ({low} to {})",
        with_unit(value, unit),
        with_unit(high, unit)
    )]
    SetpointOutOfRange { quantity: &'static str, value: f64, unit: &'static str, low: f64, high: f64 },
    /// The backend's own settings in the campaign are wrong; `path`: the keys below `backend.settings`.
    #[error("the settings of backend `{backend}` are wrong at `{path}`: {source}")]
    Settings { backend: String, path: String, source: BackendCause },
    #[error("the simulation stopped at {t_s:.3} s: {source}")]
    Simulation { t_s: f64, source: BackendCause },
    #[error("the rig did not answer `{call}` within {limit_s} s")]
    Deadline { call: &'static str, limit_s: f64 },
    #[error("the rig was lost at {t_s:.3} s: {source}")]
    Lost { t_s: f64, source: BackendCause },
}

/// The error of the backend. Each backend has its own error type.
pub type BackendCause = Box<dyn std::error::Error + Send + Sync>;

/// Paces a run. The backend owns the time of its samples; the clock decides when to request them.
pub trait Clock {
    /// Returns when the run may continue to `t_s` (seconds since arming).
    fn wait_until(&mut self, t_s: f64);

    /// Whether time passes outside [`wait_until`](Self::wait_until), as it does on a real rig.
    fn advances_by_itself(&self) -> bool {
        false
    }
}

/// Never waits: simulated rigs run as fast as they can.
#[derive(Debug, Default, Clone, Copy)]
pub struct UnpacedClock;

impl Clock for UnpacedClock {
    fn wait_until(&mut self, _t_s: f64) {}
}

/// A wall clock and a way to wait for it, provided by the main program.
pub trait WallClock {
    /// Time since any fixed instant, s; never goes back.
    fn now_s(&self) -> f64;

    /// Returns after this time, s.
    fn wait_s(&self, duration_s: f64);
}

/// Paces a run by a wall clock: in real time, or faster by a factor.
#[derive(Debug, Clone)]
pub struct PacedClock<W> {
    wall: W,
    /// Run time over wall-clock time, > 0.
    speed_ratio: f64,
    /// Wall-clock time at the start of the run.
    start_s: Option<f64>,
}

impl<W: WallClock> PacedClock<W> {
    /// A clock that begins with the first wait. `speed_ratio`: run time over wall-clock time, 1 for real time; values that are
    /// not above 0 mean real time.
    pub fn new(wall: W, speed_ratio: f64) -> Self {
        let speed_ratio = if speed_ratio > 0.0 { speed_ratio } else { 1.0 };
        PacedClock { wall, speed_ratio, start_s: None }
    }
}

impl<W: WallClock> Clock for PacedClock<W> {
    fn advances_by_itself(&self) -> bool {
        true
    }

    fn wait_until(&mut self, t_s: f64) {
        let now_s = self.wall.now_s();
        let start_s = *self.start_s.get_or_insert(now_s);
        let remaining_s = start_s + t_s / self.speed_ratio - now_s;
        // A late call does not wait, so that a slow disk delays only one poll.
        if remaining_s > 0.0 {
            self.wall.wait_s(remaining_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A wall clock that advances only during waits.
    struct Idle(Cell<f64>);

    impl WallClock for &Idle {
        fn now_s(&self) -> f64 {
            self.0.get()
        }
        fn wait_s(&self, duration_s: f64) {
            self.0.set(self.0.get() + duration_s);
        }
    }

    #[test]
    fn a_paced_clock_waits_as_long_as_its_speed_says_and_catches_up() {
        for (speed_ratio, expected_s) in [(1.0, 10.0), (4.0, 2.5), (f64::NAN, 10.0)] {
            let wall = Idle(Cell::new(7.0));
            let mut clock = PacedClock::new(&wall, speed_ratio);
            (0..=10).for_each(|t_s| clock.wait_until(f64::from(t_s)));
            assert!((wall.0.get() - 7.0 - expected_s).abs() < 1e-9, "{speed_ratio}");
        }
        let wall = Idle(Cell::new(0.0));
        let mut clock = PacedClock::new(&wall, 1.0);
        clock.wait_until(0.0);
        // A call took 5 s: the run is late, and then on time again.
        (&wall).wait_s(5.0);
        [1.0, 2.0, 6.0].into_iter().for_each(|t_s| clock.wait_until(t_s));
        assert!(((&wall).now_s() - 6.0).abs() < 1e-9);
    }
}
