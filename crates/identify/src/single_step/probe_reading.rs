//! T2 as a declared probe reads it (eqs. 11-12), for a fit of one step.
//!
//! At the start of a window the probe's reading depends on the seconds before it. That first reading enters linearly and fades with the
//! probe's time constant. It is a nuisance parameter, so it is projected out of residual and derivatives (variable projection: Golub and
//! Pereyra, SIAM J. Numer. Anal. 10:413, 1973). The remaining fit has as many parameters as without a probe.

use crate::single_step::probe::{Lag, follow, lags};
use crate::step_data::samples::Samples;

/// The declared probe and its pipe.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    /// Diameter of its tip, m; 0 for a probe without inertia.
    pub(crate) diameter_m: f64,
    /// Diameter of the pipe, m.
    pub(crate) pipe_diameter_m: f64,
}

/// The probe response over the rows of a window.
#[derive(Debug, Clone)]
pub(crate) struct ProbeResponse {
    lags: Vec<Lag>,
    /// Remaining share of the first reading at each row.
    memory: Vec<f64>,
    /// Sum of its squares.
    memory_square: f64,
}

impl ProbeResponse {
    /// `None` for a probe without inertia, which reads the gas temperature.
    pub(crate) fn of(samples: &Samples, probe: Probe) -> Option<Self> {
        if probe.diameter_m <= 0.0 || samples.len() < 2 {
            return None;
        }
        let rows = samples.rows.iter().map(|row| (row.t_s, row.flow_kg_s, row.t2_k));
        let lags = lags(rows, probe.diameter_m, probe.pipe_diameter_m);
        let memory = follow(&lags, 1.0, &vec![0.0; samples.len()]);
        let memory_square = memory.iter().map(|share| share * share).sum();
        Some(ProbeResponse { lags, memory, memory_square })
    }

    /// Response of the probe to a time history of the gas, without the contribution of its first reading.
    pub(crate) fn read(&self, gas: &[f64]) -> Vec<f64> {
        follow(&self.lags, 0.0, gas)
    }

    /// Removes from a column of readings the part that a first reading would explain.
    pub(crate) fn without_first_reading(&self, column: &mut [f64]) {
        let along: f64 = column.iter().zip(&self.memory).map(|(value, share)| value * share).sum();
        for (value, share) in column.iter_mut().zip(&self.memory) {
            *value -= along / self.memory_square * share;
        }
    }
}
