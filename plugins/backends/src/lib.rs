//! The backends that are built into `mapper`, one module each: simulated gas stands and the replay of recordings. The command line
//! passes the list [`BACKENDS`] to `session`. To add a backend, write a module with a constant `PLUGIN`, and add its line below.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

use mapper_core::{SetpointRange, SetpointRanges};
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

/// Setpoints that the backends of this crate accept: plausible ones of a turbocharger gas stand; others are errors of the client.
pub(crate) const ACCEPTED_SETPOINTS: SetpointRanges = SetpointRanges {
    p3_pa: SetpointRange { low: 50e3, high: 2e6 },
    t3_k: SetpointRange { low: 250.0, high: 1400.0 },
    valve_opening_ratio: SetpointRange { low: 0.05, high: 2.5 },
    oil_temperature_k: SetpointRange { low: 250.0, high: 450.0 },
};
