//! Doing items: each leaves one part, whoever is killed when.

use crate::part::{Outcome, Part};
use crate::place::Machine;
use crate::{At, Engine, Fleet, FleetError, Hash, Item, Kind, Listed, Shard, WorkError};
use mapper_numerics::parallel;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which items are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// All of them.
    All,
    /// Those of a shard.
    Shard(Shard),
    /// One.
    Item(Hash),
    /// So many that are not there yet, to see what they cost.
    First(usize),
}

/// What was worked off.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Worked {
    /// Items done now.
    pub done: usize,
    /// Items that were there already.
    pub there: usize,
    /// Items that failed now or before and were not tried again: name, and why.
    pub failed: Vec<(String, String)>,
}

/// How one item came out.
enum One {
    Done,
    There,
    Failed(String),
}

impl Fleet {
    /// Does the items that have no part yet, and with `again` those that failed. Interrupted work costs the items under way,
    /// no other.
    ///
    /// # Errors
    /// [`FleetError::Interrupted`]; [`FleetError::File`] where a part cannot be written; [`FleetError::Changed`] for an item
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
                // What is no part of this study is replaced.
                _ => items.push(item),
            }
        }
        if let Which::First(count) = which {
            items.truncate(count);
        }
        // What was begun and has no part killed its worker once, or is under way elsewhere: last.
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
            // By hash: a sample, not the first of the study, which may all be of one sort.
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
        // Somebody else may have done it since.
        if let Some(Ok(part)) = self.head(listed)
            && (part.outcome == Outcome::Done || !again)
        {
            return Ok(One::There);
        }
        let item = Item::read(&self.item(&listed.hash), &listed.hash)?;
        let begun = self.begun(&listed.hash);
        // For whoever asks; work goes on where there is no room for it.
        let _ = std::fs::write(&begun, machine.name);
        // Each item on one core: what it takes is then what the thread took.
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

    /// Why an item failed, as its part says.
    pub(crate) fn why(&self, item: &Listed) -> String {
        match self.whole(item) {
            Some(Ok((_, body))) => body.chars().take(LONGEST_REASON).collect(),
            Some(Err(refusal)) => refusal.to_string(),
            None => "its part is gone".to_owned(),
        }
    }
}

/// Longest reason that is told, characters.
const LONGEST_REASON: usize = 400;

/// Does an item in a directory of its own. A panic is a failure of this item, not of the others.
fn done(kind: &dyn Kind, item: &Item, stop: &AtomicBool) -> Result<String, WorkError> {
    let room = std::env::temp_dir();
    let scratch = tempfile::Builder::new().prefix("mapper-fleet-").tempdir().map_err(|error| {
        WorkError::Failed(format!("failed to create a directory in {}: {error}", room.display()))
    })?;
    let work = |path: &Path| kind.work(&item.payload, At { scratch: path, stop });
    let result = catch_unwind(AssertUnwindSafe(|| work(scratch.path()))).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().map(String::as_str);
        let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Err(WorkError::Failed(format!("the program is at fault, it panicked: {said}")))
    });
    match result {
        // Whatever it says when it is stopped, it was stopped.
        Err(WorkError::Failed(_)) if stop.load(Ordering::Relaxed) => Err(WorkError::Interrupted),
        other => other,
    }
}
