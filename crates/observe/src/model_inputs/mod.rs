//! Recorded boundary conditions as model inputs: averaged or smoothed, with actuator response and timing of commands.

pub mod averaged_inputs;
pub mod lagged_command;
pub mod smoothed_inputs;
pub mod smoother;
pub mod step_timing;
