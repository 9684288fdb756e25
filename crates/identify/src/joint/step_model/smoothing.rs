//! Smooths the inputs of the model along a window.
//!
//! The model takes T1, Tc, flow and pressures as read. Each is projected on a polynomial and, for those that settle after a jump, on
//! exponentials: a polynomial alone leaves the settling of flow and pressure, which looks like a slow probe. The projection is linear, so the
//! noise of what it leaves is known: [`crate::joint::fit::step_noise`].

use crate::joint::step_model::parameters::Place;
use nalgebra::{DMatrix, DVector};

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

/// The functions of each channel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Smoothing {
    pub(crate) channels: [Basis; SMOOTHED_COUNT],
}

impl Smoothing {
    /// The functions for rows at these times.
    pub(crate) fn new(t_s: &[f64]) -> Self {
        Smoothing {
            channels: std::array::from_fn(|channel| Basis::new(t_s, DEGREES[channel], SETTLING_S[channel])),
        }
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
