//! Does items: each leaves one part, even if a process is killed.

use crate::directory::part::{Outcome, Part};
use crate::directory::shared_files::Machine;
use crate::{At, Engine, Fleet, FleetError, Hash, Item, Kind, Listed, Shard, WorkError};
use mapper_numerics::parallel;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Selection of items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
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
pub struct Worked {
    /// Items done now.
    pub done: usize,
    /// Items that were already done.
    pub there: usize,
    /// Items that failed now or earlier and were not retried: name, and why.
    pub failed: Vec<(String, String)>,
}

/// Outcome of one item.
enum One {
    Done,
    There,
    Failed(String),
}

impl Fleet {
    /// Does the items that have no part yet, and with `again` those that failed. An interruption loses only the items in
    /// progress.
    ///
    /// # Errors
    /// [`FleetError::Interrupted`]; [`FleetError::File`] if a part cannot be written; [`FleetError::Changed`] for an item
    /// whose file was changed; [`FleetError::NoItem`].
    pub fn work(
        &self,
        kind: &dyn Kind,
        which: Which,
        again: bool,
        engine: &Engine<'_>,
        machine: &Machine<'_>,
    ) -> Result<Worked, FleetError> {
        let mut worked = Worked::default();
        let mut items = Vec::new();
        for item in self.chosen(which)? {
            match self.head(item) {
                Some(Ok(part)) if part.outcome == Outcome::Done => worked.there += 1,
                Some(Ok(_)) if !again => worked.failed.push((item.name.clone(), self.why(item))),
                // Files that do not belong to this study are replaced.
                _ => items.push(item),
            }
        }
        if let Which::First(count) = which {
            items.truncate(count);
        }
        // An item that was started and has no part may have killed its worker, or is in progress elsewhere: do it last.
        items.sort_by_cached_key(|item| self.begun(&item.hash).exists());
        let jobs = engine.at_a_time(items.len());
        let results =
            engine.each(&items, |_, item| match self.one(kind, item, again, jobs, engine.stop, machine) {
                Ok(one) => Ok(Some(one)),
                Err(FleetError::Interrupted) => Ok(None),
                Err(error) => Err(error),
            })?;
        let mut interrupted = false;
        for (item, result) in items.iter().zip(results) {
            match result.flatten() {
                None => interrupted = true,
                Some(One::Done) => worked.done += 1,
                Some(One::There) => worked.there += 1,
                Some(One::Failed(why)) => worked.failed.push((item.name.clone(), why)),
            }
        }
        if interrupted { Err(FleetError::Interrupted) } else { Ok(worked) }
    }

    fn chosen(&self, which: Which) -> Result<Vec<&Listed>, FleetError> {
        let items = self.study.items.iter();
        let mut chosen: Vec<&Listed> = match which {
            Which::All | Which::First(_) => items.collect(),
            Which::Shard(shard) => items.filter(|item| shard.holds(&item.hash)).collect(),
            Which::Item(hash) => {
                let found = self.study.items.iter().find(|item| item.hash == hash);
                vec![found.ok_or(FleetError::NoItem { hash })?]
            }
        };
        if let Which::First(_) = which {
            // By hash, to get a sample: the first items of the study may be all of one sort.
            chosen.sort_by_key(|item| item.hash);
        }
        Ok(chosen)
    }

    fn one(
        &self,
        kind: &dyn Kind,
        listed: &Listed,
        again: bool,
        jobs: usize,
        stop: &AtomicBool,
        machine: &Machine<'_>,
    ) -> Result<One, FleetError> {
        // Another worker may have done it in the meantime.
        if let Some(Ok(part)) = self.head(listed)
            && (part.outcome == Outcome::Done || !again)
        {
            return Ok(One::There);
        }
        let item = Item::read(&self.item(&listed.hash), &listed.hash)?;
        let begun = self.begun(&listed.hash);
        // For information only; work continues if the disk is full.
        let _ = std::fs::write(&begun, machine.name);
        // Each item on one core, so that the thread's time is the item's cost.
        let (result, duration_s) = parallel::confined(1, || {
            let started_s = (machine.thread_s)();
            let result = done(kind, &item, stop);
            (result, (machine.thread_s)() - started_s)
        });
        let memory_bytes = (machine.peak_memory_bytes)().unwrap_or(0) / jobs as u64;
        let cost = (duration_s, memory_bytes);
        let keep = |outcome: Outcome, body: &str| {
            let of = (&listed.hash, &item);
            Part::write(&self.part(&listed.hash), of, (outcome, body), cost, machine)
        };
        let one = match result {
            Ok(body) => keep(Outcome::Done, &body).map(|_| One::Done),
            Err(WorkError::Failed(why)) => keep(Outcome::Failed, &why).map(|_| One::Failed(why)),
            Err(WorkError::Interrupted) => Err(FleetError::Interrupted),
        };
        let _ = std::fs::remove_file(&begun);
        one
    }

    /// Why an item failed, from its part.
    pub(crate) fn why(&self, item: &Listed) -> String {
        match self.whole(item) {
            Some(Ok((_, body))) => body.chars().take(LONGEST_REASON).collect(),
            Some(Err(refusal)) => refusal.to_string(),
            None => "its part is gone".to_owned(),
        }
    }
}

/// Longest reason that is recorded, characters.
const LONGEST_REASON: usize = 400;

/// Does an item in a directory of its own. A panic fails this item only.
fn done(kind: &dyn Kind, item: &Item, stop: &AtomicBool) -> Result<String, WorkError> {
    let room = std::env::temp_dir();
    let scratch = tempfile::Builder::new().prefix("mapper-fleet-").tempdir().map_err(|error| {
        WorkError::Failed(format!("failed to create a directory in {}: {error}", room.display()))
    })?;
    let work = |path: &Path| kind.work(&item.payload, At { scratch: path, stop });
    let result = catch_unwind(AssertUnwindSafe(|| work(scratch.path()))).unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Err(WorkError::Failed(format!("the program is at fault, it panicked: {message}")))
    });
    match result {
        // Whatever it returns after a stop, it counts as stopped.
        Err(WorkError::Failed(_)) if stop.load(Ordering::Relaxed) => Err(WorkError::Interrupted),
        other => other,
    }
}
