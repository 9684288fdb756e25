//! Kinds of sensor faults, and what a frozen reading is: one that repeats a value for longer than noise and resolution allow.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Form of the error of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A thermocouple reads a temperature between gas and wall: share of the difference.
    TowardsWall,
    /// The reading follows with a lag, s. T2 has two in series: a sheath of this diameter, m, as in eqs. 11 and 12, and the element in it.
    Lag,
    /// An error proportional to the reading; for temperatures, to the difference from 20 degC. Ratio.
    Gain,
    /// A constant error of every reading, in the channel's unit (K, Pa, kg/s, rpm).
    Offset,
    /// A drift from zero at the start of the run to the full size at its end: in the unit of the channel, but a ratio to the
    /// reading for flow and speed.
    Drift,
    /// An error proportional to the square of the flow, in the channel's unit at a flux of 120 kg/(s m2): dynamic pressure at a tap, gas that is
    /// not mixed at a probe.
    WithFlowSquared,
    /// An error proportional to the opening of the valve, in the channel's unit at opening 1: flow around a tap that changes with it.
    WithValve,
    /// The reading repeats one value for longer than noise allows, s.
    Frozen,
    /// No reading for much of the time: share of it.
    Silent,
    /// A reading that no machine can have.
    OutOfRange,
    /// A change that is faster than the sensor can follow.
    Jump,
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FaultKind::TowardsWall => "conduction along the probe",
            FaultKind::Lag => "lag",
            FaultKind::Gain => "gain error",
            FaultKind::Offset => "offset",
            FaultKind::Drift => "drift",
            FaultKind::WithFlowSquared => "error with flow squared",
            FaultKind::WithValve => "error with valve opening",
            FaultKind::Frozen => "frozen reading",
            FaultKind::Silent => "missing readings",
            FaultKind::OutOfRange => "impossible reading",
            FaultKind::Jump => "impossible jump",
        })
    }
}

/// Maximum time for which a channel of known noise can repeat one value, s. Bound: noise repeats a value in two or three samples of a coarse logger,
/// not for seconds.
pub const NOISY_REPEAT_S: f64 = 5.0;

/// Maximum time, s, and number of samples for which any channel can repeat one value while others change. Bound: a coarse digit repeats four of five
/// samples, and 20 of them in 1 % of cases only.
pub const COARSE_REPEAT_S: f64 = 20.0;
/// See [`COARSE_REPEAT_S`]. Bound: as there.
pub const COARSE_REPEAT_SAMPLES: usize = 20;

/// Movement below which a reading counts as constant after a jump of the setpoints, as a share of its declared noise. Bound: 200 samples of a working
/// sensor cover five standard deviations, and a tenth of them if its noise was declared ten times too large.
const BAND_NOISE_RATIO: f64 = 0.1;

/// Like [`BAND_NOISE_RATIO`], as a share of the reading (4 mK of 400 K, 2 Pa of 200 kPa). Bound: the noise of thermocouple and pressure amplifiers is
/// larger, and a jump of the setpoints moves a reading a hundred times as far.
const BAND_READING_RATIO: f64 = 1e-5;

/// A reading is frozen if it has stayed within its band since before a jump of the setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrozenLimit {
    /// Time after the jump, s, > 0.
    pub after_s: f64,
    /// Half width of the band, unit of the channel, >= 0.
    pub band: f64,
}

impl FrozenLimit {
    /// The limit of a channel with declared noise; `None` without noise, as an ideal sensor repeats its value.
    pub fn of_noise(noise_sigma: f64, after_s: f64) -> Option<FrozenLimit> {
        (noise_sigma > 0.0).then_some(FrozenLimit { after_s, band: BAND_NOISE_RATIO * noise_sigma })
    }

    /// Whether a reading has not moved from an earlier one.
    pub fn is_constant(&self, earlier: f64, reading: f64) -> bool {
        (reading - earlier).abs() <= self.band.max(BAND_READING_RATIO * earlier.abs())
    }
}

/// The runs of one value repeated to the last digit, as the places of their first and last reading; a value that does not repeat is a run of
/// one.
pub fn repeats(values: &[f64]) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    values.chunk_by(|a, b| a == b).map(move |run| {
        let found = (first, first + run.len() - 1);
        first += run.len();
        found
    })
}
