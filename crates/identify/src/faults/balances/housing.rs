//! Balances of the housing: its heat, convection, and the inlet temperature.
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
use crate::faults::balances::efficiency::{FittedEfficiencies, compressed};
use crate::faults::end_readings::{CHANNELS, MAX_CORRELATED_ROWS, PerChannel, Readings, span_s};
use crate::faults::found_fault::Machine;
use crate::faults::nominal_rig::NominalRig;
use crate::single_step::fit::ETA_BOUNDS;
use crate::step_data::samples::{Row, Samples, slope_per_s};
use mapper_core::{Channel, FaultKind, Recording, StepKind, StepMarker, Window, WindowRule};
use mapper_numerics::statistics::{DOUBT_SIGMAS, MIN_VALUES, mean, rms};
use mapper_physics::laws::convection;
use nalgebra::DMatrix;

/// Length of a part over which the housing's slope is taken, s. Bound: noise of 0.15 K at 10 Hz leaves 0.002 K/s, and a step of a minute
/// has three.
const PART_S: f64 = 18.0;
/// Closure error of a balance, W. Judgement: a tenth of the heat that a hot housing exchanges.
const CLOSURE_ERROR_W: f64 = 10.0;
/// Difference of T2 and Tc in a housing with more than one temperature, one standard deviation, K. Bound: 1 K is three of it.
const UNEVEN_K: f64 = 0.35;
/// The same for the part that develops over the run as it warms up, K. Bound: a housing of two walls makes up to 3 K.
const UNEVEN_DRIFT_K: f64 = 1.0;

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

// Heat-transfer coefficients of the joint fit compared with the declared machine's.
// The fit takes h from the slope of T2 over Tc, `s = 1 - exp(-n)` with `n = h A/(m cp)` transfer units. A constant error of a reading hardly
// changes it. A gain `g` of T2 makes it `s (1 + g)`, and a probe that reads a share `x` of the way to the housing `s + x (1 - s)`: ln h rises by
// `g s/((1 - s) n)` and by `x/n`.

/// Scatter of the points about the declared law, ratio: its shape over the map. Bound: correlations that fit one rig scatter by less,
/// 0.003 in the joint fit.
const SHAPE_RATIO: f64 = 0.01;

/// ln h itself, with the effects of errors on it. `readings`: of all steps, by position.
pub(crate) fn measured(
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
) -> Rows {
    let heat = &fitted.ln_h;
    let known = fitted.known(readings);
    let count = known.len();
    let units = |(row, readings): &(usize, Readings)| {
        let capacity_w_k = readings.flow_kg_s() * config.air.heat_capacity_j_kgk(readings.t2_k());
        heat.values[*row].exp() * config.internal_area_m2 / capacity_w_k
    };
    let units: Vec<f64> = known.iter().map(units).collect();
    let by_gain: Vec<f64> = units.iter().map(|units| units.exp_m1() / units).collect();
    let by_reading = |(row, readings): &(usize, Readings)| {
        let by_fit = &heat.by_reading[*row];
        // At equal transfer units h is proportional to the flow.
        let fallback = |channel| {
            if CHANNELS[channel] == Channel::CompressorFlow { readings.flow_kg_s().recip() } else { 0.0 }
        };
        std::array::from_fn(|channel| by_fit[channel].unwrap_or_else(|| fallback(channel)))
    };
    Rows {
        residual: known.iter().map(|(row, _)| heat.values[*row]).collect(),
        covariance: DMatrix::from_fn(count, count, |i, j| heat.covariance[(known[i].0, known[j].0)]),
        by_reading: known.iter().map(by_reading).collect(),
        readings: known.iter().map(|(_, readings)| *readings).collect(),
        by_machine: Vec::new(),
        by_fault: vec![
            (Channel::T2, FaultKind::TowardsWall, units.iter().map(|units| units.recip()).collect()),
            (Channel::Tc, FaultKind::Gain, by_gain.iter().map(|gain| -gain).collect()),
            (Channel::T2, FaultKind::Gain, by_gain),
            (Channel::T1, FaultKind::Gain, vec![0.0; count]),
        ],
    }
}

/// ln h over that of the declared machine.
pub(crate) fn convection_rows(
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
    nominal: &NominalRig<'_>,
) -> Option<Rows> {
    let mut rows = measured(fitted, readings, config);
    let compressor = &nominal.model.params.compressor;
    let known = fitted.known(readings).into_iter();
    let etas: Vec<f64> =
        known.map(|(row, _)| fitted.eta.values[row].clamp(ETA_BOUNDS.0, ETA_BOUNDS.1)).collect();
    for (i, (readings, eta)) in rows.readings.iter().zip(etas).enumerate() {
        let declared = |readings: &Readings| {
            let h_w_m2k = convection::coefficient_w_m2k(
                compressor.nusselt_coefficient,
                compressor.nusselt_exponent,
                compressor.outlet_diameter_m,
                readings.flow_kg_s(),
                compressed(readings, eta),
                readings.tc_k(),
            );
            h_w_m2k.ln()
        };
        rows.residual[i] -= declared(readings);
        let law = readings.derivatives(declared);
        rows.by_reading[i].iter_mut().zip(law).for_each(|(own, law)| *own -= law);
    }
    let count = rows.residual.len();
    (count > 0).then_some(())?;
    rows.covariance += own(vec![SHAPE_RATIO; count].into_iter())
        + common(&vec![1.0; count], nominal.tolerances.convection_ratio);
    rows.by_machine = vec![(Machine::Convection, vec![1.0; count])];
    Some(rows)
}

// T1 against Tc within a step: the inlet keeps its temperature while the housing changes its own.
// A probe that is drawn to the housing by a share k of their distance changes by `k dTc`. Air that the housing warms before the probe does the same,
// and T1 is then right: a recording does not tell them apart.

/// Change of the inlet temperature within a step that goes with Tc by chance, one standard deviation, K. Bound: the air of a cell wanders by a
/// few tenths of a kelvin in a minute.
const INLET_K: f64 = 0.15;
/// Smallest change of Tc in a step, root mean square about its mean, K. Bound: the noise of its thermocouple.
const MIN_CHANGE_K: f64 = 0.5;

/// `readings`: of all steps, by position.
pub(crate) fn inlet_rows(
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
