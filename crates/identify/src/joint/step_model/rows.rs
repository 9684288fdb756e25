//! One step condensed to block means, with the map position of each block.

use crate::IdentifyConfig;
use crate::joint::step_model::smoothing::Smoother;
use crate::step_data::commands::FOLLOWED_S;
use crate::step_data::end_state::EndState;
use crate::step_data::samples::{self, Samples};
use mapper_core::{Channel, Recording, Window};
use mapper_numerics::coloured_noise::BlockNoise;
use mapper_numerics::statistics::mean;

/// Rounding error of the time of a sample, s. Source: recordings store nanoseconds; half of one.
pub(crate) const TIME_ROUNDING_S: f64 = 5e-10;

/// Length of the blocks over which samples are averaged before the fit, s. Bound: a quarter of the correlation time of sensor noise, and
/// far below any time scale in a window.
pub const BLOCK_S: f64 = 0.5;
/// Factor on this length for noisy data from [`FOLLOWED_S`] after the first sample on, and in a forecast. Bound: it costs a few percent
/// of the information. Without noise it would cost a thousandth of alpha_A behind a slow probe.
pub(crate) const COARSER: f64 = 2.0;

/// Means over one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    pub(crate) t_s: f64,
    pub(crate) t1_k: f64,
    pub(crate) t2_k: f64,
    pub(crate) tc_k: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) flow_kg_s: f64,
    /// Corrected speed and flow.
    pub(crate) place: (f64, f64),
    pub(crate) noise: BlockNoise,
}

/// One step with the data that the fit needs.
#[derive(Debug, Clone)]
pub(crate) struct StepRows {
    /// Position in the recording.
    pub(crate) position: usize,
    pub(crate) rows: Vec<Row>,
    /// Means over the step's end: one additional row that is not fitted.
    pub(crate) end: Row,
}

/// Condenses the samples of a window.
pub(crate) fn condensed(
    recording: &Recording,
    position: usize,
    samples: &Samples,
    end_state: &EndState,
    config: &IdentifyConfig,
) -> Option<StepRows> {
    let step = recording.steps.get(position)?;
    let speed = recording.series.get(&Channel::ShaftSpeed)?;
    let mut rows = Vec::new();
    let mut start = 0;
    while start < samples.len() {
        let start_s = samples.rows[start].t_s;
        let block_s = block_s_after(start_s - samples.rows[0].t_s, config);
        let end =
            samples.rows.partition_point(|row| row.t_s < start_s + block_s - TIME_ROUNDING_S).max(start + 1);
        let of =
            |of: fn(&samples::Row) -> f64| mean(samples.rows[start..end].iter().map(of)).unwrap_or(f64::NAN);
        let t_s = of(|row| row.t_s);
        let (first_s, last_s) = (start_s, samples.rows[end - 1].t_s);
        let (_, speeds) = speed.slice(first_s, last_s);
        let speeds: Vec<f64> =
            speeds.iter().copied().filter(|value| *value > 0.0 && value.is_finite()).collect();
        let speed_rpm = mean(&speeds).or_else(|| speed.interpolate(t_s)).unwrap_or(end_state.speed_rpm);
        let (t1_k, p1_pa, flow_kg_s) = (of(|row| row.t1_k), of(|row| row.p1_pa), of(|row| row.flow_kg_s));
        let count = (end - start) as f64;
        let block_s = if end > start + 1 { (last_s - first_s) * count / (count - 1.0) } else { 0.0 };
        rows.push(Row {
            t_s,
            t1_k,
            t2_k: of(|row| row.t2_k),
            tc_k: of(|row| row.tc_k),
            p1_pa,
            p2_pa: of(|row| row.p2_pa),
            flow_kg_s,
            place: place(config, speed_rpm, flow_kg_s, t1_k, p1_pa),
            noise: BlockNoise::of_mean(config.noise(), count, block_s),
        });
        start = end;
    }
    if !config.declared.is_empty() {
        smooth(&mut rows);
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
        noise: last.noise,
    };
    let usable = end.place.0 > 0.0 && end.place.1 > 0.0 && rows.iter().all(|row| row.place.0.is_finite());
    usable.then_some(StepRows { position, rows, end })
}

/// Length of a block that starts at this time after the first sample, s.
pub(crate) fn block_s_after(elapsed_s: f64, config: &IdentifyConfig) -> f64 {
    let late = !config.declared.is_empty() && elapsed_s >= FOLLOWED_S;
    if late { COARSER * BLOCK_S } else { BLOCK_S }
}

/// Smooths T1, Tc, P1, P2, flow and the map position.
fn smooth(rows: &mut [Row]) {
    let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let smoother = Smoother::new(&t_s);
    let mut column = |read: fn(&Row) -> f64, write: fn(&mut Row, f64)| {
        let raw: Vec<f64> = rows.iter().map(read).collect();
        for (row, value) in rows.iter_mut().zip(smoother.apply(&raw)) {
            write(row, value);
        }
    };
    column(|row| row.t1_k, |row, value| row.t1_k = value);
    column(|row| row.tc_k, |row, value| row.tc_k = value);
    column(|row| row.p1_pa, |row, value| row.p1_pa = value);
    column(|row| row.p2_pa, |row, value| row.p2_pa = value);
    column(|row| row.flow_kg_s, |row, value| row.flow_kg_s = value);
    column(|row| row.place.0, |row, value| row.place.0 = value);
    column(|row| row.place.1, |row, value| row.place.1 = value);
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
