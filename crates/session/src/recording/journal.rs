//! The journal of a run: its identity and the steps safely recorded, a line of JSON each: a torn last line leaves the others valid.

use crate::SessionError;
use mapper_campaign::Campaign;
use mapper_core::{Plan, RigDescription, RunEnding, StepMarker};
use mapper_recording::{DiskFaults, RunFile};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

/// Maximum size of a journal, bytes: some hundred thousand steps.
const MAX_JOURNAL_BYTES: u64 = 16 << 20;

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    pub machine: String,
    pub serial_number: Option<String>,
    pub campaign_sha256: String,
    pub model_sha256: String,
    pub plan_sha256: String,
    pub backend: String,
    pub settings_sha256: String,
    /// Hash of the rig description; missing in journals of older runs.
    #[serde(default)]
    pub rig_sha256: Option<String>,
}

/// Hash of the rig description: channels, rate, accepted ranges, safe trajectory.
pub fn rig_sha256(rig: &RigDescription) -> Result<String, SessionError> {
    Ok(mapper_planner::sha256_hex(&serde_json::to_string(rig)?))
}

impl Identity {
    pub fn of(campaign: &Campaign, plan: &Plan, rig: &RigDescription) -> Result<Self, SessionError> {
        let hash = |text: &str| mapper_planner::sha256_hex(text);
        let behind = rig.exclusive.as_deref().map(|name| format!(" ({name})")).unwrap_or_default();
        // The rig has a separate hash, so that a difference in the rig is reported as such.
        let mut without_rig = plan.clone();
        without_rig.made_from.rig_sha256 = None;
        Ok(Identity {
            machine: campaign.machine.name.clone(),
            serial_number: campaign.machine.serial_number.clone(),
            campaign_sha256: plan.made_from.campaign_sha256.clone(),
            model_sha256: plan.made_from.model_sha256.clone(),
            plan_sha256: hash(&serde_json::to_string(&without_rig)?),
            backend: format!("{} {}{behind}", rig.backend, rig.version),
            settings_sha256: match campaign.readers.as_slice() {
                [] => hash(&campaign.backend.settings.to_string()),
                readers => hash(&serde_json::to_string(&(&campaign.backend.settings, readers))?),
            },
            rig_sha256: Some(rig_sha256(rig)?),
        })
    }

    pub fn differences(&self, now: &Identity) -> Vec<&'static str> {
        [
            ("the machine", self.machine != now.machine || self.serial_number != now.serial_number),
            ("the campaign", self.campaign_sha256 != now.campaign_sha256),
            ("the nominal model", self.model_sha256 != now.model_sha256),
            ("the plan", self.plan_sha256 != now.plan_sha256),
            ("the backend", self.backend != now.backend || self.settings_sha256 != now.settings_sha256),
            (
                "the description of the rig",
                both_known_and_differ(self.rig_sha256.as_deref(), now.rig_sha256.as_deref()),
            ),
        ]
        .into_iter()
        .filter_map(|(what, differs)| differs.then_some(what))
        .collect()
    }
}

pub(crate) fn both_known_and_differ(then: Option<&str>, now: Option<&str>) -> bool {
    then.zip(now).is_some_and(|(then, now)| then != now)
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Entry {
    Part {
        identity: Identity,
        recording: String,
    },
    Soaked,
    /// A step is complete and recorded. Holds its index in the plan, stored as the step number.
    StepSaved(#[serde(with = "mapper_core::test_plan::step_number")] usize),
    Ended(RunEnding),
    /// The results of all parts up to this one are written.
    Results,
}

pub struct Journal {
    file: RunFile,
    /// Whether each line is flushed to disk. Needed for rigs that keep running if the computer fails.
    synced: bool,
}

impl Journal {
    /// Opens and locks the journal of a run to append, so that one process resumes it. `WouldBlock`: another runner has it.
    pub fn open(path: &Path, synced: bool, faults: Option<DiskFaults>) -> std::io::Result<Self> {
        let file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(std::io::Error::new(ErrorKind::WouldBlock, "another process runs it"));
            }
            // A file system without locks.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
        let mut text = Vec::new();
        (&file).take(MAX_JOURNAL_BYTES).read_to_end(&mut text)?;
        let mut file = RunFile::new(file, path, faults);
        // Terminates a line that was torn by a crash.
        if text.last().is_some_and(|last| *last != b'\n') {
            file.write_all(b"\n")?;
        }
        Ok(Journal { file, synced })
    }

    pub fn write(&mut self, entry: &Entry) -> std::io::Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        self.file.write_all(&line)?;
        if self.synced { self.file.sync_data() } else { Ok(()) }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct JournalPart {
    pub identity: Identity,
    pub recording: String,
    pub soaked: bool,
    pub saved: BTreeSet<usize>,
    pub completed: bool,
    /// How it ended; `None` if nothing wrote that.
    pub ending: Option<RunEnding>,
    /// Whether the results contain it.
    pub has_results: bool,
    /// Whether its recording cannot be read and contained steps or a soak that no other part has.
    pub unreadable: bool,
    /// Steps that the journal lists and no recording contains.
    pub lost: BTreeSet<usize>,
    /// Whether the soak is listed and no recording contains it.
    pub lost_soak: bool,
}

impl JournalPart {
    pub(crate) fn has_losses(&self) -> bool {
        self.lost_soak || self.lost.iter().any(|index| *index < StepMarker::FIRST_REPEAT_INDEX)
    }

    /// Whether the run needs nothing of its recording, which may then be damaged: its first flush may have failed.
    pub(crate) fn is_empty(&self) -> bool {
        !self.soaked && self.saved.is_empty() && !self.unreadable
    }
}

/// Whether a process runs the run of this journal now: it holds the lock.
pub fn is_run_now(path: &Path) -> bool {
    mapper_yaml::open_file(path)
        .is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Reads the parts of a run. Unreadable lines are skipped: a step not known to be saved is run again.
pub fn read_journal(path: &Path) -> std::io::Result<Vec<JournalPart>> {
    let mut bytes = Vec::new();
    mapper_yaml::open_file(path)?.take(MAX_JOURNAL_BYTES).read_to_end(&mut bytes)?;
    let mut parts: Vec<JournalPart> = Vec::new();
    for line in bytes.split(|byte| *byte == b'\n') {
        match (serde_json::from_slice::<Entry>(line), parts.last_mut()) {
            (Ok(Entry::Part { identity, recording }), _) => {
                if Path::new(&recording).file_name() != Some(recording.as_ref()) {
                    let why =
                        format!("it names the recording `{recording}`, which is not in the run's directory");
                    return Err(std::io::Error::new(ErrorKind::InvalidData, why));
                }
                parts.push(JournalPart {
                    identity,
                    recording,
                    soaked: false,
                    saved: BTreeSet::new(),
                    completed: false,
                    ending: None,
                    has_results: false,
                    unreadable: false,
                    lost: BTreeSet::new(),
                    lost_soak: false,
                });
            }
            (Ok(Entry::Soaked), Some(part)) => part.soaked = true,
            (Ok(Entry::Results), Some(part)) => part.has_results = true,
            (Ok(Entry::StepSaved(index)), Some(part)) => {
                part.saved.insert(index);
            }
            (Ok(Entry::Ended(how)), Some(part)) => {
                part.completed = how == RunEnding::Completed;
                part.ending = Some(how);
            }
            _ => {}
        }
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(recording: &str) -> Entry {
        let text = || "x".to_owned();
        Entry::Part {
            identity: Identity {
                machine: text(),
                serial_number: None,
                campaign_sha256: text(),
                model_sha256: text(),
                plan_sha256: text(),
                backend: text(),
                settings_sha256: text(),
                rig_sha256: None,
            },
            recording: recording.to_owned(),
        }
    }

    /// Cuts the journal at every byte: all complete lines are read, and the journal can be continued.
    #[test]
    fn a_journal_cut_anywhere_keeps_the_complete_lines() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("journal");
        let mut journal = Journal::open(&path, false, None).unwrap();
        let entries = [
            part("a"),
            Entry::Soaked,
            Entry::StepSaved(0),
            Entry::StepSaved(1),
            part("b"),
            Entry::StepSaved(2),
        ];
        let mut ends = vec![0];
        for entry in &entries {
            journal.write(entry).unwrap();
            ends.push(std::fs::metadata(&path).unwrap().len() as usize);
        }
        assert_eq!(Journal::open(&path, false, None).map(drop).unwrap_err().kind(), ErrorKind::WouldBlock);
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..=whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let parts = read_journal(&path).unwrap();
            // A complete line counts even without its line break.
            let written = ends.iter().filter(|end| **end > 0 && **end <= cut + 1).count();
            let saved: usize = parts.iter().map(|part| part.saved.len() + usize::from(part.soaked) + 1).sum();
            assert_eq!(saved, written, "cut at {cut}");
            Journal::open(&path, false, None).unwrap().write(&part("c")).unwrap();
            let more = read_journal(&path).unwrap();
            assert_eq!(more.last().unwrap().recording, "c");
            assert_eq!(more.len(), parts.len() + 1);
        }
    }

    #[test]
    fn a_recording_outside_of_the_run_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("journal");
        for name in ["/etc/passwd", "../other/recording.mcap", "", "..", "a/../b"] {
            let mut journal = Journal::open(&path, false, None).unwrap();
            journal.write(&part(name)).unwrap();
            assert_eq!(read_journal(&path).unwrap_err().kind(), ErrorKind::InvalidData, "{name}");
            std::fs::remove_file(&path).unwrap();
        }
    }

    /// A journal that names a soak: the recording decides whether there was one.
    #[test]
    fn a_soak_counts_only_if_the_recording_contains_it() {
        use mapper_core::{Event, EventKind};
        for (recorded, soaked) in [(EventKind::SoakStarted, false), (EventKind::SoakEnded, true)] {
            let directory = tempfile::tempdir().unwrap();
            let mut journal = Journal::open(&directory.path().join("journal.jsonl"), false, None).unwrap();
            journal.write(&part("recording.mcap")).unwrap();
            journal.write(&Entry::Soaked).unwrap();
            let header = mapper_recording::RecordingHeader {
                library: "mapper".to_owned(),
                profile: String::new(),
                start_time_ns: 0,
                metadata: std::collections::BTreeMap::new(),
                plan_json: None,
                campaign_yaml: None,
            };
            let path = directory.path().join("recording.mcap");
            let mut writer = mapper_recording::RecordingWriter::create(&path, &header).unwrap();
            writer.write_event(&Event { t_s: 1.0, kind: recorded, message: String::new() }).unwrap();
            writer.finish().unwrap();
            let interrupted = crate::InterruptedRun::read(directory.path()).unwrap();
            assert_eq!(interrupted.has_soak(), soaked, "{recorded:?}");
        }
    }

    #[test]
    fn files_without_journal_lines_have_no_parts() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("journal");
        for bytes in [
            &b"\xff\xfe\x00"[..],
            b"{}\n[]\n\"step_saved\"",
            b"{\"step_saved\": -1}\n{\"step_saved\": 0}\n{\"step_saved\": 1e400}",
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read_journal(&path).unwrap(), []);
        }
    }
}
