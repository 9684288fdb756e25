//! Driver errors before the rig is available.

use crate::protocol::{Unusable, Version};
use std::path::PathBuf;

/// Why a driver is missing or unusable.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// No program has this name.
    #[error(
        "there is no such backend. Built in: {built_in}. A driver would be a program `{program}`, which is not in {looked}{hint}"
    )]
    NotFound {
        /// File name searched.
        program: String,
        /// Built-in backends of the program.
        built_in: String,
        /// Searched locations.
        looked: String,
        /// A hint: a sentence with a leading space, or empty.
        hint: String,
    },
    /// It cannot be started.
    #[error("{} cannot be started: {source}{}", program.display(), first_line(source))]
    NotStarted {
        /// The program.
        program: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// No driver listens on the socket.
    #[error(
        "no driver listens at the socket {}: {source}. Start the driver that belongs to it (`mapper-backend-NAME --socket PATH`), or remove the file: a \
         driver that is found as a program is started then",
        socket.display()
    )]
    Away {
        /// The socket.
        socket: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The program is not executable.
    #[error("{} is there, but may not be executed; `chmod +x {}`", program.display(), program.display())]
    NotExecutable {
        /// The program.
        program: PathBuf,
    },
    /// The driver's protocol version is incompatible.
    #[error("it speaks version {}.{} of the protocol; this program speaks {}.{}. Use a driver of the same major version", theirs.major, theirs.minor, ours.major, ours.minor)]
    Version {
        /// Its version.
        theirs: Version,
        /// This program's version.
        ours: Version,
    },
    /// The response is not that of a driver.
    #[error("it is not a driver for mapper: {0}")]
    NoDriver(String),
    /// The driver reports a different name.
    #[error("it calls itself `{0}`; the program's file name has to end with the name of the driver")]
    Name(String),
    /// The driver's data are inconsistent.
    #[error(transparent)]
    Unusable(#[from] Unusable),
    /// The driver has exited or closed its output.
    #[error("the driver has ended{0}")]
    Ended(String),
    /// The driver sent an invalid message.
    #[error("the driver sent what no driver sends: {0}")]
    Garbage(String),
    /// The driver does not read its input.
    #[error("the driver does not read what it is sent")]
    Deaf,
    /// An error reported by the driver.
    #[error("{0}")]
    Message(String),
    /// The campaign contains a secret.
    #[error(
        "a secret does not belong into a campaign; write `{{env: NAME}}` and put it into the environment variable NAME"
    )]
    Secret,
    /// An environment variable is not set.
    #[error("the environment variable {0} is not set")]
    NotSet(String),
}

/// Hint on the usual cause if the system cannot start a script.
fn first_line(source: &std::io::Error) -> &'static str {
    /// Unix error code for a file that is neither a program nor a script with an interpreter line.
    const ENOEXEC: i32 = 8;
    match source.kind() {
        std::io::ErrorKind::NotFound => ", although it is there: look at the interpreter in its first line",
        _ if cfg!(unix) && source.raw_os_error() == Some(ENOEXEC) => {
            ": a script begins with its interpreter, as `#!/usr/bin/env python3`"
        }
        _ => "",
    }
}
