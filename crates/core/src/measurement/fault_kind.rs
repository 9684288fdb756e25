//! Kinds of sensor faults: guards, redundant sensors, identification, drift and diagnosis name a fault with them.

use serde::Serialize;
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
