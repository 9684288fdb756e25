//! Boundary conditions as recorded, for the model to be driven by: averaged where they are quiet, as they are after jumps.
//!
//! Unlike [`smoothed_inputs`](crate::smoothed_inputs) these keep the noise of means, which is independent from one
//! stretch to the next, and follow an input sensor that steps: what the search for drift needs.

use crate::channels::{DRIVERS, boundary_condition};
use crate::mean::BEFORE_S;
use mapper_core::{Channel, Recording};
use mapper_physics::inputs::{Inputs, InputsError, InterpolatedInputs};
use mapper_physics::params::BoundaryConditions;

/// After a jump readings are taken as they are for this long, s: actuators need some tenths.
const RAW_S: f64 = 3.0;
/// Between jumps means over this long are taken, s.
const MEAN_S: f64 = 10.0;

/// Boundary conditions from jump to jump: never interpolated across one, however close to it.
#[derive(Debug, Clone, PartialEq)]
pub struct AveragedInputs {
    starts_s: Vec<f64>,
    levels: Vec<InterpolatedInputs>,
}

impl Inputs for AveragedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let level = self.level(t_s);
        self.levels[level].at(t_s)
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        let level = self.level(t_s);
        let next_s = self.starts_s.get(level + 1).copied().unwrap_or(f64::INFINITY);
        self.levels[level].next_kink_s(t_s).min(next_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        let level = self.level(t_s);
        self.levels[level].is_constant_after(t_s)
    }
}

impl AveragedInputs {
    /// The inputs of a recording until `end_s`. `jumps` are the times at which commands change, rising, s, with the valve
    /// from then on: the recorded command itself may show a change one sample late. `nominal` stands for what is not
    /// recorded.
    ///
    /// # Errors
    /// [`InputsError`] where jumps do not rise.
    pub fn read(
        recording: &Recording,
        nominal: &BoundaryConditions,
        jumps: &[(f64, f64)],
        end_s: f64,
    ) -> Result<AveragedInputs, InputsError> {
        let mut inputs = AveragedInputs { starts_s: Vec::new(), levels: Vec::new() };
        for (index, (start_s, valve_opening_ratio)) in jumps.iter().enumerate() {
            let next_s = jumps.get(index + 1).map_or(end_s, |next| next.0);
            let mut nodes = Nodes { recording, nominal, t_s: Vec::new(), rows: Vec::new() };
            nodes.level(*start_s, next_s, *valve_opening_ratio, index > 0);
            inputs.starts_s.push(*start_s);
            inputs.levels.push(InterpolatedInputs::new(nodes.t_s, nodes.rows)?);
        }
        Ok(inputs)
    }

    fn level(&self, t_s: f64) -> usize {
        self.starts_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1)
    }
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
                for channel in [Channel::P3, Channel::P4] {
                    let read = self.recording.series.get(&channel).and_then(|series| series.interpolate(t_s));
                    if let (Some(read), Some(value)) = (read, boundary_condition(&mut row, channel)) {
                        *value = read;
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

    fn means(&self, start_s: f64, end_s: f64, valve_opening_ratio: f64) -> BoundaryConditions {
        let mut row = BoundaryConditions { valve_opening_ratio, ..*self.nominal };
        if let Some(p3_pa) = self.recording.series.get(&Channel::P3Command).and_then(|c| c.held(start_s)) {
            row.p3_pa = p3_pa;
        }
        for channel in DRIVERS.into_iter().chain([Channel::TAmb]) {
            let (Some(series), Some(value)) =
                (self.recording.series.get(&channel), boundary_condition(&mut row, channel))
            else {
                continue;
            };
            let values = series.slice(start_s, end_s).1;
            *value = if values.is_empty() {
                series.interpolate(0.5 * (start_s + end_s)).unwrap_or(*value)
            } else {
                values.iter().sum::<f64>() / values.len() as f64
            };
        }
        row
    }
}
