//! Clock of a run: real time, or as fast as the simulation allows.

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
