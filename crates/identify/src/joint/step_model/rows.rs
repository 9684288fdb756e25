//! One step condensed to block means, with the map position of each block.

use crate::IdentifyConfig;
use crate::joint::step_model::smoothing::{Basis, FLOW, P1, P2, Smoothing, T1, TC};
use crate::step_data::commands::FOLLOWED_S;
use crate::step_data::end_state::EndState;
use crate::step_data::samples::{self, Samples};
use mapper_core::{Channel, Recording, Series, Window, is_reading};
use mapper_numerics::coloured_noise::covariance_of_means;
use mapper_numerics::statistics::mean;
use nalgebra::DMatrix;

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
/// Gap between two rows above which the inner wall starts settled, s. Bound: twenty time constants of a wall of a few hundred J/K behind 15
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
    /// Rows from the jump to the window, which only carry the inner wall's temperature.
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
    let step = recording.steps.get(position)?;
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
    let (mut rows, blocks) = rows_of(samples, &|elapsed_s| block_s_after(elapsed_s, length_s, config));
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
        place: place(config, speed_rpm.unwrap_or(end_state.speed_rpm), flow_kg_s, t1_k, p1_pa),
    }
}

/// Length of a block that starts at this time after the first sample of a window, s.
pub(crate) fn block_s_after(elapsed_s: f64, length_s: f64, config: &IdentifyConfig) -> f64 {
    if elapsed_s < FOLLOWED_S {
        return BLOCK_S;
    }
    let shortest_s = if config.declared.is_empty() { BLOCK_S } else { COARSER * BLOCK_S };
    shortest_s.max((length_s - FOLLOWED_S) / MAX_LATE_BLOCKS)
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
