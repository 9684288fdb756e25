//! Where drivers are found: on the search path, at an address, and those that are included; driver errors before the rig is available.

use crate::protocol::{InvalidData, Version};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Prefix of a driver's file name; the remainder is the name in campaigns.
pub const PREFIX: &str = "mapper-backend-";
/// Suffix of a socket's file name; the remainder is the name in campaigns.
const SOCKET: &str = ".socket";

/// Search locations of drivers.
#[derive(Debug, Clone, Default)]
pub struct SearchPath {
    /// Program directories in search order.
    pub programs: Vec<PathBuf>,
    /// Directory of driver sockets, which take precedence over programs.
    pub sockets: Option<PathBuf>,
}

/// Location of a driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Endpoint {
    /// A program that is started for each run.
    Program(PathBuf),
    /// The socket of a driver that is already running.
    Socket(PathBuf),
}

/// An available driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DriverLocation {
    /// Name in campaigns.
    pub name: String,
    /// Its location.
    pub at: Endpoint,
}

impl SearchPath {
    /// The directory of `program`, the directories of a `PATH` variable, and a directory of sockets.
    pub fn new(program: Option<&Path>, path: Option<&OsStr>, sockets: Option<PathBuf>) -> SearchPath {
        let program_directory = program.and_then(Path::parent).map(Path::to_owned);
        let on_path = path.map(|path| std::env::split_paths(path).collect::<Vec<_>>()).unwrap_or_default();
        let mut programs: Vec<PathBuf> = Vec::new();
        // A relative or empty entry would depend on the working directory.
        for directory in
            program_directory.into_iter().chain(on_path).filter(|directory| directory.is_absolute())
        {
            if !programs.contains(&directory) {
                programs.push(directory);
            }
        }
        SearchPath { programs, sockets: sockets.filter(|directory| directory.is_absolute()) }
    }

    /// The driver for `backend: NAME`.
    pub fn find(&self, name: &str) -> Option<Endpoint> {
        let file = file_name(name)?;
        let socket = self.sockets.as_ref().map(|directory| directory.join(format!("{name}{SOCKET}")));
        let socket = socket.filter(|socket| is_socket(socket)).map(Endpoint::Socket);
        let program = || {
            self.programs.iter().map(|directory| directory.join(&file)).find(|program| is_program(program))
        };
        socket.or_else(|| program().map(Endpoint::Program))
    }

    pub(crate) fn find_not_executable(&self, name: &str) -> Option<PathBuf> {
        let file = file_name(name)?;
        self.programs.iter().map(|directory| directory.join(&file)).find(|program| program.is_file())
    }

    /// All drivers by name. If several have the same name, only the first in search order is listed.
    pub fn all(&self) -> Vec<DriverLocation> {
        let mut drivers: Vec<DriverLocation> = Vec::new();
        let entries = |directory: &PathBuf| directory.read_dir().into_iter().flatten().flatten();
        for entry in self.sockets.iter().flat_map(entries) {
            let file = entry.file_name();
            let Some(name) = file.to_str().and_then(|file| file.strip_suffix(SOCKET)) else { continue };
            if file_name(name).is_some() && is_socket(&entry.path()) {
                drivers.push(DriverLocation { name: name.to_owned(), at: Endpoint::Socket(entry.path()) });
            }
        }
        for entry in self.programs.iter().flat_map(entries) {
            let file = entry.file_name();
            let Some(name) = file.to_str().and_then(|file| file.strip_prefix(PREFIX)) else { continue };
            let name = name.strip_suffix(std::env::consts::EXE_SUFFIX).unwrap_or(name);
            let is_listed = drivers.iter().any(|driver| driver.name == name);
            if !is_listed
                && file_name(name).is_some_and(|expected| *expected == *file)
                && is_program(&entry.path())
            {
                drivers.push(DriverLocation { name: name.to_owned(), at: Endpoint::Program(entry.path()) });
            }
        }
        drivers.sort_by(|a, b| a.name.cmp(&b.name));
        drivers
    }
}

/// The file name of a driver; `None` for an invalid name. The name comes from a campaign and must not lead to another directory.
pub(crate) fn file_name(name: &str) -> Option<String> {
    let is_allowed = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
    let is_name = !name.is_empty() && name.len() <= 64 && name.chars().all(is_allowed);
    is_name.then(|| format!("{PREFIX}{name}{}", std::env::consts::EXE_SUFFIX))
}

#[cfg(unix)]
fn is_program(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    path.metadata().is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
}

#[cfg(unix)]
fn is_socket(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|file| file.file_type().is_socket())
}

#[cfg(not(unix))]
fn is_program(path: &Path) -> bool {
    path.is_file()
}

#[cfg(not(unix))]
fn is_socket(_: &Path) -> bool {
    false
}

/// Drivers that come with the source and are built separately: name, purpose, build command.
pub const INCLUDED_DRIVERS: &[(&str, &str, &str)] = &[
    (
        "lab",
        "the virtual lab as a driver, for rehearsals",
        "cargo build --release --locked -p mapper-backend-lab",
    ),
    (
        "modbus",
        "a PLC with Modbus TCP, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-modbus",
    ),
    (
        "ak",
        "an instrument, read only, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-ak",
    ),
    (
        "opcua",
        "a PLC with OPC UA, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-opcua",
    ),
];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_name_is_not_a_path() {
        assert!(file_name("opc_ua2").is_some());
        for name in ["", "../x", "a/b", "A", "a.exe", "a b", "a\0", &"a".repeat(65)] {
            assert_eq!(file_name(name), None, "{name:?}");
        }
    }

    #[test]
    fn relative_directories_are_not_searched() {
        let path = std::env::join_paths(["", "here", "/usr/bin", "/usr/bin"]).unwrap();
        let places =
            SearchPath::new(Some(Path::new("/opt/mapper/mapper")), Some(&path), Some("drivers".into()));
        assert_eq!(places.programs, [Path::new("/opt/mapper"), Path::new("/usr/bin")]);
        assert_eq!(places.sockets, None);
    }
}
