//! Rows of the joint fit, and the smoothed readings that they use.

use crate::IdentifyConfig;
use crate::joint::step_model::parameters::Place;
use crate::step_data::end_state::EndState;
use crate::step_data::samples::{self, FOLLOWED_S, Samples};
use mapper_core::{Channel, Recording, Series, Window, is_reading};
use mapper_numerics::coloured_noise::covariance_of_means;
use mapper_numerics::statistics::mean;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Rounding error of the time of a sample, s. Source: recordings store nanoseconds; half of one.
pub(crate) const TIME_ROUNDING_S: f64 = 5e-10;

/// Length of the blocks over which samples are averaged before the fit, s. Bound: a quarter of the correlation time of sensor noise, and
/// far below any time scale in a window.
pub const BLOCK_S: f64 = 0.5;
/// Factor on this length for noisy data from [`FOLLOWED_S`] after the first sample on, and in a forecast. Bound: it costs a few percent
/// of the information. Without noise it would cost a thousandth of alpha_A behind a slow probe.
pub(crate) const COARSER: f64 = 2.0;
/// Number of blocks after that time in a long window. Bound: the cost of a step grows with the cube of its rows, and a housing's time constant
/// of minutes has dozens of them.
const MAX_LATE_BLOCKS: f64 = 60.0;
/// Minimum number of them. Bound: a housing's exponential over a window, and settling before it.
const MIN_LATE_BLOCKS: f64 = 12.0;
/// Rows of T2 in all steps of a recording, above which its steps have fewer late blocks. Bound: 160 steps of full length; of 300 steps, the
/// covariances then take 20 MB instead of 90, and no interval of theirs changes by more than a tenth.
const MAX_ROWS: f64 = 16_384.0;
/// Gap between two rows above which the other parts of the housing start settled, s. Bound: twenty time constants of a wall of a few hundred J/K behind 15
/// W/K are longer, but the operating point in a gap is not known.
pub(crate) const MAX_ROW_GAP_S: f64 = 5.0;

/// Means over one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    pub(crate) t_s: f64,
    pub(crate) t1_k: f64,
    pub(crate) t2_k: f64,
    pub(crate) tc_k: f64,
    /// Housing temperature as read, without smoothing, K.
    pub(crate) tc_read_k: f64,
    /// Slope of Tc, K/s.
    pub(crate) tc_slope_k_s: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) flow_kg_s: f64,
    /// Turbine housing, oil and cell, K; NaN if not recorded.
    pub(crate) tt_k: f64,
    pub(crate) oil_k: f64,
    pub(crate) ambient_k: f64,
    pub(crate) speed_rpm: f64,
    /// Corrected speed and flow.
    pub(crate) place: (f64, f64),
}

impl Row {
    /// Whether the temperatures on both sides of the bearing are known.
    pub(crate) fn has_neighbours(&self) -> bool {
        self.tt_k.is_finite() && self.oil_k.is_finite()
    }
}

/// One step with the data that the fit needs.
#[derive(Debug, Clone)]
pub(crate) struct StepRows {
    /// Position in the recording.
    pub(crate) position: usize,
    /// Rows from the jump to the window, which only carry the temperatures of the housing's other parts.
    pub(crate) lead: Vec<Row>,
    pub(crate) rows: Vec<Row>,
    /// Means over the step's end: one additional row that is not fitted.
    pub(crate) end: Row,
    /// How the inputs were smoothed; `None` if no noise is declared.
    pub(crate) smoothing: Option<Smoothing>,
    /// Covariance of the rows' means for noise with the declared correlation and standard deviation 1.
    pub(crate) noise: DMatrix<f64>,
}

/// Condenses the samples of a window; `before` are those from the jump on.
pub(crate) fn condensed(
    recording: &Recording,
    position: usize,
    (before, samples): (&Samples, &Samples),
    end_state: &EndState,
    config: &IdentifyConfig,
) -> Option<StepRows> {
    let (step, steps) = (recording.steps.get(position)?, recording.steps.len());
    let first_s = samples.rows.first()?.t_s;
    let length_s = samples.rows.last()?.t_s - first_s;
    let rows_of = |samples: &Samples, block_s: &dyn Fn(f64) -> f64| {
        let mut rows = Vec::new();
        let mut blocks: Vec<std::ops::Range<usize>> = Vec::new();
        let mut start = 0;
        while start < samples.len() {
            let start_s = samples.rows[start].t_s;
            let until_s = start_s + block_s(start_s - first_s) - TIME_ROUNDING_S;
            let end = samples.rows.partition_point(|row| row.t_s < until_s).max(start + 1);
            rows.push(row(recording, &samples.rows[start..end], end_state, config));
            blocks.push(start..end);
            start = end;
        }
        (rows, blocks)
    };
    let (mut lead, _) = rows_of(before, &|_| BLOCK_S);
    let (mut rows, blocks) = rows_of(samples, &|elapsed_s| block_s_after(elapsed_s, length_s, steps, config));
    let t_s: Vec<f64> = samples.rows.iter().map(|row| row.t_s).collect();
    let times: Vec<&[f64]> = blocks.into_iter().map(|block| &t_s[block]).collect();
    let smoothing = (!config.declared.is_empty()).then(|| smooth(&mut rows));
    slopes(&mut lead);
    if smoothing.is_none() {
        slopes(&mut rows);
    }
    let last = *rows.last()?;
    let end_window = Window { start_s: step.end_s - config.thresholds.end_mean_s, end_s: step.end_s };
    let at_end = Samples::of(recording, end_window, config, true);
    let end = Row {
        t_s: step.end_s,
        t1_k: end_state.t1_k,
        t2_k: at_end.mean(|row| row.t2_k).unwrap_or(last.t2_k),
        tc_k: at_end.mean(|row| row.tc_k).unwrap_or(last.tc_k),
        p1_pa: end_state.p1_pa,
        p2_pa: end_state.p1_pa * end_state.pressure_ratio,
        flow_kg_s: end_state.flow_kg_s,
        place: place(config, end_state.speed_rpm, end_state.flow_kg_s, end_state.t1_k, end_state.p1_pa),
        ..last
    };
    let usable = end.place.0 > 0.0 && end.place.1 > 0.0 && rows.iter().all(|row| row.place.0.is_finite());
    let noise = covariance_of_means(&times, config.noise());
    usable.then_some(StepRows { position, lead, rows, end, smoothing, noise })
}

/// Means over a block of samples.
fn row(
    recording: &Recording,
    samples: &[samples::Row],
    end_state: &EndState,
    config: &IdentifyConfig,
) -> Row {
    let of = |of: fn(&samples::Row) -> f64| mean(samples.iter().map(of)).unwrap_or(f64::NAN);
    let (first_s, last_s) = samples.first().zip(samples.last()).map_or((0.0, 0.0), |(a, b)| (a.t_s, b.t_s));
    let t_s = of(|row| row.t_s);
    let speed_rpm = recording.series.get(&Channel::ShaftSpeed).and_then(|speed| {
        let (_, speeds) = speed.slice(first_s, last_s);
        mean(speeds.iter().copied().filter(|value| *value > 0.0 && value.is_finite()))
            .or_else(|| speed.interpolate(t_s))
    });
    let other = |channel: Channel| {
        let series: Option<&Series> = recording.series.get(&channel);
        let value = series.and_then(|series| {
            let (_, values) = series.slice(first_s, last_s);
            mean(values.iter().copied().filter(|value| is_reading(channel, *value)))
                .or_else(|| series.interpolate(t_s).filter(|value| is_reading(channel, *value)))
        });
        value.unwrap_or(f64::NAN)
    };
    let (t1_k, p1_pa, flow_kg_s) = (of(|row| row.t1_k), of(|row| row.p1_pa), of(|row| row.flow_kg_s));
    let tc_k = of(|row| row.tc_k);
    let speed_rpm = speed_rpm.unwrap_or(end_state.speed_rpm);
    Row {
        t_s,
        t1_k,
        t2_k: of(|row| row.t2_k),
        tc_k,
        tc_read_k: tc_k,
        tc_slope_k_s: 0.0,
        p1_pa,
        p2_pa: of(|row| row.p2_pa),
        flow_kg_s,
        tt_k: other(Channel::Tt),
        oil_k: other(Channel::TOil),
        ambient_k: other(Channel::TAmb),
        speed_rpm,
        place: place(config, speed_rpm, flow_kg_s, t1_k, p1_pa),
    }
}

/// Length of a block that starts at this time after the first sample of a window, s, in a recording of so many steps.
pub(crate) fn block_s_after(elapsed_s: f64, length_s: f64, steps: usize, config: &IdentifyConfig) -> f64 {
    if elapsed_s < FOLLOWED_S {
        return BLOCK_S;
    }
    let shortest_s = if config.declared.is_empty() { BLOCK_S } else { COARSER * BLOCK_S };
    let rows = MAX_ROWS / steps.max(1) as f64 - FOLLOWED_S / BLOCK_S;
    shortest_s.max((length_s - FOLLOWED_S) / rows.clamp(MIN_LATE_BLOCKS, MAX_LATE_BLOCKS))
}

/// Smooths T1, Tc, P1, P2, flow, the temperatures around the housing and the map position.
fn smooth(rows: &mut [Row]) -> Smoothing {
    let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let smoothing = Smoothing::new(&t_s);
    let straight = Basis::new(&t_s, 1, &[]);
    let mut column = |basis: &Basis, read: fn(&Row) -> f64, write: fn(&mut Row, f64)| {
        let raw: Vec<f64> = rows.iter().map(read).collect();
        let (values, slopes) = basis.apply(&raw);
        for (row, value) in rows.iter_mut().zip(values) {
            write(row, value);
        }
        slopes
    };
    let of = |channel: usize| &smoothing.channels[channel];
    column(of(T1), |row| row.t1_k, |row, value| row.t1_k = value);
    column(of(P1), |row| row.p1_pa, |row, value| row.p1_pa = value);
    column(of(P2), |row| row.p2_pa, |row, value| row.p2_pa = value);
    column(of(FLOW), |row| row.flow_kg_s, |row, value| row.flow_kg_s = value);
    column(of(P2), |row| row.place.0, |row, value| row.place.0 = value);
    column(of(FLOW), |row| row.place.1, |row, value| row.place.1 = value);
    column(&straight, |row| row.tt_k, |row, value| row.tt_k = value);
    column(&straight, |row| row.oil_k, |row, value| row.oil_k = value);
    column(&straight, |row| row.ambient_k, |row, value| row.ambient_k = value);
    let tc_slopes_k_s = column(of(TC), |row| row.tc_k, |row, value| row.tc_k = value);
    rows.iter_mut().zip(tc_slopes_k_s).for_each(|(row, slope)| row.tc_slope_k_s = slope);
    smoothing
}

/// Slopes of Tc by difference quotients.
pub(crate) fn slopes(rows: &mut [Row]) {
    let at: Vec<(f64, f64)> = rows.iter().map(|row| (row.t_s, row.tc_k)).collect();
    for (i, row) in rows.iter_mut().enumerate() {
        let (before, after) = (at[i.saturating_sub(1)], at[(i + 1).min(at.len() - 1)]);
        let slope = (after.1 - before.1) / (after.0 - before.0);
        row.tc_slope_k_s = if slope.is_finite() { slope } else { 0.0 };
    }
}

/// Corrected speed, rpm, and flow, kg/s.
pub(crate) fn place(
    config: &IdentifyConfig,
    speed_rpm: f64,
    flow_kg_s: f64,
    t1_k: f64,
    p1_pa: f64,
) -> (f64, f64) {
    (
        config.reference.corrected_speed_rpm(speed_rpm, t1_k),
        config.corrected_flow_kg_s(flow_kg_s, t1_k, p1_pa),
    )
}

// Smooths the inputs of the model along a window.
// The model takes T1, Tc, flow and pressures as read. Each is projected on a polynomial and, for those that settle after a jump, on
// exponentials: a polynomial alone leaves the settling of flow and pressure, which looks like a slow probe. The projection is linear, so the
// noise of what it leaves is known: `crate::joint::fit::step_noise`.

/// Number of smoothed channels.
pub(crate) const SMOOTHED_COUNT: usize = FLOW + 1;
/// Place of T1.
pub(crate) const T1: Place = 0;
/// Place of Tc.
pub(crate) const TC: Place = 1;
/// Place of P1.
pub(crate) const P1: Place = 2;
/// Place of P2.
pub(crate) const P2: Place = 3;
/// Place of the flow.
pub(crate) const FLOW: Place = 4;

/// Degree of the polynomial in a window of [`SHORT_S`]. Bound: T1 and P1 follow the cell; the others bend as the housing warms up.
const DEGREES: [usize; SMOOTHED_COUNT] = [1, 3, 1, 3, 3];
/// Time constants of the settling of each channel, s. Source: outlet volume and shaft speed settle within 1.5 to 5 s of a jump on stands with a
/// fast supply; the slope of Tc follows the slower heat of the gas path.
const SETTLING_S: [&[f64]; SMOOTHED_COUNT] = [&[], &[3.0, 8.0], &[], &[1.5, 5.0], &[1.5, 5.0]];
/// Window for which these degrees suffice, s. Bound: a cubic over it follows the exponential of a housing to a hundredth of its change.
const SHORT_S: f64 = 30.0;
/// Additional time per degree of a channel that bends, s. Bound: a tenth of a minute of ripple of T3 needs it.
const BENDING_S: f64 = 10.0;
/// The same for a channel that follows the cell, s. Bound: air conditioning has periods of minutes.
const STEADY_S: f64 = 30.0;
/// Minimum number of rows for each function. Bound: leaves the noise of three rows out of four.
const ROWS_PER_FUNCTION: usize = 4;
/// Minimum diagonal of the triangular factor. Bound: functions that are nearly others' sums would have arbitrary slopes.
const MIN_PIVOT: f64 = 1e-6;

/// Orthonormal functions over the rows of a window, and their slopes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Basis {
    pub(crate) values: DMatrix<f64>,
    /// 1/s.
    pub(crate) slopes: DMatrix<f64>,
}

/// The functions of each channel; some channels have the same.
#[derive(Debug, Clone, Default)]
pub(crate) struct Smoothing {
    pub(crate) channels: [Arc<Basis>; SMOOTHED_COUNT],
}

impl Smoothing {
    /// The functions for rows at these times.
    pub(crate) fn new(t_s: &[f64]) -> Self {
        let mut smoothing = Smoothing::default();
        for channel in 0..SMOOTHED_COUNT {
            let form = |channel: usize| (DEGREES[channel], SETTLING_S[channel]);
            smoothing.channels[channel] = match (0..channel).find(|known| form(*known) == form(channel)) {
                Some(known) => smoothing.channels[known].clone(),
                None => Arc::new(Basis::new(t_s, DEGREES[channel], SETTLING_S[channel])),
            };
        }
        smoothing
    }
}

impl Basis {
    /// A polynomial of this degree and more in long windows, with exponentials.
    pub(crate) fn new(t_s: &[f64], degree: usize, settling_s: &[f64]) -> Self {
        let count = t_s.len();
        let (Some(first_s), Some(last_s)) = (t_s.first(), t_s.last()) else { return Basis::default() };
        let half_s = (0.5 * (last_s - first_s)).max(f64::MIN_POSITIVE);
        let per_degree_s = if degree > 1 { BENDING_S } else { STEADY_S };
        let more = ((2.0 * half_s - SHORT_S) / per_degree_s).max(0.0) as usize;
        let most = count / ROWS_PER_FUNCTION;
        let settling_s = if most > degree + 1 + settling_s.len() { settling_s } else { &[] };
        let degree = (degree + more).min(most.saturating_sub(1 + settling_s.len()));
        let mut values: Vec<DVector<f64>> = Vec::new();
        let mut slopes: Vec<DVector<f64>> = Vec::new();
        for power in 0..=degree {
            let at = |t_s: &f64| legendre(power, (t_s - first_s) / half_s - 1.0);
            values.push(DVector::from_iterator(count, t_s.iter().map(|t| at(t).0)));
            slopes.push(DVector::from_iterator(count, t_s.iter().map(|t| at(t).1 / half_s)));
        }
        for settling_s in settling_s {
            let at = |t_s: &f64| (-(t_s - first_s) / settling_s).exp();
            values.push(DVector::from_iterator(count, t_s.iter().map(at)));
            slopes.push(DVector::from_iterator(count, t_s.iter().map(|t| -at(t) / settling_s)));
        }
        Basis::orthonormal(values, slopes)
    }

    /// Gram-Schmidt, twice for orthogonality to rounding; a function without a part of its own is left out.
    fn orthonormal(values: Vec<DVector<f64>>, slopes: Vec<DVector<f64>>) -> Self {
        let mut kept: Vec<(DVector<f64>, DVector<f64>)> = Vec::new();
        for (mut value, mut slope) in values.into_iter().zip(slopes) {
            let before = value.norm();
            for _ in 0..2 {
                for (other, other_slope) in &kept {
                    let along = other.dot(&value);
                    value -= along * other;
                    slope -= along * other_slope;
                }
            }
            let own = value.norm();
            if own > MIN_PIVOT * before {
                kept.push((value / own, slope / own));
            }
        }
        let (values, slopes): (Vec<_>, Vec<_>) = kept.into_iter().unzip();
        if values.is_empty() {
            return Basis::default();
        }
        Basis { values: DMatrix::from_columns(&values), slopes: DMatrix::from_columns(&slopes) }
    }

    /// The smoothed column and its slope.
    pub(crate) fn apply(&self, column: &[f64]) -> (Vec<f64>, Vec<f64>) {
        if self.values.nrows() != column.len() {
            return (column.to_vec(), vec![0.0; column.len()]);
        }
        let along = self.values.tr_mul(&DVector::from_column_slice(column));
        let of = |functions: &DMatrix<f64>| (functions * &along).iter().copied().collect();
        (of(&self.values), of(&self.slopes))
    }
}

/// Legendre polynomial and its derivative.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut now) = ((0.0, 0.0), (1.0, 0.0));
    for k in 0..degree {
        let k = k as f64;
        let value = ((2.0 * k + 1.0) * x * now.0 - k * before.0) / (k + 1.0);
        let slope = ((2.0 * k + 1.0) * (now.0 + x * now.1) - k * before.1) / (k + 1.0);
        (before, now) = (now, (value, slope));
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a jump leaves: P2 and flow settle with 1.5 and 5 s about a slow bend. A cubic alone leaves a tenth of the settling.
    #[test]
    fn settling_about_a_bend_is_kept_and_its_slope_is_right() {
        let t_s: Vec<f64> = (0..68).map(|i| 6.0 + 0.5 * f64::from(i)).collect();
        let at = |t: f64| 0.05 + 1e-4 * t - 1e-6 * t * t + 3e-3 * (-t / 5.0).exp() - 2e-2 * (-t / 1.5).exp();
        let slope = |t: f64| 1e-4 - 2e-6 * t - 6e-4 * (-t / 5.0).exp() + 2e-2 / 1.5 * (-t / 1.5).exp();
        let column: Vec<f64> = t_s.iter().map(|t| at(*t)).collect();
        let (values, slopes) = Smoothing::new(&t_s).channels[FLOW].apply(&column);
        for ((t, value), found) in t_s.iter().zip(values).zip(slopes) {
            assert!((value - at(*t)).abs() < 1e-9, "{t} s: {value}");
            assert!((found - slope(*t)).abs() < 1e-7, "{t} s: {found}");
        }
    }

    /// A projection: smoothing twice is smoothing once, and white noise keeps as many parts as there are functions.
    #[test]
    fn it_is_a_projection() {
        let t_s: Vec<f64> = (0..40).map(f64::from).collect();
        for basis in Smoothing::new(&t_s).channels {
            let gram = basis.values.tr_mul(&basis.values);
            let off = gram - DMatrix::identity(basis.values.ncols(), basis.values.ncols());
            assert!(off.abs().max() < 1e-12);
        }
    }
}
