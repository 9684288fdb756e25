//! Tc against T2: the housing's heat balance.
//!
//! Within a step the housing temperature changes, and T2 follows it by a share `s` that the step itself determines. By eq. 3, `T2 = s Tc + (1
//! - s) T2ad`, so `s` is the slope of T2 over Tc, whatever the offsets. The heat flow from gas to housing is `K (T2 - Tc)` with `K = m cp s/(1
//! - s)`, and it is stored or lost:
//!
//! `K (T2 - Tc) = C dTc/dt + b Tc - a + alpha K (Tc - T1) + K d`
//!
//! with one heat capacity `C`, one loss `b` to oil, cell and turbine, and one share `alpha` before the wheel for the whole recording. `d` is
//! the reading difference of T2 and Tc at equal temperature. `K` changes by a factor of five over a map and `dTc/dt` its sign. A single
//! recording therefore determines `d` to some tenths of a kelvin. A housing of several masses shifts `d`, which is part of the declared
//! uncertainty.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Rows, common, own};
use crate::faults::end_readings::{CHANNELS, MAX_CORRELATED_ROWS, PerChannel, Readings, span_s};
use crate::step_data::samples::{Row, Samples, slope_per_s};
use mapper_core::{Channel, FaultKind, Recording, StepKind, StepMarker, Window, WindowRule};
use mapper_numerics::statistics::{DOUBT_SIGMAS, MIN_VALUES, mean, rms};

/// Length of a part over which the housing's slope is taken, s. Bound: noise of 0.15 K at 10 Hz leaves 0.002 K/s, and a step of a minute
/// has three.
const PART_S: f64 = 18.0;
/// Closure error of a balance, W. Judgement: a tenth of the heat that a hot housing exchanges.
const CLOSURE_ERROR_W: f64 = 10.0;
/// Difference of T2 and Tc in a housing with more than one temperature, one standard deviation, K. Bound: 1 K is three of it.
const UNEVEN_K: f64 = 0.35;
/// The same for the part that develops over the run as it warms up, K. Bound: a housing of two walls makes up to 3 K.
const UNEVEN_DRIFT_K: f64 = 1.0;

/// A part of a step.
struct Part {
    slope_k_s: f64,
    t1_k: f64,
    t2_k: f64,
    tc_k: f64,
    conductance_w_k: f64,
    /// Noise error of the conductance, which all parts of a step share, one standard deviation, W/K.
    conductance_error_w_k: f64,
    middle_s: f64,
}

impl Part {
    /// Effect of area before the wheel in addition to its distance from T1, per share of it, K: compression amplifies that heat, and the slope
    /// of T2 over Tc includes it with the heat after the wheel.
    fn inlet_gain_k(&self) -> f64 {
        (self.t2_k - self.t1_k) / self.t1_k * (self.t2_k - self.tc_k)
    }
}

pub(crate) fn rows(recording: &Recording, config: &IdentifyConfig, used: &[bool]) -> Option<Rows> {
    let count = used.iter().filter(|used| **used).count();
    let max_parts = (MAX_CORRELATED_ROWS / count.max(1)).max(1);
    let steps: Vec<Vec<Part>> = recording
        .steps
        .iter()
        .zip(used)
        .map(|(step, used)| {
            if *used {
                parts(recording, step.start_s + WindowRule::EARLIEST_S, step.end_s, config, max_parts)
            } else {
                Vec::new()
            }
        })
        .collect();
    let is_point =
        |(step, parts): &(&StepMarker, &Vec<Part>)| step.kind == StepKind::Point && !parts.is_empty();
    if recording.steps.iter().zip(&steps).filter(is_point).count() < MIN_VALUES {
        return None;
    }
    let parts: Vec<&Part> = steps.iter().flatten().collect();
    let step_of: Vec<usize> =
        steps.iter().enumerate().flat_map(|(step, parts)| vec![step; parts.len()]).collect();
    let (first_s, last_s) = span_s(recording)?;
    let run_ratio = |part: &Part| (part.middle_s - first_s) / (last_s - first_s);
    let column = |of: &dyn Fn(&Part) -> f64| parts.iter().map(|part| of(part)).collect::<Vec<f64>>();
    // Losses count from the mean, so that the constants stay small.
    let middle_k = mean(parts.iter().map(|part| part.tc_k))?;
    let heat_w = column(&|part| part.conductance_w_k * (part.t2_k - part.tc_k));
    // Heat capacity, loss per kelvin, constant loss and alpha_A of an unknown housing: each may be as large as the heat itself.
    let unknown = [
        column(&|part| part.slope_k_s),
        column(&|part| part.tc_k - middle_k),
        column(&|_| 1.0),
        column(&|part| part.conductance_w_k * (part.tc_k - part.t1_k)),
        column(&|part| part.conductance_w_k * part.inlet_gain_k()),
    ];
    let as_large_as_the_heat = |column: Vec<f64>| {
        let sigma =
            rms(&heat_w).zip(rms(&column)).map_or(0.0, |(heat, one)| heat / one.max(f64::MIN_POSITIVE));
        (column, sigma)
    };
    let uneven = [
        (column(&|part| part.conductance_w_k), UNEVEN_K),
        (column(&|part| part.conductance_w_k * (run_ratio(part) - 0.5)), UNEVEN_DRIFT_K),
    ];
    let covariance = unknown
        .map(as_large_as_the_heat)
        .iter()
        .chain(&uneven)
        .map(|(column, sigma)| common(column, *sigma))
        .fold(own(parts.iter().map(|_| CLOSURE_ERROR_W)), |sum, one| sum + one);
    let by_conductance = column(&|part| part.conductance_error_w_k * (part.t2_k - part.tc_k));
    let of_the_same_step = common(&by_conductance, 1.0)
        .map_with_location(|i, j, shared| if step_of[i] == step_of[j] { shared } else { 0.0 });
    let covariance = covariance + of_the_same_step;
    let by_reading = |part: &&Part| -> PerChannel {
        CHANNELS.map(|channel| match channel {
            Channel::T2 => part.conductance_w_k,
            Channel::Tc => -part.conductance_w_k,
            _ => 0.0,
        })
    };
    // A gain of T2 also scales the conductance, which capacity and loss absorb. The remaining effect is its error at the housing temperature.
    let readings = |part: &&Part| {
        let values = CHANNELS.map(|channel| match channel {
            Channel::T1 => part.t1_k,
            Channel::T2 | Channel::Tc => part.tc_k,
            _ => f64::NAN,
        });
        Readings { values, run_ratio: run_ratio(part), exact_at: config.exact_at, air: config.air }
    };
    Some(Rows {
        residual: heat_w,
        covariance,
        readings: parts.iter().map(readings).collect(),
        by_reading: parts.iter().map(by_reading).collect(),
        by_machine: Vec::new(),
        // It scales the conductance and the difference of the temperatures, which capacity and loss absorb.
        by_fault: vec![(Channel::T2, FaultKind::TowardsWall, column(&|_| 0.0))],
    })
}

/// At most `max_parts` parts of a step; none if T2 does not determine the share by which it follows the housing.
fn parts(
    recording: &Recording,
    start_s: f64,
    end_s: f64,
    config: &IdentifyConfig,
    max_parts: usize,
) -> Vec<Part> {
    if end_s - start_s < PART_S {
        return Vec::new();
    }
    let samples = Samples::of(recording, Window { start_s, end_s }, config, true);
    let Some((kept, error)) = kept_ratio(&samples, config) else { return Vec::new() };
    // The gas keeps some of its temperature and loses some.
    if kept.min(1.0 - kept) < DOUBT_SIGMAS * error {
        return Vec::new();
    }
    let count = (((end_s - start_s) / PART_S).floor() as usize).min(max_parts);
    let whole = samples.len();
    let part = |place: usize| {
        let range = place * whole / count..(place + 1) * whole / count;
        if range.len() < MIN_VALUES {
            return None;
        }
        let rows = &samples.rows[range];
        let of = |of: fn(&Row) -> f64| mean(rows.iter().map(of));
        let (middle_s, tc_k, t1_k) = (of(|row| row.t_s)?, of(|row| row.tc_k)?, of(|row| row.t1_k)?);
        let t2_k = of(|row| row.t2_k)?;
        let capacity_w_k = of(|row| row.flow_kg_s)? * config.air.heat_capacity_j_kgk(t1_k);
        let conductance_w_k = capacity_w_k * (1.0 - kept) / kept;
        // d((1 - kept)/kept) = -d kept/kept^2.
        let conductance_error_w_k = capacity_w_k * error / (kept * kept);
        let slope_k_s = slope_per_s(rows.iter().map(|row| (row.t_s, row.tc_k)))?;
        conductance_error_w_k.is_finite().then_some(Part {
            slope_k_s,
            t1_k,
            t2_k,
            tc_k,
            conductance_w_k,
            conductance_error_w_k,
            middle_s,
        })
    };
    (0..count).filter_map(part).collect()
}

/// Share of its temperature after compression that the gas keeps, and its error: by least squares of `T2 - Tc = kept (T1 - Tc) + (kept/eta)
/// dT_is`.
fn kept_ratio(samples: &Samples, config: &IdentifyConfig) -> Option<(f64, f64)> {
    let count = samples.len();
    if count < 2 * MIN_VALUES {
        return None;
    }
    let row = |row: &Row| (row.t1_k - row.tc_k, row.t1_k * row.rise_ratio, row.t2_k - row.tc_k);
    let rows = || samples.rows.iter().map(row);
    let (aa, ab, bb, ay, by) = rows().fold((0.0, 0.0, 0.0, 0.0, 0.0), |sums, (a, b, y)| {
        (sums.0 + a * a, sums.1 + a * b, sums.2 + b * b, sums.3 + a * y, sums.4 + b * y)
    });
    let determinant = aa * bb - ab * ab;
    let (kept, of_rise) = ((bb * ay - ab * by) / determinant, (aa * by - ab * ay) / determinant);
    let left: f64 = rows().map(|(a, b, y)| (y - kept * a - of_rise * b).powi(2)).sum();
    let variance = samples.correlated(config)? * left / count as f64 * bb / determinant;
    (kept.is_finite() && variance.is_finite() && variance > 0.0).then(|| (kept, variance.sqrt()))
}
