//! `grid:`

use crate::units::{Quantity, Speed};
use schemars::JsonSchema;
use serde::Deserialize;

/// The operating points: every speed at every opening, or a list.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GridFile {
    /// Speed lines; each is visited at each of `openings`.
    #[schemars(length(min = 1, max = 1000), extend("examples" = [["50 krpm", "80 krpm"]]))]
    pub speeds: Option<Vec<SpeedFile>>,
    /// Openings of the back-pressure valve relative to its nominal area, plain numbers above 0, at most 2.5.
    #[schemars(length(min = 1, max = 1000), extend("examples" = [[0.5, 1.0, 2.5]]))]
    pub openings: Option<Vec<Opening>>,
    /// Points of `speeds` x `openings` that are left out.
    #[schemars(length(min = 1, max = 20000))]
    pub skip: Option<Vec<PointFile>>,
    /// The points one by one.
    #[schemars(length(min = 1, max = 20000))]
    pub points: Option<Vec<PointFile>>,
}

/// A point.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointFile {
    /// Shaft speed, physical, not corrected.
    pub speed: SpeedFile,
    /// Opening of the back-pressure valve relative to its nominal area, a plain number above 0, at most 2.5.
    pub opening: Opening,
}

/// Shaft speed, physical, not corrected.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub(crate) struct SpeedFile(
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"))] pub Quantity<Speed>,
);

/// Opening of the back-pressure valve relative to its nominal area, a plain number above 0, at most 2.5.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub(crate) struct Opening(
    #[schemars(range(max = 2.5), extend("exclusiveMinimum" = 0), example = 0.5)] pub f64,
);
