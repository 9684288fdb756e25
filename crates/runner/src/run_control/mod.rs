//! Control of a run from soak to cool-down: steps, speed control, operator requests, protection, and safe shutdown.

pub(crate) mod observer;
pub(crate) mod run;
pub(crate) mod safe_shutdown;
pub(crate) mod speed_control;
pub(crate) mod step_transition;
pub(crate) mod transition_control;
