//! Capabilities of this computer for tests that need more than Rust.

use crate::{environment::machine, workspace};
use std::path::PathBuf;
use std::process::Command;

/// The capabilities.
pub struct Capabilities {
    /// A Python with the packages of the tests.
    pub python: PathBuf,
    /// Whether a small file system can be mounted.
    pub mountable: bool,
    /// Whether Slurm's daemons can be run.
    pub slurm: bool,
    /// Whether npm reaches its registry: the scripts of the pages are compared with its packages.
    pub npm: bool,
}

impl Capabilities {
    /// Detects the capabilities; `python` is the Python of the tests.
    pub fn with(python: PathBuf) -> Self {
        Capabilities {
            python,
            mountable: machine::can_mount(),
            slurm: machine::has_slurm(),
            npm: machine::has_npm(),
        }
    }

    /// Passes the capabilities to a command as environment variables. All build commands get the same, so that nothing is rebuilt.
    pub fn to(&self, mut command: Command) -> Command {
        command.env("MAPPER_TEST_PYTHON", &self.python);
        command.env("MAPPER_TEST_CHROMIUM", "chromium");
        if self.mountable {
            command.env("MAPPER_TEST_TMPFS", "1");
        }
        if self.slurm {
            command.env("MAPPER_TEST_SLURM", "1");
        }
        if self.npm {
            command.env("MAPPER_TEST_NPM", "1");
        }
        command
    }
}

/// A command whose tests find the program where it has just been built.
pub fn with_program(mut command: Command) -> Command {
    command.env("MAPPER_TEST_PROGRAM", workspace::target_dir().join("debug/mapper"));
    command
}
