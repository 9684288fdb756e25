//! What goes wrong with a driver before it is a rig.

use mapper_protocol::{Unusable, Version};
use std::path::PathBuf;

/// Why there is no driver, or why it cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// No program of this name.
    #[error(
        "there is no such backend. Built in: {built_in}. A driver would be a program `{program}`, which is not in {looked}{hint}"
    )]
    NotFound {
        /// File name looked for.
        program: String,
        /// Backends of the program itself.
        built_in: String,
        /// Where was looked.
        looked: String,
        /// What else may help, a sentence with its blank before it, or nothing.
        hint: String,
    },
    /// It cannot be started.
    #[error("{} cannot be started: {source}{}", program.display(), first_line(source))]
    NotStarted {
        /// The program.
        program: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Nobody listens at its socket.
    #[error(
        "nobody listens at the socket {}: {source}. Start the driver that belongs to it (`mapper-backend-NAME --socket PATH`), or remove the file: a \
         driver that is found as a program is started then",
        socket.display()
    )]
    Away {
        /// The socket.
        socket: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The program may not be started.
    #[error("{} is there, but may not be executed; `chmod +x {}`", program.display(), program.display())]
    NotExecutable {
        /// The program.
        program: PathBuf,
    },
    /// It is no driver, or one of another time.
    #[error("it speaks version {}.{} of the protocol; this program speaks {}.{}. Use a driver of the same major version", theirs.major, theirs.minor, ours.major, ours.minor)]
    Version {
        /// Its version.
        theirs: Version,
        /// Ours.
        ours: Version,
    },
    /// It answers with something else.
    #[error("it is not a driver for mapper: {0}")]
    NoDriver(String),
    /// It calls itself otherwise.
    #[error("it calls itself `{0}`; the program's file name has to end with the name of the driver")]
    Name(String),
    /// What it says cannot be.
    #[error(transparent)]
    Unusable(#[from] Unusable),
    /// It has ended, or closed its output.
    #[error("the driver has ended{0}")]
    Ended(String),
    /// It sent what is not a message.
    #[error("the driver sent what no driver sends: {0}")]
    Garbage(String),
    /// It does not read what it is sent.
    #[error("the driver does not read what it is sent")]
    Deaf,
    /// Its own words.
    #[error("{0}")]
    Said(String),
    /// A secret in the campaign.
    #[error(
        "a secret does not belong into a campaign; write `{{env: NAME}}` and put it into the environment variable NAME"
    )]
    Secret,
    /// A variable that is not set.
    #[error("the environment variable {0} is not set")]
    NotSet(String),
}

/// What is usual for a script that the system does not start.
fn first_line(source: &std::io::Error) -> &'static str {
    /// Of Unix: neither a program nor a script with a first line.
    const ENOEXEC: i32 = 8;
    match source.kind() {
        std::io::ErrorKind::NotFound => ", although it is there: look at the interpreter in its first line",
        _ if cfg!(unix) && source.raw_os_error() == Some(ENOEXEC) => {
            ": a script begins with its interpreter, as `#!/usr/bin/env python3`"
        }
        _ => "",
    }
}
