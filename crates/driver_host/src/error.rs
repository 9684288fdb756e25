//! Driver errors before the rig is available.

use crate::protocol::{InvalidData, Version};
use std::path::PathBuf;

/// A missing or unusable driver.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum DriverError {
    /// `hint`: a sentence with a leading space, or empty.
    #[error(
        "there is no such backend. Built in: {built_in}. A driver would be a program `{program}`, which is not in {searched}{hint}"
    )]
    NotFound { program: String, built_in: String, searched: String, hint: String },
    #[error("{} cannot be started: {source}{}", program.display(), start_hint(source))]
    NotStarted { program: PathBuf, source: std::io::Error },
    #[error(
        "no driver listens at the socket {}: {source}. Start its driver (`mapper-backend-NAME --socket PATH`), or remove the file, so that the \
                 driver is started as a program",
        socket.display()
    )]
    NotListening { socket: PathBuf, source: std::io::Error },
    #[error("{} exists, but is not executable; run `chmod +x {}`", program.display(), program.display())]
    NotExecutable { program: PathBuf },
    #[error("it uses version {}.{} of the protocol; this program uses {}.{}. Use a driver with the same major version", theirs.major, theirs.minor, ours.major, ours.minor)]
    Version { theirs: Version, ours: Version },
    #[error("it is not a driver for mapper: {0}")]
    NotADriver(String),
    #[error("it reports the name `{0}`; the file name of the program has to end with this name")]
    Name(String),
    #[error(transparent)]
    InvalidData(#[from] InvalidData),
    /// The text continues the sentence, or is empty.
    #[error("the driver has ended{0}")]
    Ended(String),
    #[error("the driver sent an invalid message: {0}")]
    InvalidMessage(String),
    #[error("the driver does not read its input")]
    NotReading,
    /// An error reported by the driver.
    #[error("{0}")]
    Message(String),
    #[error(
        "a campaign must not contain a secret; write `{{env: NAME}}` and set the environment variable NAME"
    )]
    Secret,
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
