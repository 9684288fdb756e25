//! The backends that are built into `mapper`, one module each: simulated gas stands and the replay of recordings. The command line
//! passes the list [`BACKENDS`] to `session`. To add a backend, write a module with a constant `PLUGIN`, and add its line below.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod setpoint_limits;

use mapper_physics::rig::backend_plugin::BackendPlugin;

/// Declares the backends' modules and the list of them.
macro_rules! backends {
    ($($name:ident),+ $(,)?) => {
        $(pub mod $name;)+

        /// Every backend, in display order.
        pub const BACKENDS: &[BackendPlugin] = &[$($name::PLUGIN),+];
    };
}

backends! {
    virtual_lab,
    other_lab,
    replay,
}
