//! How far a study is, from its parts alone.

use crate::fleet::part_name;
use crate::part::Outcome;
use crate::{Fleet, Hash, Listed, Part};
use serde::Serialize;
use std::collections::BTreeSet;

/// An item without a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Lacking {
    /// Its name.
    pub name: String,
    /// Its hash.
    pub hash: Hash,
    /// Why there is no result; `None`: nobody has said anything.
    pub why: Option<String>,
}

/// How far a study is.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Status {
    /// Number of items.
    pub items: usize,
    /// Items with a result.
    pub done: usize,
    /// Items that failed, and why.
    pub failed: Vec<Lacking>,
    /// Files in the place of a part that are none of this study, and why; left out.
    pub refused: Vec<Lacking>,
    /// Items without a part; `why`: who began it.
    pub missing: Vec<Lacking>,
    /// Files among the parts that belong to no item; left out.
    pub strangers: Vec<String>,
    /// What the items that are done took together on one core, s.
    pub spent_s: f64,
    /// What the longest took, s.
    pub longest_s: f64,
    /// Largest memory that one needed, bytes.
    pub memory_bytes: u64,
    /// What the results take on the disk, bytes.
    pub disk_bytes: u64,
}

impl Status {
    /// Items that have no result.
    pub fn lacking(&self) -> usize {
        self.items - self.done
    }

    /// Items that somebody began and that have no part: under way, or lost with their worker.
    pub fn begun(&self) -> usize {
        self.missing.iter().filter(|item| item.why.is_some()).count()
    }

    /// What is left, in seconds of one core; `None` before anything is done.
    pub fn left_s(&self) -> Option<f64> {
        (self.done > 0).then(|| self.spent_s / self.done as f64 * self.lacking() as f64)
    }

    fn count(&mut self, part: &Part) {
        self.done += 1;
        self.spent_s += part.duration_s;
        self.longest_s = self.longest_s.max(part.duration_s);
        self.memory_bytes = self.memory_bytes.max(part.memory_bytes);
        self.disk_bytes += part.body_bytes;
    }
}

/// Strangers that are told at most.
const MAX_STRANGERS: usize = 1000;

impl Fleet {
    /// How far it is. Only the first lines of parts are read.
    pub fn status(&self) -> Status {
        let mut status = Status { items: self.study.items.len(), ..Status::default() };
        for item in &self.study.items {
            let lacking = |why| Lacking { name: item.name.clone(), hash: item.hash, why };
            match self.head(item) {
                Some(Ok(part)) if part.outcome == Outcome::Done => status.count(&part),
                Some(Ok(_)) => status.failed.push(lacking(Some(self.why(item)))),
                Some(Err(refusal)) => status.refused.push(lacking(Some(refusal.to_string()))),
                None => status.missing.push(lacking(self.who_began(item))),
            }
        }
        status.strangers = self.strangers();
        status
    }

    fn who_began(&self, item: &Listed) -> Option<String> {
        let who = crate::place::read_at_most(&self.begun(&item.hash), 256).ok()?;
        Some(String::from_utf8_lossy(&who).into_owned())
    }

    fn strangers(&self) -> Vec<String> {
        let known: BTreeSet<String> = self.study.items.iter().map(|item| part_name(&item.hash)).collect();
        let Ok(entries) = std::fs::read_dir(self.parts()) else { return Vec::new() };
        let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        // A name that begins with a dot is a part that is being written, or was when its worker was killed.
        let mut strangers: Vec<String> = names
            .filter(|name| !name.starts_with('.') && !known.contains(name))
            .take(MAX_STRANGERS)
            .collect();
        strangers.sort();
        strangers
    }
}
