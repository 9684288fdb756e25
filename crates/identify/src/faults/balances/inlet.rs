//! T1 against Tc within a step: the inlet keeps its temperature while the housing changes its own.
//!
//! A probe that is drawn to the housing by a share k of their distance changes by `k dTc`. Air that the housing warms before the probe does the same,
//! and T1 is then right: a recording does not tell them apart.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Rows, own};
use crate::faults::end_readings::{CHANNELS, Readings};
use crate::step_data::samples::{Row, Samples, slope_per_s};
use mapper_core::{Channel, FaultKind, Recording, StepMarker, Window, WindowRule};
use mapper_numerics::statistics::{MIN_VALUES, mean, rms};

/// Change of the inlet temperature within a step that goes with Tc by chance, one standard deviation, K. Bound: the air of a cell wanders by a
/// few tenths of a kelvin in a minute.
const INLET_K: f64 = 0.15;
/// Smallest change of Tc in a step, root mean square about its mean, K. Bound: the noise of its thermocouple.
const MIN_CHANGE_K: f64 = 0.5;

/// `readings`: of all steps, by position.
pub(crate) fn rows(
    recording: &Recording,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
) -> Option<Rows> {
    let of_step = |(step, readings): (&StepMarker, &Option<Readings>)| {
        let window = Window { start_s: step.start_s + WindowRule::EARLIEST_S, end_s: step.end_s };
        let samples = Samples::of(recording, window, config, true);
        Some((change_k(&samples, config)?, (*readings)?))
    };
    let found: Vec<_> = recording.steps.iter().zip(readings).filter_map(of_step).collect();
    let count = found.len();
    (count >= MIN_VALUES).then(|| Rows {
        residual: found.iter().map(|(change, _)| change.t1_k).collect(),
        covariance: own(found.iter().map(|(change, _)| change.noise_k.hypot(INLET_K))),
        readings: found.iter().map(|(_, readings)| *readings).collect(),
        by_reading: vec![[0.0; CHANNELS.len()]; count],
        by_machine: Vec::new(),
        by_fault: vec![(
            Channel::T1,
            FaultKind::TowardsWall,
            found.iter().map(|(change, _)| change.tc_k).collect(),
        )],
    })
}

/// Changes within a step, root mean square about the mean.
struct Change {
    tc_k: f64,
    /// The part of T1 that goes with Tc.
    t1_k: f64,
    noise_k: f64,
}

/// `None` if Tc hardly changes.
fn change_k(samples: &Samples, config: &IdentifyConfig) -> Option<Change> {
    let rows = || samples.rows.iter();
    let by_tc = slope_per_s(rows().map(|row| (row.tc_k, row.t1_k)))?;
    let middle = |of: fn(&Row) -> f64| mean(rows().map(of));
    let (t1_k, tc_k) = (middle(|row| row.t1_k)?, middle(|row| row.tc_k)?);
    let change_k = rms(rows().map(|row| row.tc_k - tc_k)).filter(|change_k| *change_k > MIN_CHANGE_K)?;
    let left_k = rms(rows().map(|row| row.t1_k - t1_k - by_tc * (row.tc_k - tc_k)))?;
    let independent = samples.len() as f64 / samples.correlated(config)?;
    Some(Change { tc_k: change_k, t1_k: by_tc * change_k, noise_k: left_k / independent.sqrt() })
}
