//! How far a study is: items done, begun and missing, and which of them belong to a shard.

use crate::files::read_at_most;
use crate::fleet::part_name;
use crate::part::Outcome;
use crate::{Fleet, Hash, ItemEntry, Part};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
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

    /// The items without a result: failed, refused and missing.
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
