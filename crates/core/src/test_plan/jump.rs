//! Jumps from one operating point to another, and repeated jumps.

use crate::OperatingPoint;
use serde::{Deserialize, Serialize};

/// Start and end of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jump {
    /// The point before the jump.
    pub from: OperatingPoint,
    /// The point after it.
    pub to: OperatingPoint,
}

/// A jump that is repeated to show drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeats {
    /// The jump. If it is `None`, the jump from the slowest to the fastest point of the middle opening, or the best jump that is allowed.
    pub jump: Option<Jump>,
    /// Maximum number of steps between two repeats, >= 2.
    pub every_steps: usize,
    /// Minimum number of repeats, >= 1.
    pub at_least: usize,
}
