//! Identification of the program in items and parts.

use mapper_session::{Registry, program_and_commit};

/// Name, version and commit.
pub fn program(registry: &Registry) -> String {
    program_and_commit(registry.commit)
}
