//! Cost of a study, extrapolated from the finished items.

use crate::directory::shared_files::Machine;
use crate::{Engine, Fleet, FleetError, ItemSelection, Kind, Status};
use serde::Serialize;

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
    ///
    /// # Errors
    /// As [`Fleet::work`]; [`FleetError::UnknownCost`] if none has a result.
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
