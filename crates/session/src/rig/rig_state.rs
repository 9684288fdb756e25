//! Ownership of rigs: a lock with its owner, and a lockout that must be acknowledged.
//!
//! Both are small files in one directory, named after the rig. The operating system releases the lock when the owning process ends in any way.
//! The owner's entry remains, so that a run that ended without releasing the rig is known.

use crate::SessionError;
use crate::recording::files::{Existing, json_text, write_file};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Maximum size of these files, bytes.
const READ_MAX: u64 = 64 << 10;

/// File name prefix of the lock for a rig's address.
const PLACE: &str = "at_";

/// Where an administrator may put locks and lockouts; kept over restarts and never cleaned.
const INSTALLED: &str = "/var/lib/mapper";

/// Where every user may write, and restarts leave files alone.
const SHARED: &str = "/var/tmp/mapper";

/// The directory for locks and lockouts that all users of a machine share, since several of them may drive one rig:
/// `/var/lib/mapper` if there is one, `/var/tmp/mapper`, or, on systems without these, that for temporary files.
pub fn shared_state() -> PathBuf {
    let shared = Path::new(SHARED);
    match Path::new(INSTALLED) {
        installed if installed.is_dir() => installed.to_owned(),
        _ if shared.parent().is_some_and(Path::is_dir) => shared.to_owned(),
        _ => std::env::temp_dir().join("mapper"),
    }
}

/// Current or last owner of a rig.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// Process ID.
    pub process: u32,
    /// Host name; empty if unknown.
    pub host: String,
    /// Directory of the run.
    pub run: PathBuf,
    /// Start time, as in the name of the run directory.
    pub started: String,
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "process {} on {} (run {}, started {})",
            self.process,
            self.host,
            self.run.display(),
            self.started
        )
    }
}

/// Reason of a lockout.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latch {
    /// What happened.
    pub reason: String,
    /// Directory of the run.
    pub run: PathBuf,
}

/// Locks and lockouts of rigs.
#[derive(Debug, Clone)]
pub struct RigStates {
    directory: PathBuf,
    /// Whether every user of the machine may write to them.
    shared: bool,
}

/// A rig locked by this process. If dropped without [`release`](Claim::release), the owner's entry remains and the rig needs acknowledgement.
#[derive(Debug)]
pub struct Claim {
    states: RigStates,
    rig: String,
    lock: File,
}

/// Status of a rig.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RigStatus {
    /// The rig.
    pub rig: String,
    /// The current owner, or the one that ended without releasing the rig.
    pub owner: Option<Owner>,
    /// Whether the owner is still running.
    pub in_use: bool,
    /// Lockout that prevents further runs.
    pub latch: Option<Latch>,
}

impl RigStates {
    /// States in a directory, which is created on demand. Only in that of [`shared_state`] may others write: a directory that was
    /// given may hold keys and sockets as well.
    pub fn new(directory: &Path) -> Self {
        RigStates { directory: directory.to_owned(), shared: directory == shared_state() }
    }

    fn file(&self, rig: &str, extension: &str) -> PathBuf {
        let harmless = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = rig.chars().take(100).map(harmless).collect();
        self.directory.join(format!("rig-{name}.{extension}"))
    }

    /// Opens a rig's lock; creates it, and the directory, on demand.
    fn open(&self, rig: &str) -> Result<(File, PathBuf), SessionError> {
        make_directory(&self.directory, self.shared)
            .map_err(SessionError::file("create", &self.directory))?;
        let path = self.file(rig, "lock");
        let file = open_plain(&path).or_else(|error| match error.kind() {
            ErrorKind::NotFound => match create_new(&path, self.shared) {
                // Another runner was faster.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => open_plain(&path),
                created => created,
            },
            _ => Err(error),
        });
        Ok((file.map_err(SessionError::file("open", &path))?, path))
    }

    /// Locks a rig. An abandoned run is not an obstacle if it is the run in `resumes`.
    ///
    /// # Errors
    /// [`SessionError::RigInUse`], [`SessionError::RigAbandoned`] and [`SessionError::RigLatched`] with the known facts; [`SessionError::File`]
    /// for system errors.
    pub fn claim(&self, rig: &str, resumes: Option<&Path>) -> Result<Claim, SessionError> {
        let (mut lock, path) = self.open(rig)?;
        lock_or_name_owner(rig, &mut lock, &path)?;
        if let Some(Latch { reason, run }) = self.latch_of(rig) {
            return Err(SessionError::RigLatched { rig: rig.to_owned(), reason, run });
        }
        let owner = match read_entry::<Owner>(&mut lock) {
            Entry::Is(owner) => Some(owner),
            Entry::Empty => None,
            Entry::Unreadable(why) => {
                let reason =
                    format!("the entry of its last owner cannot be read ({why}: {})", path.display());
                return Err(SessionError::RigLatched { rig: rig.to_owned(), reason, run: PathBuf::new() });
            }
        };
        if let Some(owner) = owner.filter(|owner| resumes.is_none_or(|run| !same_place(run, &owner.run))) {
            return Err(SessionError::RigAbandoned {
                rig: rig.to_owned(),
                run: owner.run.clone(),
                owner: owner.to_string(),
            });
        }
        Ok(Claim { states: self.clone(), rig: rig.to_owned(), lock })
    }

    /// The lockout of a rig; one that cannot be read still locks the rig out.
    fn latch_of(&self, rig: &str) -> Option<Latch> {
        let path = self.file(rig, "latch");
        let unreadable = |why: String| Latch {
            reason: format!("its lockout cannot be read ({why}: {})", path.display()),
            run: PathBuf::new(),
        };
        match open_plain(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => Some(unreadable(error.to_string())),
            Ok(mut file) => Some(match read_entry(&mut file) {
                Entry::Is(latch) => latch,
                Entry::Empty => unreadable("it is empty".to_owned()),
                Entry::Unreadable(why) => unreadable(why),
            }),
        }
    }

    /// Status of a rig.
    ///
    /// # Errors
    /// [`SessionError::File`] for system errors.
    pub fn status(&self, rig: &str) -> Result<RigStatus, SessionError> {
        if !self.file(rig, "lock").exists() {
            return Ok(RigStatus {
                rig: rig.to_owned(),
                owner: None,
                in_use: false,
                latch: self.latch_of(rig),
            });
        }
        let (mut lock, _) = self.open(rig)?;
        let in_use = matches!(lock.try_lock(), Err(TryLockError::WouldBlock));
        let (owner, unreadable) = match read_entry(&mut lock) {
            Entry::Is(owner) => (Some(owner), None),
            // A runner that has just begun has not signed yet.
            Entry::Empty => (None, None),
            Entry::Unreadable(_) if in_use => (None, None),
            Entry::Unreadable(why) => (None, Some(why)),
        };
        let latch = self.latch_of(rig).or_else(|| {
            let reason = format!("the entry of its last owner cannot be read ({})", unreadable?);
            Some(Latch { reason, run: PathBuf::new() })
        });
        Ok(RigStatus { rig: rig.to_owned(), owner, in_use, latch })
    }

    /// All rigs used so far, by file name.
    pub fn known(&self) -> Vec<RigStatus> {
        let entries = std::fs::read_dir(&self.directory).into_iter().flatten().flatten();
        let name = |file: String| {
            let (name, kind) = file.strip_prefix("rig-")?.rsplit_once('.')?;
            (matches!(kind, "lock" | "latch") && !name.starts_with(PLACE)).then(|| name.to_owned())
        };
        let files = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let names = files.filter_map(name).collect::<BTreeSet<_>>();
        names.iter().filter_map(|name| self.status(name).ok()).collect()
    }

    /// Rigs that wait for acknowledgement.
    fn in_doubt(&self) -> Vec<String> {
        let waits = |status: &RigStatus| status.latch.is_some() || (status.owner.is_some() && !status.in_use);
        self.known().into_iter().filter(waits).map(|status| status.rig).collect()
    }

    /// Acknowledges that the rig was inspected, so that the next run may begin.
    ///
    /// # Errors
    /// [`SessionError::RigInUse`] during a run; [`SessionError::NothingToAcknowledge`] if the rig needs no acknowledgement;
    /// [`SessionError::File`] for system errors.
    pub fn acknowledge(&self, rig: &str) -> Result<RigStatus, SessionError> {
        let status = self.status(rig)?;
        if status.owner.is_none() && status.latch.is_none() && !status.in_use {
            return Err(SessionError::NothingToAcknowledge {
                rig: rig.to_owned(),
                in_doubt: self.in_doubt(),
            });
        }
        if status.in_use {
            let owner = status.owner.map_or("another runner".to_owned(), |owner| owner.to_string());
            return Err(SessionError::RigInUse { rig: rig.to_owned(), owner });
        }
        // The lock is held meanwhile, so that no run begins between the look and the removal.
        let (mut lock, path) = self.open(rig)?;
        lock_or_name_owner(rig, &mut lock, &path)?;
        let latch = self.file(rig, "latch");
        match std::fs::remove_file(&latch) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(SessionError::file("remove", &latch)(error));
            }
            _ => {}
        }
        lock.set_len(0).and_then(|()| lock.sync_all()).map_err(SessionError::file("write", &path))?;
        Ok(status)
    }
}

impl Claim {
    /// Records the owner of the rig.
    ///
    /// # Errors
    /// [`SessionError::File`] for system errors.
    pub fn sign(&mut self, owner: &Owner) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "lock");
        let text = json_text(owner)?;
        self.write(text.as_bytes()).map_err(SessionError::file("write", &path))
    }

    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.lock.rewind()?;
        self.lock.set_len(0)?;
        self.lock.write_all(bytes)?;
        self.lock.sync_all()
    }

    /// Prevents further runs until this lockout is acknowledged.
    ///
    /// # Errors
    /// [`SessionError::File`] for system errors.
    pub fn latch(&self, latch: &Latch) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "latch");
        let text = json_text(latch)?;
        write_file(&path, text.as_bytes(), Existing::Replaced)
    }

    /// Releases the rig in a safe state.
    ///
    /// # Errors
    /// [`SessionError::File`] for system errors.
    pub fn release(mut self) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "lock");
        self.write(b"").map_err(SessionError::file("write", &path))
    }
}

/// Whether two paths refer to the same directory.
fn same_place(a: &Path, b: &Path) -> bool {
    let resolved = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    resolved(a) == resolved(b)
}

/// Locks the file of a rig.
fn lock_or_name_owner(rig: &str, lock: &mut File, path: &Path) -> Result<(), SessionError> {
    match lock.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => {
            let owner = match read_entry::<Owner>(lock) {
                Entry::Is(owner) => owner.to_string(),
                Entry::Empty | Entry::Unreadable(_) => "another runner".to_owned(),
            };
            Err(SessionError::RigInUse { rig: rig.to_owned(), owner })
        }
        Err(TryLockError::Error(source)) => Err(SessionError::file("lock", path)(source)),
    }
}

/// What a file holds.
enum Entry<T> {
    Empty,
    Is(T),
    Unreadable(String),
}

fn read_entry<T: for<'de> Deserialize<'de>>(file: &mut File) -> Entry<T> {
    let mut text = String::new();
    match file.rewind().and_then(|()| file.take(READ_MAX).read_to_string(&mut text)) {
        Err(error) => Entry::Unreadable(error.to_string()),
        Ok(_) if text.is_empty() => Entry::Empty,
        Ok(_) => {
            serde_json::from_str(&text).map_or_else(|error| Entry::Unreadable(error.to_string()), Entry::Is)
        }
    }
}

/// Opens a file for reading and writing that is a plain file under one name: a link placed there could make a run
/// overwrite what it points to.
fn open_plain(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // Without waiting for the other end of a pipe.
        let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
        options.custom_flags(i32::try_from(flags.bits()).unwrap_or_default());
    }
    let file = options.open(path)?;
    let about = file.metadata()?;
    #[cfg(unix)]
    let linked = std::os::unix::fs::MetadataExt::nlink(&about) > 1;
    #[cfg(not(unix))]
    let linked = false;
    if !about.is_file() || linked {
        return Err(io::Error::other("it is a link or no plain file; remove it"));
    }
    Ok(file)
}

/// Creates a file; one that is shared every user of the machine may lock.
fn create_new(path: &Path, shared: bool) -> io::Result<File> {
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
    if shared {
        share(path, 0o666)?;
    }
    Ok(file)
}

/// Creates a directory; in one that is shared every user may create files, and remove those of others: whoever has looked at the rig
/// may acknowledge.
fn make_directory(path: &Path, shared: bool) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    std::fs::create_dir_all(path)?;
    if shared { share(path, 0o777) } else { Ok(()) }
}

#[cfg(unix)]
fn share(path: &Path, mode: u32) -> io::Result<()> {
    std::fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(mode))
}

#[cfg(not(unix))]
fn share(_: &Path, _: u32) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owner(run: &str) -> Owner {
        Owner {
            process: 7,
            host: "cell-3".to_owned(),
            run: run.into(),
            started: "20261122T101500Z".to_owned(),
        }
    }

    #[test]
    fn one_runner_has_a_rig_and_one_that_died_is_explained() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let mut first = states.claim("opc.tcp://bench:4840", None).unwrap();
        first.sign(&owner("runs/a")).unwrap();
        let second = states.claim("opc.tcp://bench:4840", None).unwrap_err().to_string();
        assert!(second.contains("process 7 on cell-3") && second.contains("runs/a"), "{second}");
        assert!(states.claim("another", None).is_ok());
        // A rig in use cannot be acknowledged.
        assert!(matches!(states.acknowledge("opc.tcp://bench:4840"), Err(SessionError::RigInUse { .. })));
        // Dropping without release leaves the same state as a killed process.
        drop(first);
        let stale = states.claim("opc.tcp://bench:4840", None).unwrap_err();
        assert!(matches!(stale, SessionError::RigAbandoned { .. }), "{stale}");
        let resumed = states.claim("opc.tcp://bench:4840", Some(Path::new("runs/a"))).unwrap();
        resumed.release().unwrap();
        states.claim("opc.tcp://bench:4840", None).unwrap().release().unwrap();
    }

    #[test]
    fn a_latch_holds_until_it_is_acknowledged() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let claim = states.claim("bench", None).unwrap();
        claim.latch(&Latch { reason: "overspeed".to_owned(), run: "runs/a".into() }).unwrap();
        claim.release().unwrap();
        for _ in 0..2 {
            let refused = states.claim("bench", Some(Path::new("runs/a"))).unwrap_err().to_string();
            assert!(
                refused.contains("overspeed") && refused.contains("mapper rig acknowledge bench"),
                "{refused}"
            );
        }
        let typo = states.acknowledge("bensh").unwrap_err().to_string();
        assert!(typo.contains("`bensh`") && typo.contains("in doubt: bench"), "{typo}");
        assert_eq!(states.acknowledge("bench").unwrap().latch.unwrap().reason, "overspeed");
        let again = states.acknowledge("bench").unwrap_err().to_string();
        assert!(again.contains("no rig is in doubt"), "{again}");
        assert!(states.claim("bench", None).is_ok());
    }

    #[test]
    fn what_cannot_be_read_locks_out() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        for (file, bytes) in [
            ("rig-bench.latch", &b""[..]),
            ("rig-bench.latch", b"{\"reason\": 7}"),
            ("rig-bench.latch", b"\xff\xfe"),
            ("rig-bench.lock", b"{\"process\": 7"),
            ("rig-bench.lock", b"\xff\xfe"),
        ] {
            states.claim("bench", None).unwrap().release().unwrap();
            std::fs::write(directory.path().join(file), bytes).unwrap();
            let refused = states.claim("bench", None).unwrap_err();
            assert!(matches!(refused, SessionError::RigLatched { .. }), "{file}: {refused}");
            assert!(states.status("bench").unwrap().latch.is_some(), "{file}");
            states.acknowledge("bench").unwrap();
        }
        states.claim("bench", None).unwrap().release().unwrap();
    }

    /// A link in the place of a lock or lockout must not make a run write to its target.
    #[cfg(unix)]
    #[test]
    fn links_are_not_followed() {
        let directory = tempfile::tempdir().unwrap();
        let victim = directory.path().join("victim");
        for hard in [false, true] {
            let states = RigStates::new(&directory.path().join(format!("states-{hard}")));
            std::fs::create_dir(&states.directory).unwrap();
            std::fs::write(&victim, "kept").unwrap();
            let link = states.file("bench", "lock");
            if hard { std::fs::hard_link(&victim, link) } else { std::os::unix::fs::symlink(&victim, link) }
                .unwrap();
            assert!(states.claim("bench", None).is_err());
            assert_eq!(std::fs::read_to_string(&victim).unwrap(), "kept");
            let states = RigStates::new(&directory.path().join(format!("latches-{hard}")));
            let claim = states.claim("bench", None).unwrap();
            let link = states.file("bench", "latch");
            if hard { std::fs::hard_link(&victim, link) } else { std::os::unix::fs::symlink(&victim, link) }
                .unwrap();
            claim.latch(&Latch { reason: "overspeed".to_owned(), run: "runs/a".into() }).unwrap();
            assert_eq!(std::fs::read_to_string(&victim).unwrap(), "kept");
        }
    }

    /// Whoever acknowledges and whoever begins a run at the same time cannot both succeed in having the lock file.
    #[test]
    fn acknowledging_leaves_the_lock_in_its_place() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let mut first = states.claim("bench", None).unwrap();
        first.sign(&owner("runs/a")).unwrap();
        drop(first);
        states.acknowledge("bench").unwrap();
        let second = states.claim("bench", None).unwrap();
        assert!(matches!(states.claim("bench", None), Err(SessionError::RigInUse { .. })));
        assert!(matches!(states.acknowledge("bench"), Err(SessionError::RigInUse { .. })));
        second.release().unwrap();
    }
}
