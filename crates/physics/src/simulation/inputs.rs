//! Boundary conditions over time: constant between kinks, interpolated, or the response of a rig's actuators.

use crate::machine::params::BoundaryConditions;

/// Boundary conditions as a function of time, smooth between its kinks.
pub trait Inputs {
    /// Boundary conditions at `t_s`.
    fn at(&self, t_s: f64) -> BoundaryConditions;

    /// Time passed to hooks at `t_s`, s; NaN without a time, as in a steady state.
    fn time_s(&self, t_s: f64) -> f64 {
        t_s
    }

    /// The next time after `t_s` at which a value or a slope jumps; infinity if there is none.
    fn next_kink_s(&self, t_s: f64) -> f64;

    /// Whether all inputs are constant from `t_s` to the next kink: the model is then prepared once.
    fn is_constant_after(&self, t_s: f64) -> bool;
}

impl Inputs for BoundaryConditions {
    fn at(&self, _t_s: f64) -> BoundaryConditions {
        *self
    }

    fn time_s(&self, _t_s: f64) -> f64 {
        f64::NAN
    }

    fn next_kink_s(&self, _t_s: f64) -> f64 {
        f64::INFINITY
    }

    fn is_constant_after(&self, _t_s: f64) -> bool {
        true
    }
}

/// Recorded boundary conditions, linear between their times and constant beyond both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct InterpolatedInputs {
    t_s: Vec<f64>,
    rows: Vec<BoundaryConditions>,
}

/// Reason why a table cannot be interpolated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum InputsError {
    #[error(
        "{times} times and {rows} rows of boundary conditions; their numbers must be equal, and at least one"
    )]
    Lengths { times: usize, rows: usize },
    #[error("the times of boundary conditions must rise; {after_s} s comes after {before_s} s")]
    Order { before_s: f64, after_s: f64 },
}

impl InterpolatedInputs {
    /// Takes strictly rising times, s, and as many rows.
    ///
    /// # Errors
    /// [`InputsError`] if the table is empty, uneven or out of order.
    pub fn new(t_s: Vec<f64>, rows: Vec<BoundaryConditions>) -> Result<Self, InputsError> {
        if t_s.is_empty() || t_s.len() != rows.len() {
            return Err(InputsError::Lengths { times: t_s.len(), rows: rows.len() });
        }
        if let Some(pair) = t_s.windows(2).find(|pair| !matches!(pair, [a, b] if a < b)) {
            return Err(InputsError::Order { before_s: pair[0], after_s: pair[1] });
        }
        Ok(InterpolatedInputs { t_s, rows })
    }
}

impl Inputs for InterpolatedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        if after == 0 {
            return self.rows[0];
        }
        if after == self.t_s.len() {
            return self.rows[after - 1];
        }
        let (a, b) = (&self.rows[after - 1], &self.rows[after]);
        let share = (t_s - self.t_s[after - 1]) / (self.t_s[after] - self.t_s[after - 1]);
        let interpolate = |x: f64, y: f64| x + (y - x) * share;
        BoundaryConditions {
            t1_k: interpolate(a.t1_k, b.t1_k),
            p1_pa: interpolate(a.p1_pa, b.p1_pa),
            p3_pa: interpolate(a.p3_pa, b.p3_pa),
            t3_k: interpolate(a.t3_k, b.t3_k),
            p4_pa: interpolate(a.p4_pa, b.p4_pa),
            oil_temperature_k: interpolate(a.oil_temperature_k, b.oil_temperature_k),
            ambient_temperature_k: interpolate(a.ambient_temperature_k, b.ambient_temperature_k),
            valve_opening_ratio: interpolate(a.valve_opening_ratio, b.valve_opening_ratio),
        }
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.t_s.get(self.t_s.partition_point(|t| *t <= t_s)).copied().unwrap_or(f64::INFINITY)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        after == 0 || after == self.t_s.len() || self.rows[after - 1] == self.rows[after]
    }
}
