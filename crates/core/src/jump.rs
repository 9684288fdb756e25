//! From one operating point to another, and jumps that are made again.

use crate::OperatingPoint;
use serde::{Deserialize, Serialize};

/// From where to where.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jump {
    /// The point before the jump.
    pub from: OperatingPoint,
    /// The point after it.
    pub to: OperatingPoint,
}

/// A jump that is made again and again, so that drift shows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeats {
    /// The jump; `None`: from the slowest to the fastest point of the middle opening, or the next best jump that is
    /// allowed.
    pub jump: Option<Jump>,
    /// Steps between two of them at most, >= 2.
    pub every_steps: usize,
    /// Fewest of them, >= 1.
    pub at_least: usize,
}
