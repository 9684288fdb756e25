//! Ownership of rigs: a lock with its owner, and a lockout that must be acknowledged; exclusive locks on the rig and auxiliary instruments of a
//! run.
//!
//! Both are small files in one directory. Their names are different for different rigs, and each contains the name of its rig. The operating
//! system releases the lock when the owning process ends in any way. The owner's entry remains, so that a run that ended without releasing the
//! rig is known.

use crate::SessionError;
use crate::recording::files::{Existing, json_text, write_file};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Maximum size of these files, bytes.
const MAX_FILE_BYTES: u64 = 64 << 10;

/// Prefix of the name of the lock for a rig's address.
pub(crate) const ADDRESS_PREFIX: &str = "at ";

/// Directory that an administrator may create for locks and lockouts. It survives restarts and is never cleaned.
const SYSTEM_DIRECTORY: &str = "/var/lib/mapper";

/// Directory that every user may create. It survives restarts.
const FALLBACK_DIRECTORY: &str = "/var/tmp/mapper";

/// The directory for locks and lockouts, shared by all users: `/var/lib/mapper` if it exists, else `/var/tmp/mapper`, or a temporary one.
pub fn shared_state_directory() -> PathBuf {
    let shared = Path::new(FALLBACK_DIRECTORY);
    match Path::new(SYSTEM_DIRECTORY) {
        installed if installed.is_dir() => installed.to_owned(),
        _ if shared.parent().is_some_and(Path::is_dir) => shared.to_owned(),
        _ => std::env::temp_dir().join("mapper"),
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    pub process: u32,
    /// Host name; empty if unknown.
    pub host: String,
    pub run: PathBuf,
    /// Start time, as in the name of the run directory.
    pub started: String,
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Owner { process, host, run, started } = self;
        write!(f, "process {process} on {host} (run {}, started {started})", run.display())
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lockout {
    pub reason: String,
    /// Directory of the run; empty if it is unknown.
    pub run: PathBuf,
}

#[derive(Serialize, Deserialize)]
struct Entry<T> {
    rig: String,
    content: T,
}

/// Locks and lockouts of rigs.
#[derive(Debug, Clone)]
pub struct RigStates {
    directory: PathBuf,
    shared: bool,
}

/// A rig locked by this process. If dropped without [`release`](Claim::release), the owner's entry remains and the rig needs acknowledgement.
#[derive(Debug)]
pub struct Claim {
    states: RigStates,
    rig: String,
    lock: File,
    /// Whether an earlier run, the one that is resumed, has not released it.
    pub(crate) is_abandoned: bool,
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
    pub latch: Option<Lockout>,
}

impl RigStates {
    /// States in a directory, created on demand. Others may write only to the [`shared_state_directory`]: any other may contain keys.
    pub fn new(directory: &Path) -> Self {
        RigStates { directory: directory.to_owned(), shared: directory == shared_state_directory() }
    }

    /// A file of this rig alone. Names that differ in other letters, in capitals or after a hundred letters have different hashes.
    fn file(&self, rig: &str, extension: &str) -> PathBuf {
        let hash = mapper_planner::sha256_hex(rig);
        self.directory.join(format!("rig-{}~{hash}.{extension}", readable(rig)))
    }

    /// Why a file may mean this rig or another one, by its name or content. It locks the rig out, and no acknowledgement removes it.
    fn doubtful_file(&self, rig: &str) -> Option<String> {
        let doubt = |path: &Path, why: &str| {
            let path = path.display();
            Some(format!("{path} {why}; inspect every rig that it may mean, then remove the file"))
        };
        ["lock", "latch"].into_iter().find_map(|extension| {
            let own = self.file(rig, extension);
            if let Some(other) = named_rig(&own).filter(|name| name != rig) {
                return doubt(&own, &format!("contains the name of the rig `{other}`"));
            }
            let shared = self.directory.join(format!("rig-{}.{extension}", readable(rig)));
            let holds_something = std::fs::symlink_metadata(&shared).is_ok_and(|file| file.len() > 0);
            if holds_something { doubt(&shared, "has a name that several rigs may share") } else { None }
        })
    }

    fn open(&self, rig: &str) -> Result<(File, PathBuf), SessionError> {
        make_directory(&self.directory, self.shared)
            .map_err(SessionError::file("create", &self.directory))?;
        let path = self.file(rig, "lock");
        let file = open_plain(&path).or_else(|error| match error.kind() {
            ErrorKind::NotFound => match create_new(&path, self.shared) {
                // Another runner created it in the meantime.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => open_plain(&path),
                created => created,
            },
            _ => Err(error),
        });
        Ok((file.map_err(SessionError::file("open", &path))?, path))
    }

    /// Locks a rig. An abandoned run is not an obstacle if it is the run in `resumes`.
    pub fn claim(&self, rig: &str, resumes: Option<&Path>) -> Result<Claim, SessionError> {
        let (mut lock, path) = self.open(rig)?;
        try_lock(rig, &mut lock, &path)?;
        if let Some(reason) = self.doubtful_file(rig) {
            return Err(SessionError::RigFileDoubtful { rig: rig.to_owned(), reason });
        }
        if let Some(Lockout { reason, run }) = self.lockout_of(rig) {
            return Err(SessionError::RigLockedOut { rig: rig.to_owned(), reason, run });
        }
        let owner = read_entry::<Option<Owner>>(&mut lock).map_err(|why| {
            let reason = format!("the entry of its last owner cannot be read ({why}: {})", path.display());
            SessionError::RigLockedOut { rig: rig.to_owned(), reason, run: PathBuf::new() }
        })?;
        let is_new = owner.is_none();
        let is_other = |owner: &&Owner| resumes.is_none_or(|run| !is_same_directory(run, &owner.run));
        let owner = owner.flatten();
        if let Some(owner) = owner.as_ref().filter(is_other) {
            return Err(SessionError::RigAbandoned {
                rig: rig.to_owned(),
                run: owner.run.clone(),
                owner: owner.to_string(),
            });
        }
        let (states, rig) = (self.clone(), rig.to_owned());
        let mut claim = Claim { states, rig, lock, is_abandoned: owner.is_some() };
        if is_new {
            claim.write(None)?;
        }
        Ok(claim)
    }

    fn lockout_of(&self, rig: &str) -> Option<Lockout> {
        if let Some(reason) = self.doubtful_file(rig) {
            return Some(Lockout { reason, run: PathBuf::new() });
        }
        let path = self.file(rig, "latch");
        let unreadable = |why: String| Lockout {
            reason: format!("its lockout cannot be read ({why}: {})", path.display()),
            run: PathBuf::new(),
        };
        match open_plain(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => Some(unreadable(error.to_string())),
            Ok(mut file) => Some(match read_entry(&mut file) {
                Ok(Some(latch)) => latch,
                Ok(None) => unreadable("it is empty".to_owned()),
                Err(why) => unreadable(why),
            }),
        }
    }

    /// Status of a rig.
    pub fn status(&self, rig: &str) -> Result<RigStatus, SessionError> {
        if !self.file(rig, "lock").exists() {
            return Ok(RigStatus {
                rig: rig.to_owned(),
                owner: None,
                in_use: false,
                latch: self.lockout_of(rig),
            });
        }
        let (mut lock, _) = self.open(rig)?;
        let in_use = matches!(lock.try_lock(), Err(TryLockError::WouldBlock));
        let (owner, unreadable) = match read_entry::<Option<Owner>>(&mut lock) {
            Ok(owner) => (owner.flatten(), None),
            // A runner that has just started has not recorded its owner completely.
            Err(_) if in_use => (None, None),
            Err(why) => (None, Some(why)),
        };
        let latch = self.lockout_of(rig).or_else(|| {
            let reason = format!("the entry of its last owner cannot be read ({})", unreadable?);
            Some(Lockout { reason, run: PathBuf::new() })
        });
        Ok(RigStatus { rig: rig.to_owned(), owner, in_use, latch })
    }

    /// All rigs used so far. A file without the name of its rig counts as a lockout under the name of the file.
    pub fn list(&self) -> Vec<RigStatus> {
        let entries = std::fs::read_dir(&self.directory).into_iter().flatten().flatten();
        let (mut names, mut nameless) = (BTreeSet::new(), Vec::new());
        for path in entries.map(|entry| entry.path()) {
            let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let Some((stem, kind @ ("lock" | "latch"))) =
                file.strip_prefix("rig-").and_then(|name| name.rsplit_once('.'))
            else {
                continue;
            };
            if let Some(name) = named_rig(&path) {
                names.insert(name);
            } else if kind == "latch" || std::fs::metadata(&path).is_ok_and(|file| file.len() > 0) {
                let reason = format!("{} does not contain the name of its rig", path.display());
                let latch = Some(Lockout { reason, run: PathBuf::new() });
                nameless.push(RigStatus { rig: stem.to_owned(), owner: None, in_use: false, latch });
            }
        }
        // An address is a second lock of a rig that is listed under its own name.
        let is_address =
            |status: &RigStatus| status.rig.starts_with(ADDRESS_PREFIX) && status.latch.is_none();
        let statuses = names.iter().filter_map(|name| self.status(name).ok());
        statuses.filter(|status| !is_address(status)).chain(nameless).collect()
    }

    fn unacknowledged_rigs(&self) -> Vec<String> {
        let waits = |status: &RigStatus| status.latch.is_some() || (status.owner.is_some() && !status.in_use);
        self.list().into_iter().filter(waits).map(|status| status.rig).collect()
    }

    /// Acknowledges that the rig was inspected, so that the next run may begin.
    pub fn acknowledge(&self, rig: &str) -> Result<RigStatus, SessionError> {
        if let Some(reason) = self.doubtful_file(rig) {
            return Err(SessionError::RigFileDoubtful { rig: rig.to_owned(), reason });
        }
        let status = self.status(rig)?;
        if status.owner.is_none() && status.latch.is_none() && !status.in_use {
            return Err(SessionError::NothingToAcknowledge {
                rig: rig.to_owned(),
                awaiting: self.unacknowledged_rigs(),
            });
        }
        if status.in_use {
            let owner = status.owner.map_or("another runner".to_owned(), |owner| owner.to_string());
            return Err(SessionError::RigInUse { rig: rig.to_owned(), owner });
        }
        // Holding the lock prevents a run from starting between the check and the removal.
        let (mut lock, path) = self.open(rig)?;
        try_lock(rig, &mut lock, &path)?;
        let latch = self.file(rig, "latch");
        match std::fs::remove_file(&latch) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(SessionError::file("remove", &latch)(error));
            }
            _ => {}
        }
        Claim { states: self.clone(), rig: rig.to_owned(), lock, is_abandoned: false }.write(None)?;
        Ok(status)
    }
}

impl Claim {
    pub fn record_owner(&mut self, owner: &Owner) -> Result<(), SessionError> {
        self.write(Some(owner))
    }

    fn write(&mut self, owner: Option<&Owner>) -> Result<(), SessionError> {
        let text = json_text(&Entry { rig: self.rig.clone(), content: owner })?;
        let mut replace = || {
            self.lock.rewind()?;
            self.lock.set_len(0)?;
            self.lock.write_all(text.as_bytes())?;
            self.lock.sync_all()
        };
        replace().map_err(SessionError::file("write", &self.states.file(&self.rig, "lock")))
    }

    pub fn lock_out(&self, lockout: &Lockout) -> Result<(), SessionError> {
        let path = self.states.file(&self.rig, "latch");
        let text = json_text(&Entry { rig: self.rig.clone(), content: lockout })?;
        write_file(&path, text.as_bytes(), Existing::Replaced)
    }

    pub fn release(mut self) -> Result<(), SessionError> {
        self.write(None)
    }

    /// Releases a rig that was not armed. One that an earlier run has not released stays as that run has left it.
    pub fn release_untouched(self) -> Result<(), SessionError> {
        if self.is_abandoned { Ok(()) } else { self.release() }
    }
}

/// The part of a file's name that people recognise; several rigs may share it.
fn readable(rig: &str) -> String {
    let file_name_char = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    rig.chars().take(100).map(file_name_char).collect()
}

fn named_rig(path: &Path) -> Option<String> {
    let mut file = open_plain(path).ok()?;
    let entry: Entry<serde_json::Value> = serde_json::from_str(&read_text(&mut file).ok()?).ok()?;
    Some(entry.rig)
}

fn is_same_directory(a: &Path, b: &Path) -> bool {
    let resolved = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    resolved(a) == resolved(b)
}

fn try_lock(rig: &str, lock: &mut File, path: &Path) -> Result<(), SessionError> {
    match lock.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => {
            let owner = read_entry::<Option<Owner>>(lock).ok().flatten().flatten();
            let owner = owner.map_or("another runner".to_owned(), |owner| owner.to_string());
            Err(SessionError::RigInUse { rig: rig.to_owned(), owner })
        }
        Err(TryLockError::Error(source)) => Err(SessionError::file("lock", path)(source)),
    }
}

/// Content of a lock or lockout file: `None` if it is empty, the reason if it cannot be read.
fn read_entry<T: for<'de> Deserialize<'de>>(file: &mut File) -> Result<Option<T>, String> {
    let text = read_text(file).map_err(|error| error.to_string())?;
    if text.is_empty() {
        return Ok(None);
    }
    let entry: Entry<T> = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    Ok(Some(entry.content))
}

fn read_text(file: &mut File) -> io::Result<String> {
    let mut text = String::new();
    file.rewind()?;
    file.take(MAX_FILE_BYTES).read_to_string(&mut text)?;
    Ok(text)
}

/// Opens a plain file with one name for reading and writing: a link of another user could make a run overwrite its target.
fn open_plain(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // NONBLOCK: does not wait for the other end of a pipe.
        let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
        options.custom_flags(i32::try_from(flags.bits()).unwrap_or_default());
    }
    let file = options.open(path)?;
    let metadata = file.metadata()?;
    #[cfg(unix)]
    let linked = std::os::unix::fs::MetadataExt::nlink(&metadata) > 1;
    #[cfg(not(unix))]
    let linked = false;
    if !metadata.is_file() || linked {
        return Err(io::Error::other("it is a link or not a plain file; remove it"));
    }
    Ok(file)
}

/// Creates a file. If it is shared, every user of the computer may lock it.
fn create_new(path: &Path, shared: bool) -> io::Result<File> {
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
    if shared {
        share(path, 0o666)?;
    }
    Ok(file)
}

/// Creates a directory. If it is shared, every user may remove files of others, as the user who has inspected the rig must.
fn make_directory(path: &Path, shared: bool) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    std::fs::create_dir_all(path).map_err(|error| match error.kind() {
        // A file, or a link to a place that does not exist.
        ErrorKind::AlreadyExists => {
            io::Error::new(ErrorKind::NotADirectory, "it is a file or a broken link, not a directory")
        }
        _ => error,
    })?;
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

#[derive(Default)]
pub(crate) struct RigLease {
    rig: Option<Claim>,
    /// Auxiliary instruments and the rig's address, one lock each, without an owner: only the rig itself needs an acknowledgement.
    instruments: Vec<Claim>,
}

impl RigLease {
    /// Locks the rig and the instruments by name. `resumes`: the run to resume.
    pub(crate) fn acquire(
        states: &RigStates,
        rig: Option<&str>,
        instruments: &[String],
        resumes: Option<&Path>,
    ) -> Result<Self, SessionError> {
        let rig = rig.map(|name| states.claim(name, resumes)).transpose()?;
        let instruments =
            instruments.iter().map(|name| states.claim(name, resumes)).collect::<Result<_, _>>()?;
        Ok(RigLease { rig, instruments })
    }

    #[cfg(test)]
    pub(crate) fn of(rig: Claim) -> Self {
        RigLease { rig: Some(rig), instruments: Vec::new() }
    }

    pub(crate) fn record_owner(&mut self, run: &Path, started: &str) -> Result<(), SessionError> {
        self.rig.as_mut().map_or(Ok(()), |claim| claim.record_owner(&owner(run, started)))
    }

    /// Locks the rig out until an operator acknowledges it.
    pub(crate) fn lock_out(&self, reason: String, run: &Path) -> Result<(), SessionError> {
        let claim = self.rig.as_ref();
        claim.map_or(Ok(()), |claim| claim.lock_out(&Lockout { reason, run: run.to_owned() }))
    }

    /// Releases all locks of a run that has not armed the rig.
    pub(crate) fn release_untouched(self) -> Result<(), SessionError> {
        self.instruments.into_iter().chain(self.rig).try_for_each(Claim::release_untouched)
    }

    /// Releases all locks. With a reason for a lockout, the rig is locked out until an operator acknowledges it.
    pub(crate) fn release(self, lockout: Option<String>, run: &Path) -> Result<(), SessionError> {
        if let Some(reason) = lockout {
            self.lock_out(reason, run)?;
        }
        for claim in self.instruments.into_iter().chain(self.rig) {
            claim.release()?;
        }
        Ok(())
    }
}

fn owner(run: &Path, started: &str) -> Owner {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    Owner {
        process: std::process::id(),
        host: host.trim().to_owned(),
        run: std::path::absolute(run).unwrap_or_else(|_| run.to_owned()),
        started: started.to_owned(),
    }
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
    fn a_rig_has_one_runner_and_an_abandoned_run_is_reported() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let mut first = states.claim("opc.tcp://bench:4840", None).unwrap();
        first.record_owner(&owner("runs/a")).unwrap();
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
        claim.lock_out(&Lockout { reason: "overspeed".to_owned(), run: "runs/a".into() }).unwrap();
        claim.release().unwrap();
        for _ in 0..2 {
            let refused = states.claim("bench", Some(Path::new("runs/a"))).unwrap_err();
            assert!(matches!(refused, SessionError::RigLockedOut { .. }), "{refused}");
            assert!(refused.to_string().contains("overspeed"), "{refused}");
        }
        let typo = states.acknowledge("bensh").unwrap_err().to_string();
        assert!(typo.contains("`bensh`") && typo.contains("these wait for one: bench"), "{typo}");
        assert_eq!(states.acknowledge("bench").unwrap().latch.unwrap().reason, "overspeed");
        let again = states.acknowledge("bench").unwrap_err().to_string();
        assert!(again.contains("no rig waits for one"), "{again}");
        assert!(states.claim("bench", None).is_ok());
    }

    #[test]
    fn every_rig_has_its_own_lockout() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let (long, capital) = ("x".repeat(100), "Cell 1".to_owned());
        let mut names: Vec<String> = [
            "Zelle \u{e4}",
            "Zelle \u{f6}",
            "Zelle a\u{308}",
            "cell/1",
            "cell 1",
            "cell_1",
            "",
            " ",
            "at home",
        ]
        .map(str::to_owned)
        .to_vec();
        names.extend([capital, format!("{long}a"), format!("{long}b"), format!("{long}{long}{long}"), long]);
        let is_free = |name: &String| states.claim(name, None).and_then(Claim::release).is_ok();
        for locked in &names {
            let claim = states.claim(locked, None).unwrap();
            claim.lock_out(&Lockout { reason: "overspeed".to_owned(), run: "runs/a".into() }).unwrap();
            claim.release().unwrap();
            for other in names.iter().filter(|other| *other != locked) {
                assert!(is_free(other), "{other} with {locked} locked out");
                assert!(states.status(other).unwrap().latch.is_none());
                assert!(states.acknowledge(other).is_err());
            }
            assert!(!is_free(locked));
            assert_eq!(states.unacknowledged_rigs(), *std::slice::from_ref(locked));
            states.acknowledge(locked).unwrap();
        }
        let listed: BTreeSet<String> = states.list().into_iter().map(|status| status.rig).collect();
        names.retain(|name| name != "at home");
        assert_eq!(listed, names.into_iter().collect());
    }

    /// Whoever acknowledges such a file may have inspected another rig.
    #[test]
    fn a_file_that_may_mean_another_rig_locks_out_and_is_not_acknowledged() {
        let lockout = Lockout { reason: "overspeed".to_owned(), run: "runs/a".into() };
        let nameless = serde_json::to_string(&lockout).unwrap();
        let of_b = serde_json::to_string(&Entry { rig: "b".to_owned(), content: &lockout }).unwrap();
        for extension in ["latch", "lock"] {
            let directory = tempfile::tempdir().unwrap();
            let states = RigStates::new(directory.path());
            let shared = directory.path().join(format!("rig-Zelle__.{extension}"));
            let moved = states.file("a", extension);
            std::fs::write(&shared, &nameless).unwrap();
            std::fs::write(&moved, &of_b).unwrap();
            for rig in ["Zelle \u{e4}", "Zelle \u{f6}", "Zelle__", "a"] {
                let refused = states.claim(rig, None).unwrap_err();
                assert!(matches!(refused, SessionError::RigFileDoubtful { .. }), "{rig}: {refused}");
                assert!(states.status(rig).unwrap().latch.is_some(), "{rig}");
                let refused = states.acknowledge(rig).unwrap_err();
                assert!(matches!(refused, SessionError::RigFileDoubtful { .. }), "{rig}: {refused}");
            }
            assert!(shared.exists() && moved.exists());
            assert!(states.list().iter().any(|status| status.rig == "Zelle__" && status.latch.is_some()));
            std::fs::remove_file(shared).unwrap();
            states.claim("Zelle \u{e4}", None).unwrap().release().unwrap();
        }
    }

    #[test]
    fn an_unreadable_entry_locks_the_rig_out() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        for (file, bytes) in [
            ("latch", &b""[..]),
            ("latch", b"{\"reason\": 7}"),
            ("latch", b"\xff\xfe"),
            ("lock", b"{\"process\": 7"),
            ("lock", b"\xff\xfe"),
        ] {
            states.claim("bench", None).unwrap().release().unwrap();
            std::fs::write(states.file("bench", file), bytes).unwrap();
            let refused = states.claim("bench", None).unwrap_err();
            assert!(matches!(refused, SessionError::RigLockedOut { .. }), "{file}: {refused}");
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
            claim.lock_out(&Lockout { reason: "overspeed".to_owned(), run: "runs/a".into() }).unwrap();
            assert_eq!(std::fs::read_to_string(&victim).unwrap(), "kept");
        }
    }

    /// Otherwise a run that starts during an acknowledgement could lock a file that is then removed.
    #[test]
    fn acknowledging_keeps_the_lock_file() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let mut first = states.claim("bench", None).unwrap();
        first.record_owner(&owner("runs/a")).unwrap();
        drop(first);
        states.acknowledge("bench").unwrap();
        let second = states.claim("bench", None).unwrap();
        assert!(matches!(states.claim("bench", None), Err(SessionError::RigInUse { .. })));
        assert!(matches!(states.acknowledge("bench"), Err(SessionError::RigInUse { .. })));
        second.release().unwrap();
    }

    /// Two campaigns may give one controller different names.
    #[test]
    fn one_controller_under_two_names_is_one_rig() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let place = ["at 10.0.0.3:502 unit 255".to_owned()];
        let first = RigLease::acquire(&states, Some("cell 3"), &place, None).unwrap();
        let refused = RigLease::acquire(&states, Some("cell three"), &place, None).map(drop).unwrap_err();
        assert!(matches!(refused, SessionError::RigInUse { .. }), "{refused}");
        assert!(
            RigLease::acquire(&states, Some("cell 4"), &["at 10.0.0.4:502 unit 255".to_owned()], None)
                .is_ok()
        );
        first.release(None, Path::new("runs/a")).unwrap();
        assert!(RigLease::acquire(&states, Some("cell three"), &place, None).is_ok());
    }
}
