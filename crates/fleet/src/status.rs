//! How far a study is, and of each shard; its parts merged into the result, the same for any number of machines and order of work.

use crate::files::{Machine, file_name_safe, make_directory, read_at_most};
use crate::fleet::part_name;
use crate::study::PartRefusal;
use crate::{Fleet, FleetError, Hash, ItemEntry, Kind, Outcome, Output, Part};
use serde::Serialize;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// An item without a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnfinishedItem {
    /// Its name.
    pub name: String,
    /// Its hash.
    pub hash: Hash,
    /// Why the result is missing; `None` if unknown.
    pub why: Option<String>,
}

/// Progress of a study.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Status {
    /// Number of items.
    pub items: usize,
    /// Items with a result.
    pub done: usize,
    /// Items that failed, and why.
    pub failed: Vec<UnfinishedItem>,
    /// Files in the place of a part that do not belong to this study, and why; left out.
    pub refused: Vec<UnfinishedItem>,
    /// Items without a part; `why`: the worker that started it.
    pub missing: Vec<UnfinishedItem>,
    /// Part files that belong to no item; left out.
    pub unrelated_parts: Vec<String>,
    /// Total time of the finished items on one core, s.
    pub spent_s: f64,
    /// Longest time of an item, s.
    pub longest_s: f64,
    /// Largest memory of an item, bytes.
    pub memory_bytes: u64,
    /// Size of the results on the disk, bytes.
    pub disk_bytes: u64,
}

impl Status {
    /// Items without a result.
    pub fn unfinished(&self) -> usize {
        self.items - self.done
    }

    pub(crate) fn unfinished_items(&self) -> impl Iterator<Item = &UnfinishedItem> {
        self.failed.iter().chain(&self.refused).chain(&self.missing)
    }

    /// Items that were started and have no part: in progress, or lost with their worker.
    pub fn started_items(&self) -> usize {
        self.missing.iter().filter(|item| item.why.is_some()).count()
    }

    /// Remaining work, in seconds of one core; `None` before any item is done.
    pub fn left_s(&self) -> Option<f64> {
        (self.done > 0).then(|| self.spent_s / self.done as f64 * self.unfinished() as f64)
    }

    fn count(&mut self, part: &Part) {
        self.done += 1;
        self.spent_s += part.duration_s;
        self.longest_s = self.longest_s.max(part.duration_s);
        self.memory_bytes = self.memory_bytes.max(part.memory_bytes);
        self.disk_bytes += part.body_bytes;
    }
}

/// Maximum number of unrelated files that are listed.
const MAX_FOREIGN_FILES: usize = 1000;

impl Fleet {
    /// Determines the progress. Every part is read completely, because a damaged one does not count as done.
    pub fn status(&self) -> Status {
        let mut status = Status { items: self.study.items.len(), ..Status::default() };
        for item in &self.study.items {
            let unfinished = |why| UnfinishedItem { name: item.name.clone(), hash: item.hash, why };
            match self.read_part_header(item) {
                Some(Ok(part)) if part.outcome == Outcome::Done => status.count(&part),
                Some(Ok(_)) => status.failed.push(unfinished(Some(self.failure_reason(item)))),
                Some(Err(refusal)) => status.refused.push(unfinished(Some(refusal.to_string()))),
                None => status.missing.push(unfinished(self.worker_of(item))),
            }
        }
        status.unrelated_parts = self.foreign_files();
        status
    }

    fn worker_of(&self, item: &ItemEntry) -> Option<String> {
        let worker = read_at_most(&self.progress_marker(&item.hash), 256).ok()?;
        Some(String::from_utf8_lossy(&worker).into_owned())
    }

    fn foreign_files(&self) -> Vec<String> {
        let known: BTreeSet<String> = self.study.items.iter().map(|item| part_name(&item.hash)).collect();
        let Ok(entries) = std::fs::read_dir(self.parts()) else { return Vec::new() };
        let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        // A name with a leading dot is a part that is being written, or whose worker was killed.
        let mut foreign: Vec<String> = names
            .filter(|name| !name.starts_with('.') && !known.contains(name))
            .take(MAX_FOREIGN_FILES)
            .collect();
        foreign.sort();
        foreign
    }
}

/// Share `number` of `of`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    of: u64,
}

impl Shard {
    /// The share of an item.
    pub fn holding(hash: &Hash, of: u64) -> Shard {
        Shard { number: hash.number() % of.max(1) + 1, of: of.max(1) }
    }

    /// Number of the share, from 1.
    pub fn number(self) -> u64 {
        self.number
    }

    /// Whether it contains this item.
    pub fn holds(self, hash: &Hash) -> bool {
        Shard::holding(hash, self.of) == self
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, of)) if 1 <= number && number <= of => Ok(Shard { number, of }),
            _ => Err(format!("`{text}` is not a shard; write K/N with K from 1 to N, e.g. 3/8")),
        }
    }
}

/// Outcome of a merge.
#[derive(Debug)]
pub struct MergeOutcome {
    /// Progress of the study.
    pub status: Status,
    /// The result's directory and one-line description; `None` if parts are missing and nothing was written.
    pub result: Option<(PathBuf, String)>,
}

impl Fleet {
    /// Merges all parts into `result`, one in memory at a time; incomplete only if `partial`. Two concurrent merges write the same bytes.
    pub fn merge(
        &self,
        kind: &dyn Kind,
        partial: bool,
        machine: &Machine<'_>,
    ) -> Result<MergeOutcome, FleetError> {
        let mut status = self.status();
        if status.unfinished() > 0 && !partial {
            return Ok(MergeOutcome { status, result: None });
        }
        let new = self.directory().join(format!(".result.{}.new", file_name_safe(machine.name)));
        let output = Output { directory: make_directory(new.clone())? };
        let damaged: RefCell<Vec<UnfinishedItem>> = RefCell::default();
        let mut parts = self.study.items.iter().map(|item| {
            let result = match self.read_part(item) {
                Some(Ok((part, body))) if part.outcome == Outcome::Done => Ok(body),
                Some(Ok((_, reason))) => Err(reason),
                Some(Err(refusal)) => {
                    let why = Some(refusal.to_string());
                    let (name, hash) = (item.name.clone(), item.hash);
                    damaged.borrow_mut().push(UnfinishedItem { name, hash, why });
                    Err(refusal.to_string())
                }
                None => Err("missing".to_owned()),
            };
            (item.name.clone(), result)
        });
        let description = kind.merge(&self.study.settings, &mut parts, &output);
        drop(parts);
        // Parts whose content was changed; their headers are intact.
        for changed in damaged.into_inner() {
            self.rename_changed_part(&changed);
            if !status.refused.contains(&changed) {
                status.done -= 1;
                status.refused.push(changed);
            }
        }
        let is_complete = partial || status.unfinished() == 0;
        let description = match description {
            Ok(description) if is_complete => description,
            other => {
                let _ = std::fs::remove_dir_all(&new);
                // Damaged parts are reported first, because they may have caused the failure.
                return match other {
                    Err(error) if is_complete => Err(error),
                    _ => Ok(MergeOutcome { status, result: None }),
                };
            }
        };
        let result = self.result();
        let installed = install(&new, &result);
        let _ = std::fs::remove_dir_all(&new);
        installed?;
        Ok(MergeOutcome { status, result: Some((result, description)) })
    }

    fn rename_changed_part(&self, changed: &UnfinishedItem) {
        let part = self.part(&changed.hash);
        let is_changed = changed.why.as_deref() == Some(PartRefusal::Checksum.to_string().as_str());
        if is_changed {
            let _ = std::fs::rename(&part, self.parts().join(format!(".{}.changed", changed.hash)));
        }
    }
}

fn install(new: &Path, result: &Path) -> Result<(), FleetError> {
    make_directory(result.to_owned())?;
    let names = |folder: &Path| -> Result<Vec<_>, FleetError> {
        let entries = std::fs::read_dir(folder).map_err(FleetError::file("read", folder))?;
        let mut names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
        names.sort();
        Ok(names)
    };
    let files = names(new)?;
    for name in &files {
        let target = result.join(name);
        std::fs::rename(new.join(name), &target).map_err(FleetError::file("write", &target))?;
    }
    for name in names(result)?.into_iter().filter(|name| files.binary_search(name).is_err()) {
        // Another merge may have removed it already.
        let _ = std::fs::remove_file(result.join(name));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_is_in_one_shard_and_shards_are_even() {
        let hashes: Vec<Hash> = (0..8000u32).map(|i| Hash::of(&i.to_le_bytes())).collect();
        let shards: Vec<Shard> = (1..=8).map(|k| format!("{k}/8").parse().unwrap()).collect();
        for hash in &hashes {
            assert_eq!(shards.iter().filter(|shard| shard.holds(hash)).count(), 1);
        }
        for shard in shards {
            // A thousand each, with a standard deviation of 30.
            let held = hashes.iter().filter(|hash| shard.holds(hash)).count();
            assert!((850..1150).contains(&held), "{shard}: {held}");
        }
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
