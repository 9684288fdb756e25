//! What the program takes from its computer: plug-ins with the commit, the directory of rig states, the clock.

use mapper_campaign::campaign::Date;
use mapper_core::WallClock;
use mapper_session::{Registry, shared_state_directory};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Every plug-in.
pub fn registry() -> Registry {
    Registry { commit: env!("MAPPER_COMMIT"), ..mapper::plugins() }
}

/// The directory of locks and lockouts, which all users of a computer share: the given one, or `$MAPPER_STATE_DIR`, or the default that all users of the computer share.
pub fn rig_states_directory(argument: Option<&Path>) -> PathBuf {
    let variable = std::env::var_os("MAPPER_STATE_DIR").filter(|value| !value.is_empty());
    argument.map(Path::to_owned).or(variable.map(PathBuf::from)).unwrap_or_else(shared_state_directory)
}

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

impl WallClock for SystemClock {
    fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }

    fn wait_s(&self, duration_s: f64) {
        if let Ok(duration) = Duration::try_from_secs_f64(duration_s) {
            std::thread::sleep(duration);
        }
    }
}
