//! Limits that a run must never exceed.

use serde::{Deserialize, Serialize};

/// Maximum time beyond the surge line, s: a jump may touch the line, but a point may not stay beyond it.
pub const SURGE_ALLOWED_S: f64 = 5.0;

/// Limits of a rig and its machine. They apply to points, to jumps, and to a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Lowest allowed setpoint of the turbine inlet pressure, Pa.
    pub p3_min_pa: f64,
    /// Highest allowed setpoint of the turbine inlet pressure, Pa.
    pub p3_max_pa: f64,
    /// Time of the rig from the lowest to the highest turbine inlet pressure, s, > 0; `None` if it is not considered.
    pub p3_stroke_s: Option<f64>,
    /// Highest turbine inlet temperature, K.
    pub t3_max_k: Option<f64>,
    /// Highest compressor outlet temperature, K; also during jumps.
    pub t2_max_k: Option<f64>,
    /// Smallest surge margin of a point: flow over the surge flow at equal corrected speed, minus one. `None`
    /// means the surge line itself, 0.
    pub surge_margin_min_ratio: Option<f64>,
    /// Largest change of the compressor housing within a window, K.
    pub housing_gradient_max_k: Option<f64>,
}

impl Limits {
    /// Maximum rate of the turbine inlet pressure, Pa/s; `None` if no stroke is given.
    pub fn p3_slew_max_pa_s(&self) -> Option<f64> {
        self.p3_stroke_s.map(|stroke_s| (self.p3_max_pa - self.p3_min_pa) / stroke_s)
    }

    /// Minimum surge margin of a point: the declared one, or the surge line.
    pub fn surge_margin_floor_ratio(&self) -> f64 {
        self.surge_margin_min_ratio.unwrap_or(0.0)
    }
}
