//! Blocks of consecutive samples, whose means are compared with the model.

use crate::averages::mean_reading::mean_reading;
use crate::averages::schedule::Schedule;
use crate::averages::time_table::Table;

/// A few consecutive samples, compared with the model as their mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The samples.
    pub samples: std::ops::Range<usize>,
    /// Mean of their times, s.
    pub mean_s: f64,
    /// Standard deviation of their times, s. The mean of the model is taken from the two points at this distance from `mean_s`, which is
    /// exact for cubics in the first two moments.
    pub spread_s: f64,
    /// Mean time since the jump, s.
    pub since_jump_s: f64,
}

/// Blocks from `start_s` to `end_s` according to the schedule; empty ones are omitted.
pub fn blocks(table: &Table, start_s: f64, end_s: f64, schedule: &Schedule) -> Vec<Block> {
    let segments = schedule.segments(start_s, end_s, table.interval_s);
    let block = |(from_s, to_s): (f64, f64)| {
        // Half a sample later, so that rounding cannot move a sample across an edge.
        let samples = table.range(from_s + 0.5 * table.interval_s, to_s + 0.5 * table.interval_s);
        let times = &table.t_s[samples.clone()];
        let mean_s = mean_reading(times)?;
        let spread_s =
            (times.iter().map(|t| (t - mean_s) * (t - mean_s)).sum::<f64>() / times.len() as f64).sqrt();
        Some(Block { samples, mean_s, spread_s, since_jump_s: mean_s - start_s })
    };
    segments.into_iter().filter_map(block).collect()
}

/// Mean of a channel in a block; `None` if samples are missing.
pub fn block_mean(values: &[f64], block: &Block) -> Option<f64> {
    mean_reading(&values[block.samples.clone()])
}
