//! Boundary conditions as recorded, for the model to be driven by: averaged where they are quiet, as they are after jumps.

use mapper_core::{Channel, Recording};
use mapper_physics::inputs::{Inputs, InputsError, InterpolatedInputs};
use mapper_physics::params::BoundaryConditions;

/// After a jump readings are taken as they are for this long, s: actuators need some tenths.
const RAW_S: f64 = 3.0;
/// Between jumps means over this long are taken, s.
const MEAN_S: f64 = 10.0;
/// A sample at a jump belongs to what comes after it, s.
const BEFORE_S: f64 = 1e-6;

/// Boundary conditions from jump to jump: never interpolated across one, however close to it.
pub(crate) struct RecordedInputs {
    starts_s: Vec<f64>,
    levels: Vec<InterpolatedInputs>,
}

impl Inputs for RecordedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let level = self.starts_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1);
        self.levels[level].at(t_s)
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        let level = self.starts_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1);
        let next_s = self.starts_s.get(level + 1).copied().unwrap_or(f64::INFINITY);
        self.levels[level].next_kink_s(t_s).min(next_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        let level = self.starts_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1);
        self.levels[level].is_constant_after(t_s)
    }
}

/// The inputs of a recording. `jumps` are the times at which commands change, rising, s, with the valve from then on: the
/// recorded command itself may show a change one sample late.
pub(crate) fn recorded(
    recording: &Recording,
    nominal: &BoundaryConditions,
    jumps: &[(f64, f64)],
    end_s: f64,
) -> Result<RecordedInputs, InputsError> {
    let mut inputs = RecordedInputs { starts_s: Vec::new(), levels: Vec::new() };
    for (index, (start_s, valve_opening_ratio)) in jumps.iter().enumerate() {
        let next_s = jumps.get(index + 1).map_or(end_s, |next| next.0);
        let mut nodes = Nodes { recording, nominal, t_s: Vec::new(), rows: Vec::new() };
        nodes.level(*start_s, next_s, *valve_opening_ratio, index > 0);
        inputs.starts_s.push(*start_s);
        inputs.levels.push(InterpolatedInputs::new(nodes.t_s, nodes.rows)?);
    }
    Ok(inputs)
}

struct Nodes<'a> {
    recording: &'a Recording,
    nominal: &'a BoundaryConditions,
    t_s: Vec<f64>,
    rows: Vec<BoundaryConditions>,
}

impl Nodes<'_> {
    /// Nodes from one jump to the next.
    fn level(&mut self, start_s: f64, end_s: f64, valve: f64, after_jump: bool) {
        let raw_end_s = if after_jump { (start_s + RAW_S).min(end_s) } else { start_s };
        if after_jump {
            let t_s = self
                .recording
                .series
                .get(&Channel::P3)
                .map(|series| series.slice(start_s, raw_end_s - BEFORE_S).0.to_vec())
                .unwrap_or_default();
            // The first node lies at the jump itself, so that the valve changes there.
            let mut times = vec![start_s];
            times.extend(t_s.into_iter().filter(|t| *t > start_s));
            for t_s in times {
                // Quantities that do not jump keep the mean of the whole stretch.
                let mut row = self.means(start_s, raw_end_s, valve);
                for (channel, value) in [(Channel::P3, &mut row.p3_pa), (Channel::P4, &mut row.p4_pa)] {
                    if let Some(series) = self.recording.series.get(&channel) {
                        *value = series.interpolate(t_s).unwrap_or(*value);
                    }
                }
                self.push(t_s, row);
            }
        }
        let length_s = end_s - raw_end_s;
        let parts = (length_s / MEAN_S).round().max(1.0) as usize;
        if length_s > 0.0 {
            for part in 0..parts {
                let at = |share: f64| raw_end_s + length_s * share / parts as f64;
                let (low_s, high_s) = (at(part as f64), at(part as f64 + 1.0));
                let row = self.means(low_s, high_s - BEFORE_S, valve);
                self.push(0.5 * (low_s + high_s), row);
            }
        }
    }

    fn push(&mut self, t_s: f64, row: BoundaryConditions) {
        if self.t_s.last().is_none_or(|last| *last < t_s) {
            self.t_s.push(t_s);
            self.rows.push(row);
        }
    }

    fn command(&self, channel: Channel, t_s: f64) -> Option<f64> {
        self.recording.series.get(&channel)?.held(t_s)
    }

    fn means(&self, start_s: f64, end_s: f64, valve_opening_ratio: f64) -> BoundaryConditions {
        let mean = |channel: Channel, nominal: f64| {
            let Some(series) = self.recording.series.get(&channel) else { return nominal };
            let values = series.slice(start_s, end_s).1;
            if values.is_empty() {
                return series.interpolate(0.5 * (start_s + end_s)).unwrap_or(nominal);
            }
            values.iter().sum::<f64>() / values.len() as f64
        };
        let nominal = self.nominal;
        let p3_nominal = self.command(Channel::P3Command, start_s).unwrap_or(nominal.p3_pa);
        BoundaryConditions {
            t1_k: mean(Channel::T1, nominal.t1_k),
            p1_pa: mean(Channel::P1, nominal.p1_pa),
            p3_pa: mean(Channel::P3, p3_nominal),
            t3_k: mean(Channel::T3, nominal.t3_k),
            p4_pa: mean(Channel::P4, nominal.p4_pa),
            oil_temperature_k: mean(Channel::TOil, nominal.oil_temperature_k),
            ambient_temperature_k: mean(Channel::TAmb, nominal.ambient_temperature_k),
            valve_opening_ratio,
        }
    }
}
