//! Where on the map a step aims: a shaft speed and a valve opening.

use serde::{Deserialize, Serialize};

/// A point of the measuring grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OperatingPoint {
    /// Target shaft speed, rpm (physical, not corrected).
    pub speed_rpm: f64,
    /// Back-pressure valve opening relative to the nominal area, 0..2.5.
    #[serde(rename = "valve")]
    pub valve_opening_ratio: f64,
}

impl std::fmt::Display for OperatingPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}krpm@{}", self.speed_rpm / 1000.0, self.valve_opening_ratio)
    }
}
