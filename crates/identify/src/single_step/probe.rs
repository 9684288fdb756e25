//! The reading of a probe that lags the gas, along the rows of a step (eqs. 11-12).
//!
//! At the start of a window the probe's reading depends on the seconds before it. That first reading enters linearly and fades with the
//! probe's time constant. For a fit of one step it is a nuisance parameter, so it is projected out of residual and derivatives (variable
//! projection: Golub and Pereyra, SIAM J. Numer. Anal. 10:413, 1973). The remaining fit has as many parameters as without a probe.

use crate::step_data::samples::Samples;
use mapper_physics::laws::thermocouple;

/// Argument below which the series of (1 - e^-x)/x replaces the formula. Bound: the next term is below rounding.
const SERIES_BELOW: f64 = 1e-6;

/// One time step of the probe: the weights of its last reading and of the gas before and now. Exact for a gas temperature that is linear in
/// between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lag {
    kept: f64,
    before: f64,
    now: f64,
}

impl Lag {
    fn of(interval_s: f64, time_constant_s: f64) -> Self {
        if time_constant_s <= 0.0 {
            return Lag { kept: 0.0, before: 0.0, now: 1.0 };
        }
        let x = interval_s / time_constant_s;
        let kept = (-x).exp();
        // (1 - e^-x)/x, without loss of digits for small x.
        let mean = if x < SERIES_BELOW { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x };
        Lag { kept, before: mean - kept, now: 1.0 - mean }
    }

    #[inline]
    pub(crate) fn next(&self, reading: f64, gas_before: f64, gas_now: f64) -> f64 {
        self.kept * reading + self.before * gas_before + self.now * gas_now
    }
}

/// The lags between rows; one fewer than rows. Each row has time, s, flow, kg/s, and gas temperature, K. Between two rows the probe has the
/// mean of their time constants.
pub(crate) fn lags(
    rows: impl Iterator<Item = (f64, f64, f64)>,
    probe_diameter_m: f64,
    pipe_diameter_m: f64,
) -> Vec<Lag> {
    let mut before: Option<(f64, f64)> = None;
    let mut lags = Vec::with_capacity(rows.size_hint().0);
    for (t_s, flow_kg_s, gas_k) in rows {
        let tau_s = thermocouple::time_constant_s(probe_diameter_m, pipe_diameter_m, flow_kg_s, gas_k);
        if let Some((before_s, before_tau_s)) = before {
            lags.push(Lag::of(t_s - before_s, 0.5 * (before_tau_s + tau_s)));
        }
        before = Some((t_s, tau_s));
    }
    lags
}

/// The probe's reading along a gas temperature history, from its reading at the first row on.
pub(crate) fn follow(lags: &[Lag], first: f64, history: &[f64]) -> Vec<f64> {
    let mut reading = first;
    let mut readings = Vec::with_capacity(history.len());
    readings.push(reading);
    for (lag, pair) in lags.iter().zip(history.windows(2)) {
        reading = lag.next(reading, pair[0], pair[1]);
        readings.push(reading);
    }
    readings
}

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

#[cfg(test)]
mod tests {
    use super::*;

    /// The lag behind a ramp is rate times time constant; the response to a jump is exponential.
    #[test]
    fn ramps_and_jumps_have_their_known_answers() {
        let (interval_s, tau_s) = (0.5, 3.0);
        let lag = Lag::of(interval_s, tau_s);
        let (mut ramp, mut jump) = (-2.0 * tau_s, 1.0);
        for i in 0..20 {
            let (t0_s, t1_s) = (f64::from(i) * interval_s, f64::from(i + 1) * interval_s);
            ramp = lag.next(ramp, 2.0 * t0_s, 2.0 * t1_s);
            jump = lag.next(jump, 0.0, 0.0);
            assert!((ramp - 2.0 * (t1_s - tau_s)).abs() < 1e-12);
            assert!((jump - (-t1_s / tau_s).exp()).abs() < 1e-12);
        }
        assert_eq!(Lag::of(0.5, 0.0).next(7.0, 8.0, 9.0), 9.0);
    }
}
