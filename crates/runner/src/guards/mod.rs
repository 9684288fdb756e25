//! Guards that end a step or a run before damage: signals, sample stream, plausibility, surge, and the rig itself.

pub(crate) mod avoided_speed_watch;
pub(crate) mod guard;
pub(crate) mod plausibility_watch;
pub(crate) mod rig_watch;
pub(crate) mod signal_watch;
pub(crate) mod surge_watch;
