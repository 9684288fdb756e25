//! What a study costs, from the items that are done.

use crate::place::Machine;
use crate::{Engine, Fleet, FleetError, Kind, Status, Which};
use serde::Serialize;

/// What was tried to know the cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// What it costs.
    pub cost: Cost,
    /// How far the study is.
    pub status: Status,
}

/// What a study costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cost {
    /// Number of items.
    pub items: usize,
    /// Items that are done: what the rest is reckoned from.
    pub from: usize,
    /// Items without a result.
    pub left: usize,
    /// What an item takes on one core on average, s.
    pub item_s: f64,
    /// What the longest took, s.
    pub longest_s: f64,
    /// Processor time of all items, h.
    pub hours: f64,
    /// Processor time of what is left, h.
    pub left_hours: f64,
    /// Memory that one item needs at a time, bytes; 0: nobody knows.
    pub memory_bytes: u64,
    /// What items and parts take on the shared disk, bytes.
    pub disk_bytes: u64,
}

/// What a part's first line takes, and the rest of a block of the disk, bytes.
const PART_BESIDE_BYTES: u64 = 4096;

impl Fleet {
    /// What the study costs, as far as what is done says it; `None` where nothing is done.
    pub fn cost(&self, status: &Status) -> Option<Cost> {
        let left_s = status.left_s()?;
        let from = status.done.max(1);
        let (items, item_s) = (status.items, status.spent_s / from as f64);
        let item_bytes = self
            .study
            .items
            .first()
            .map_or(0, |item| std::fs::metadata(self.item(&item.hash)).map_or(0, |file| file.len()));
        let part_bytes = status.disk_bytes / from as u64 + PART_BESIDE_BYTES;
        Some(Cost {
            items,
            from: status.done,
            left: status.lacking(),
            item_s,
            longest_s: status.longest_s,
            hours: item_s * items as f64 / 3600.0,
            left_hours: left_s / 3600.0,
            memory_bytes: status.memory_bytes,
            disk_bytes: (item_bytes + part_bytes) * items as u64,
        })
    }

    /// Does a few items where fewer are done, one at a time, and says what all will cost. What was tried stays done.
    ///
    /// # Errors
    /// As [`Fleet::work`]; [`FleetError::NothingTried`] where none has a result.
    pub fn tried(
        &self,
        kind: &dyn Kind,
        count: usize,
        engine: &Engine<'_>,
        machine: &Machine<'_>,
    ) -> Result<Tried, FleetError> {
        let done = self.status().done;
        let mut why = String::new();
        if done < count {
            // One at a time: its time and its memory are its own.
            let one = Engine { jobs: Some(1), ..*engine };
            let worked = self.work(kind, Which::First(count - done), false, &one, machine)?;
            why = worked
                .failed
                .into_iter()
                .next()
                .map(|(name, why)| format!("{name}: {why}"))
                .unwrap_or_default();
        }
        let status = self.status();
        let cost = self.cost(&status).ok_or(FleetError::NothingTried { why })?;
        Ok(Tried { cost, status })
    }
}
