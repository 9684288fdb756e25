//! The plug-ins of the program, with its commit.

use mapper_session::Registry;

/// Every plug-in.
pub fn registry() -> Registry {
    Registry { commit: env!("MAPPER_COMMIT"), ..mapper::plugins() }
}
