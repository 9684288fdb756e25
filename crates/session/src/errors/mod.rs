//! Errors of all session operations, and their categories by who has to act.
//!
//! Messages name no command or option of the program: a library has none. The command line adds them.

pub(crate) mod error;
pub(crate) mod first_map_error;
pub(crate) mod fmu_error;
pub(crate) mod map_work_error;
