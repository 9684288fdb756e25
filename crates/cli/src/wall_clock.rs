//! The clock on the wall, for runs in real time.

use mapper_campaign::campaign::Date;
use mapper_core::Wall;
use std::time::{Duration, Instant};

/// The computer's monotonic clock.
pub struct SystemClock(Instant);

impl SystemClock {
    /// Begins now.
    pub fn new() -> Self {
        SystemClock(Instant::now())
    }
}

/// The current day, UTC; `None` before 1970.
pub fn today() -> Option<Date> {
    Date::from_epoch_ns(u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(0))
}

impl Wall for SystemClock {
    fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }

    fn wait_s(&self, duration_s: f64) {
        if let Ok(duration) = Duration::try_from_secs_f64(duration_s) {
            std::thread::sleep(duration);
        }
    }
}
