//! Driver errors before the rig is available.

use crate::protocol::{InvalidData, Version};
use std::path::PathBuf;

/// A missing or unusable driver.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// No program has this name.
    #[error(
        "there is no such backend. Built in: {built_in}. A driver would be a program `{program}`, which is not in {searched}{hint}"
    )]
    NotFound {
        /// File name searched.
        program: String,
        /// Built-in backends of the program.
        built_in: String,
        /// Searched locations.
        searched: String,
        /// A hint: a sentence with a leading space, or empty.
        hint: String,
    },
    /// It cannot be started.
    #[error("{} cannot be started: {source}{}", program.display(), start_hint(source))]
    NotStarted {
        /// The program.
        program: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// No driver listens on the socket.
    #[error(
        "no driver listens at the socket {}: {source}. Start its driver (`mapper-backend-NAME --socket PATH`), or remove the file, so that the \
                 driver is started as a program",
        socket.display()
    )]
    NotListening {
        /// The socket.
        socket: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The program is not executable.
    #[error("{} exists, but is not executable; run `chmod +x {}`", program.display(), program.display())]
    NotExecutable {
        /// The program.
        program: PathBuf,
    },
    /// The driver's protocol version is incompatible.
    #[error("it uses version {}.{} of the protocol; this program uses {}.{}. Use a driver with the same major version", theirs.major, theirs.minor, ours.major, ours.minor)]
    Version {
        /// Its version.
        theirs: Version,
        /// This program's version.
        ours: Version,
    },
    /// The response is not that of a driver.
    #[error("it is not a driver for mapper: {0}")]
    NotADriver(String),
    /// The driver reports a different name.
    #[error("it reports the name `{0}`; the file name of the program has to end with this name")]
    Name(String),
    /// The driver's data are inconsistent.
    #[error(transparent)]
    InvalidData(#[from] InvalidData),
    /// The driver has exited or closed its output.
    #[error("the driver has ended{0}")]
    Ended(String),
    /// The driver sent an invalid message.
    #[error("the driver sent an invalid message: {0}")]
    InvalidMessage(String),
    /// The driver does not read its input.
    #[error("the driver does not read its input")]
    NotReading,
    /// An error reported by the driver.
    #[error("{0}")]
    Message(String),
    /// The campaign contains a secret.
    #[error(
        "a campaign must not contain a secret; write `{{env: NAME}}` and set the environment variable NAME"
    )]
    Secret,
    /// An environment variable is not set.
    #[error("the environment variable {0} is not set")]
    NotSet(String),
}

/// Hint on the usual cause if the system cannot start a script.
fn start_hint(source: &std::io::Error) -> &'static str {
    /// Unix error code for a file that is neither a program nor a script with an interpreter line.
    const ENOEXEC: i32 = 8;
    match source.kind() {
        std::io::ErrorKind::NotFound => ", although the file exists: check the interpreter in its first line",
        _ if cfg!(unix) && source.raw_os_error() == Some(ENOEXEC) => {
            ": a script has to begin with its interpreter, such as `#!/usr/bin/env python3`"
        }
        _ => "",
    }
}
