//! Time as an argument: the run's clock.

/// Paces a run. The backend owns the time of its samples; the clock decides when to ask for them.
pub trait Clock {
    /// Returns when the run may go on to `t_s` (seconds since arming).
    fn wait_until(&mut self, t_s: f64);
}

/// Never waits: simulated rigs run as fast as they can.
#[derive(Debug, Default, Clone, Copy)]
pub struct UnpacedClock;

impl Clock for UnpacedClock {
    fn wait_until(&mut self, _t_s: f64) {}
}
