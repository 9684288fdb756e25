//! Executes items on the cores of this machine, the loop of all long work, and estimates their cost from a few.

use crate::files::Machine;
use crate::study::{Outcome, Part};
use crate::{Fleet, FleetError, Hash, Item, ItemEntry, Kind, Shard, Status, WorkContext, WorkError};
use mapper_numerics::parallel;
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

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
    /// Processes the items without a part, with `again` also the failed ones. An interruption loses only items in progress.
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

/// Number of cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Settings of the work loop.
#[derive(Clone, Copy)]
pub struct Engine<'a> {
    /// Maximum number of pieces at a time; `None` for the number of cores.
    pub jobs: Option<usize>,
    /// Set by the caller to start no further piece.
    pub stop: &'a AtomicBool,
    /// Receives the number of finished pieces and the total, from the first second on.
    pub on_progress: &'a (dyn Fn(usize, usize) + Sync),
}

impl Engine<'_> {
    /// Number of pieces at a time, limited by their total.
    pub fn parallel_jobs(&self, pieces: usize) -> usize {
        self.jobs.unwrap_or_else(cores).clamp(1, pieces.max(1))
    }

    /// Applies `work` to every piece, in their order. After an error or a stop no further piece starts; after a stop those are `None`.
    pub fn each<T: Sync, R: Send, E: Send>(
        &self,
        pieces: &[T],
        work: impl Fn(usize, &T) -> Result<R, E> + Sync,
    ) -> Result<Vec<Option<R>>, E> {
        let jobs = self.parallel_jobs(pieces.len());
        let threads = (cores() / jobs).max(1);
        let done = AtomicUsize::new(0);
        (self.on_progress)(0, pieces.len());
        parallel::try_map_on(jobs, pieces, |index, piece| {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let result = parallel::with_threads(threads, || work(index, piece))?;
            (self.on_progress)(done.fetch_add(1, Ordering::Relaxed) + 1, pieces.len());
            Ok(Some(result))
        })
    }
}

/// Result of the trial that estimates the cost.
#[derive(Debug, Clone, PartialEq)]
pub struct CostEstimate {
    /// The estimated cost.
    pub cost: Cost,
    /// Progress of the study.
    pub status: Status,
}

/// Cost of a study.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cost {
    /// Number of items.
    pub items: usize,
    /// Finished items, on which the estimate is based.
    pub from: usize,
    /// Items without a result.
    pub left: usize,
    /// Average time of an item on one core, s.
    pub item_s: f64,
    /// Longest time of an item, s.
    pub longest_s: f64,
    /// Processor time of all items, h.
    pub hours: f64,
    /// Processor time of the remaining items, h.
    pub left_hours: f64,
    /// Peak memory of one item, bytes; 0 if unknown.
    pub memory_bytes: u64,
    /// Size of items and parts on the shared disk, bytes.
    pub disk_bytes: u64,
}

/// Allowance for the first line of a part and for the unused rest of a disk block, bytes.
const PART_OVERHEAD_BYTES: u64 = 4096;

impl Fleet {
    /// The estimated cost of the study; `None` if no item is done.
    pub fn cost(&self, status: &Status) -> Option<Cost> {
        let left_s = status.left_s()?;
        let from = status.done.max(1);
        let (items, item_s) = (status.items, status.spent_s / from as f64);
        let item_bytes = self
            .study
            .items
            .first()
            .map_or(0, |item| std::fs::metadata(self.item(&item.hash)).map_or(0, |file| file.len()));
        let part_bytes = status.disk_bytes / from as u64 + PART_OVERHEAD_BYTES;
        Some(Cost {
            items,
            from: status.done,
            left: status.unfinished(),
            item_s,
            longest_s: status.longest_s,
            hours: item_s * items as f64 / 3600.0,
            left_hours: left_s / 3600.0,
            memory_bytes: status.memory_bytes,
            disk_bytes: (item_bytes + part_bytes) * items as u64,
        })
    }

    /// Runs items one at a time until a few are done, and estimates the cost of all. Their results are kept.
    pub fn estimate_cost(
        &self,
        kind: &dyn Kind,
        count: usize,
        engine: &Engine<'_>,
        machine: &Machine<'_>,
    ) -> Result<CostEstimate, FleetError> {
        let done = self.status().done;
        let mut reason = String::new();
        if done < count {
            // One at a time, so that time and memory belong to one item.
            let single = Engine { jobs: Some(1), ..*engine };
            let outcome = self.work(kind, ItemSelection::First(count - done), false, &single, machine)?;
            reason = outcome
                .failed
                .into_iter()
                .next()
                .map(|(name, reason)| format!("{name}: {reason}"))
                .unwrap_or_default();
        }
        let status = self.status();
        let cost = self.cost(&status).ok_or(FleetError::UnknownCost(reason))?;
        Ok(CostEstimate { cost, status })
    }
}
