//! Processes items. Each finished item leaves one complete part, even if a process is killed.

use crate::directory::part::{Outcome, Part};
use crate::directory::shared_files::Machine;
use crate::{Engine, Fleet, FleetError, Hash, Item, ItemEntry, Kind, Shard, WorkContext, WorkError};
use mapper_numerics::parallel;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Selection of items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ItemSelection {
    /// All of them.
    All,
    /// Those of a shard.
    Shard(Shard),
    /// A single item.
    Item(Hash),
    /// This many unfinished items, to estimate the cost.
    First(usize),
}

/// Result of a call.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorkOutcome {
    /// Items processed by this call.
    pub done: usize,
    /// Items that were already done.
    pub already_done: usize,
    /// Items that failed now or earlier and were not retried: name and reason.
    pub failed: Vec<(String, String)>,
}

enum ItemOutcome {
    Done,
    AlreadyDone,
    Failed(String),
}

impl Fleet {
    /// Processes the items without a part, and with `again` also the failed ones. An interruption loses only the items in
    /// progress.
    ///
    /// # Errors
    /// [`FleetError::Interrupted`]; [`FleetError::File`] if a part cannot be written; [`FleetError::Changed`] for an item
    /// whose file was changed; [`FleetError::NoItem`].
    pub fn work(
        &self,
        kind: &dyn Kind,
        selection: ItemSelection,
        again: bool,
        engine: &Engine<'_>,
        machine: &Machine<'_>,
    ) -> Result<WorkOutcome, FleetError> {
        let mut counts = WorkOutcome::default();
        let mut items = Vec::new();
        for item in self.select_items(selection)? {
            match self.read_part_header(item) {
                Some(Ok(part)) if part.outcome == Outcome::Done => counts.already_done += 1,
                Some(Ok(_)) if !again => counts.failed.push((item.name.clone(), self.failure_reason(item))),
                // Files that do not belong to this study are replaced.
                _ => items.push(item),
            }
        }
        if let ItemSelection::First(count) = selection {
            items.truncate(count);
        }
        // An item that was started and has no part may have killed its worker, or is in progress elsewhere, so it comes last.
        items.sort_by_cached_key(|item| self.progress_marker(&item.hash).exists());
        let jobs = engine.parallel_jobs(items.len());
        let results = engine.each(&items, |_, item| {
            match self.do_item(kind, item, again, jobs, engine.stop, machine) {
                Ok(item_outcome) => Ok(Some(item_outcome)),
                Err(FleetError::Interrupted) => Ok(None),
                Err(error) => Err(error),
            }
        })?;
        let mut interrupted = false;
        for (item, result) in items.iter().zip(results) {
            match result.flatten() {
                None => interrupted = true,
                Some(ItemOutcome::Done) => counts.done += 1,
                Some(ItemOutcome::AlreadyDone) => counts.already_done += 1,
                Some(ItemOutcome::Failed(reason)) => counts.failed.push((item.name.clone(), reason)),
            }
        }
        if interrupted { Err(FleetError::Interrupted) } else { Ok(counts) }
    }

    fn select_items(&self, selection: ItemSelection) -> Result<Vec<&ItemEntry>, FleetError> {
        let items = self.study.items.iter();
        let mut selected: Vec<&ItemEntry> = match selection {
            ItemSelection::All | ItemSelection::First(_) => items.collect(),
            ItemSelection::Shard(shard) => items.filter(|item| shard.holds(&item.hash)).collect(),
            ItemSelection::Item(hash) => {
                let found = self.study.items.iter().find(|item| item.hash == hash);
                vec![found.ok_or(FleetError::NoItem(hash))?]
            }
        };
        if let ItemSelection::First(_) = selection {
            // Sorted by hash to get a random sample; the first items of a study may be similar.
            selected.sort_by_key(|item| item.hash);
        }
        Ok(selected)
    }

    fn do_item(
        &self,
        kind: &dyn Kind,
        listed: &ItemEntry,
        again: bool,
        jobs: usize,
        stop: &AtomicBool,
        machine: &Machine<'_>,
    ) -> Result<ItemOutcome, FleetError> {
        // Another worker may have done it in the meantime.
        if let Some(Ok(part)) = self.read_part_header(listed)
            && (part.outcome == Outcome::Done || !again)
        {
            return Ok(ItemOutcome::AlreadyDone);
        }
        let item = Item::read(&self.item(&listed.hash), &listed.hash)?;
        let marker = self.progress_marker(&listed.hash);
        // For information only; work continues if the disk is full.
        let _ = std::fs::write(&marker, machine.name);
        // One core for each item, so that the processor time of the thread is the cost of the item.
        let (result, duration_s) = parallel::with_threads(1, || {
            let started_s = (machine.thread_s)();
            let result = run_item(kind, &item, stop);
            (result, (machine.thread_s)() - started_s)
        });
        let memory_bytes = (machine.peak_memory_bytes)().unwrap_or(0) / jobs as u64;
        let cost = (duration_s, memory_bytes);
        let write_part = |outcome: Outcome, body: &str| {
            Part::write(&self.part(&listed.hash), (&listed.hash, &item), (outcome, body), cost, machine)
        };
        let item_outcome = match result {
            Ok(body) => write_part(Outcome::Done, &body).map(|_| ItemOutcome::Done),
            Err(WorkError::Failed(reason)) => {
                write_part(Outcome::Failed, &reason).map(|_| ItemOutcome::Failed(reason))
            }
            Err(WorkError::Interrupted) => Err(FleetError::Interrupted),
        };
        let _ = std::fs::remove_file(&marker);
        item_outcome
    }

    /// The reason for the failure of an item, from its part.
    pub(crate) fn failure_reason(&self, item: &ItemEntry) -> String {
        match self.read_part(item) {
            Some(Ok((_, body))) => body.chars().take(MAX_REASON_CHARS).collect(),
            Some(Err(refusal)) => refusal.to_string(),
            None => "its part is missing".to_owned(),
        }
    }
}

/// Longest reason that is recorded, characters.
const MAX_REASON_CHARS: usize = 400;

/// Processes an item in its own directory. A panic fails only this item.
fn run_item(kind: &dyn Kind, item: &Item, stop: &AtomicBool) -> Result<String, WorkError> {
    let temporary = std::env::temp_dir();
    let scratch = tempfile::Builder::new().prefix("mapper-fleet-").tempdir().map_err(|error| {
        WorkError::Failed(format!("failed to create a directory in {}: {error}", temporary.display()))
    })?;
    let work = |path: &Path| kind.work(&item.payload, WorkContext { scratch: path, stop });
    let result = catch_unwind(AssertUnwindSafe(|| work(scratch.path()))).unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Err(WorkError::Failed(format!("defect of the program, it panicked: {message}")))
    });
    match result {
        // A failure after a stop counts as interrupted.
        Err(WorkError::Failed(_)) if stop.load(Ordering::Relaxed) => Err(WorkError::Interrupted),
        other => other,
    }
}
