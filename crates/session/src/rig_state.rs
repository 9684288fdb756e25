//! Who has a rig, and whether it may be had at all: a lock with its owner, and a latch that somebody has to acknowledge.
//!
//! Both are small files in one directory, named after the rig. The lock is one of the operating system: it goes with the process
//! that has it, however that ends. What its owner wrote stays, so that a runner that died with the rig in its hands is known.

use crate::SessionError;
use crate::files::json_text;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Largest of these files that is read, bytes.
const READ_MAX: u64 = 64 << 10;

/// How the lock of a place is named, as a file, where a rig is reached.
const PLACE: &str = "at_";

/// Who runs, or ran, a rig.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// Number of the process.
    pub process: u32,
    /// Name of the computer; empty where it is not known.
    pub host: String,
    /// Directory of the run.
    pub run: PathBuf,
    /// When it started, as the name of the run's directory has it.
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

/// Why a rig is latched.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latch {
    /// What happened.
    pub reason: String,
    /// Directory of the run.
    pub run: PathBuf,
}

/// Locks and latches of rigs.
#[derive(Debug, Clone)]
pub struct RigStates {
    directory: PathBuf,
}

/// A rig that this process has. Dropping it without [`release`](Claim::release) leaves the owner's name: the rig is in doubt.
#[derive(Debug)]
pub struct Claim {
    states: RigStates,
    rig: String,
    lock: File,
}

/// What is known of a rig.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RigStatus {
    /// The rig.
    pub rig: String,
    /// Who has it, or had it when it died.
    pub owner: Option<Owner>,
    /// Whether the owner is still there.
    pub in_use: bool,
    /// Why no run may begin.
    pub latch: Option<Latch>,
}

impl RigStates {
    /// The states in a directory, which is made when it is needed.
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

    /// Takes a rig. A runner that died with it is no obstacle where `resumes` is its run.
    ///
    /// # Errors
    /// [`SessionError::RigInUse`], [`SessionError::RigAbandoned`] and [`SessionError::RigLatched`] with what is known;
    /// [`SessionError::File`] as the system says.
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
        // A latch that cannot be read is a latch all the same.
        let unreadable = Latch { reason: "the latch cannot be read".to_owned(), run: PathBuf::new() };
        Some(read_json(&mut file).unwrap_or(unreadable))
    }

    /// What is known of a rig.
    ///
    /// # Errors
    /// [`SessionError::File`] as the system says.
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

    /// All rigs that a run has had, as their files are named.
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

    /// Those that wait for somebody to look at them.
    fn in_doubt(&self) -> Vec<String> {
        let waits = |status: &RigStatus| status.latch.is_some() || (status.owner.is_some() && !status.in_use);
        self.known().into_iter().filter(waits).map(|status| status.rig).collect()
    }

    /// Somebody has looked at the rig: the next run may begin.
    ///
    /// # Errors
    /// [`SessionError::RigInUse`] where a run is under way; [`SessionError::NothingToAcknowledge`] where the rig is in no doubt;
    /// [`SessionError::File`] as the system says.
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
    /// Writes down who has the rig.
    ///
    /// # Errors
    /// [`SessionError::File`] as the system says.
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

    /// Lets no further run begin before somebody has acknowledged this.
    ///
    /// # Errors
    /// [`SessionError::File`] as the system says.
    pub fn latch(&self, latch: &Latch) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "latch");
        let text = json_text(latch)?;
        std::fs::write(&path, text).map_err(SessionError::file("write", &path))
    }

    /// Gives the rig back: it is safe.
    ///
    /// # Errors
    /// [`SessionError::File`] as the system says.
    pub fn release(mut self) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "lock");
        self.write(b"").map_err(SessionError::file("write", &path))
    }
}

/// Whether two paths are one directory, however they are written.
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
        // In use, it is not acknowledged either.
        assert!(matches!(states.acknowledge("opc.tcp://bench:4840"), Err(SessionError::RigInUse { .. })));
        // Dropped, not released: what a kill leaves.
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
