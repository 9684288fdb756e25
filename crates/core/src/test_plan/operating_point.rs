//! Target of a step on the map: a shaft speed and a valve opening.

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

impl OperatingPoint {
    /// Largest setpoint of a back-pressure valve's opening, relative to its nominal area.
    pub const OPENING_MAX_RATIO: f64 = 2.5;

    /// Speed in krpm and opening for display, rounded to the resolution of a rig: 0.01 rpm and 1e-4.
    pub fn shown(&self) -> (f64, f64) {
        ((self.speed_rpm * 1e2).round() / 1e5, (self.valve_opening_ratio * 1e4).round() / 1e4)
    }

    /// Whether two points are the same on any rig: speeds within 1e-3 rpm, openings within 1e-6.
    pub fn is_same_place(&self, other: &OperatingPoint) -> bool {
        (self.speed_rpm - other.speed_rpm).abs() < 1e-3
            && (self.valve_opening_ratio - other.valve_opening_ratio).abs() < 1e-6
    }
}

impl std::fmt::Display for OperatingPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (krpm, opening) = self.shown();
        write!(f, "{krpm}krpm@{opening}")
    }
}
