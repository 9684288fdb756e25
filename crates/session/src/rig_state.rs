//! Ownership of rigs: a lock with its owner, and a lockout that must be acknowledged.
//!
//! Both are small files in one directory, named after the rig. The operating system releases the lock when the owning process ends in any way.
//! The owner's entry remains, so that a run that ended without releasing the rig is known.

use crate::SessionError;
use crate::files::json_text;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Maximum size of these files, bytes.
const READ_MAX: u64 = 64 << 10;

/// File name prefix of the lock for a rig's address.
const PLACE: &str = "at_";

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
    /// States in a directory, which is created on demand.
    pub fn new(directory: &Path) -> Self {
        RigStates { directory: directory.to_owned() }
    }

    fn file(&self, rig: &str, extension: &str) -> PathBuf {
        let harmless = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = rig.chars().take(100).map(harmless).collect();
        self.directory.join(format!("rig-{name}.{extension}"))
    }

    fn open(&self, rig: &str) -> Result<(File, PathBuf), SessionError> {
        std::fs::create_dir_all(&self.directory).map_err(SessionError::file("create", &self.directory))?;
        let path = self.file(rig, "lock");
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        Ok((file.map_err(SessionError::file("open", &path))?, path))
    }

    /// Locks a rig. An abandoned run is no obstacle if it is the run in `resumes`.
    ///
    /// # Errors
    /// [`SessionError::RigInUse`], [`SessionError::RigAbandoned`] and [`SessionError::RigLatched`] with the known facts; [`SessionError::File`]
    /// for system errors.
    pub fn claim(&self, rig: &str, resumes: Option<&Path>) -> Result<Claim, SessionError> {
        let (mut lock, path) = self.open(rig)?;
        let locked = lock.try_lock();
        let owner = read_json::<Owner>(&mut lock);
        match locked {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let owner = owner.map_or("another runner".to_owned(), |owner| owner.to_string());
                return Err(SessionError::RigInUse { rig: rig.to_owned(), owner });
            }
            Err(TryLockError::Error(source)) => return Err(SessionError::file("lock", &path)(source)),
        }
        if let Some(Latch { reason, run }) = self.latch_of(rig) {
            return Err(SessionError::RigLatched { rig: rig.to_owned(), reason, run });
        }
        if let Some(owner) = owner.filter(|owner| resumes.is_none_or(|run| !same_place(run, &owner.run))) {
            return Err(SessionError::RigAbandoned {
                rig: rig.to_owned(),
                run: owner.run.clone(),
                owner: owner.to_string(),
            });
        }
        Ok(Claim { states: self.clone(), rig: rig.to_owned(), lock })
    }

    fn latch_of(&self, rig: &str) -> Option<Latch> {
        let path = self.file(rig, "latch");
        let mut file = File::open(path).ok()?;
        // An unreadable lockout file still locks the rig out.
        let unreadable = Latch { reason: "the latch cannot be read".to_owned(), run: PathBuf::new() };
        Some(read_json(&mut file).unwrap_or(unreadable))
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
        let owner = read_json(&mut lock);
        Ok(RigStatus { rig: rig.to_owned(), owner, in_use, latch: self.latch_of(rig) })
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
        for extension in ["latch", "lock"] {
            let path = self.file(rig, extension);
            match std::fs::remove_file(&path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(SessionError::file("remove", &path)(error));
                }
                _ => {}
            }
        }
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
        std::fs::write(&path, text).map_err(SessionError::file("write", &path))
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

fn read_json<T: for<'de> Deserialize<'de>>(file: &mut File) -> Option<T> {
    let mut text = String::new();
    file.rewind().ok()?;
    file.take(READ_MAX).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
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
}
