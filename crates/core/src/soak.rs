//! The machine at rest before a run.

use serde::{Deserialize, Serialize};

/// How the machine rests before it runs, so that sensors which must read the same can be held against each other: the
/// isothermal zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Soak {
    /// Time at rest, s, > 0.
    pub duration_s: f64,
    /// Oil inlet temperature in the meantime, K: that of cell and inlet air.
    pub oil_temperature_k: f64,
}
