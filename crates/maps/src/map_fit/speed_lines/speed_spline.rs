//! A natural cubic spline over a coordinate of speed, with a roughness penalty.
//!
//! Source: P. J. Green, B. W. Silverman, Nonparametric Regression and Generalized Linear Models (1994), ch. 2: values
//! at the knots as parameters, `g'' = R^-1 Q' g`, integral of `g''^2` equal to `g' K g` with `K = Q R^-1 Q'`.

use crate::map_fit::speed_lines::line_shape::{PARAMETERS, Parameters, WORK};
use nalgebra::{DMatrix, DVector};

/// Distance of a speed from a knot at which it counts as the knot, ratio. Bound: rounding.
const KNOT_TOLERANCE: f64 = 1e-6;

/// Decay length of the slope beyond the outermost knots, as a share of the nominal speed (or its inverse); at most half the range of the
/// knots. Bound: similarity holds far outside, so a trend must not continue.
const DAMPING_LENGTH_RATIO: f64 = 0.5;

/// Coordinate of a parameter as a function of speed over the nominal speed: flow and head change with the Mach number, in proportion to
/// speed; work other than Euler's (friction, heat) with the inverse. It matters beyond the measured lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coordinate {
    Speed,
    InverseSpeed,
}

impl Coordinate {
    pub(crate) fn of(self, speed_ratio: f64) -> f64 {
        match self {
            Coordinate::Speed => speed_ratio,
            // Increases with speed, like the other.
            Coordinate::InverseSpeed => -1.0 / speed_ratio,
        }
    }
}

/// A spline by its knots.
#[derive(Debug, Clone)]
pub(crate) struct SpeedSpline {
    coordinate: Coordinate,
    knots: Vec<f64>,
    /// Second derivatives at the knots from the values there.
    second: DMatrix<f64>,
    /// Integral of the squared second derivative as a quadratic form of the values.
    pub penalty: DMatrix<f64>,
}

impl SpeedSpline {
    /// `speed_ratios` of the knots strictly rising, at least one.
    pub(crate) fn new(coordinate: Coordinate, speed_ratios: &[f64]) -> Self {
        SpeedSpline::with_knots(coordinate, speed_ratios.iter().map(|v| coordinate.of(*v)).collect())
    }

    fn with_knots(coordinate: Coordinate, knots: Vec<f64>) -> Self {
        let n = knots.len();
        let (mut second, mut penalty) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        if n >= 3 {
            let h: Vec<f64> = knots.windows(2).map(|w| w[1] - w[0]).collect();
            let (mut q, mut r) = (DMatrix::zeros(n, n - 2), DMatrix::zeros(n - 2, n - 2));
            for j in 0..n - 2 {
                q[(j, j)] = 1.0 / h[j];
                q[(j + 1, j)] = -1.0 / h[j] - 1.0 / h[j + 1];
                q[(j + 2, j)] = 1.0 / h[j + 1];
                r[(j, j)] = (h[j] + h[j + 1]) / 3.0;
                if j + 1 < n - 2 {
                    r[(j, j + 1)] = h[j + 1] / 6.0;
                    r[(j + 1, j)] = h[j + 1] / 6.0;
                }
            }
            // R is diagonally dominant, so it has a Cholesky factor for any increasing knots.
            if let Some(factor) = r.cholesky() {
                let inner = factor.solve(&q.transpose());
                second.view_mut((1, 0), (n - 2, n)).copy_from(&inner);
                penalty = &q * inner;
            }
        }
        SpeedSpline { coordinate, knots, second, penalty }
    }

    pub(crate) fn len(&self) -> usize {
        self.knots.len()
    }

    /// Weights of the knot values in the value at a speed.
    pub(crate) fn row(&self, speed_ratio: f64) -> DVector<f64> {
        let at = self.coordinate.of(speed_ratio);
        let (n, x) = (self.knots.len(), &self.knots);
        let mut row = DVector::zeros(n);
        if n == 1 {
            row[0] = 1.0;
            return row;
        }
        if self.outside(speed_ratio) > 0.0 {
            let (reach, _) = self.reach(speed_ratio);
            row = self.end_slope(at) * reach;
            row[if at < x[0] { 0 } else { n - 1 }] += 1.0;
            return row;
        }
        let i = x.partition_point(|knot| *knot <= at).clamp(1, n - 1) - 1;
        let h = x[i + 1] - x[i];
        let (a, b) = ((x[i + 1] - at) / h, (at - x[i]) / h);
        row[i] = a;
        row[i + 1] = b;
        for k in 0..n {
            row[k] += h * h / 6.0
                * ((a * a * a - a) * self.second[(i, k)] + (b * b * b - b) * self.second[(i + 1, k)]);
        }
        row
    }

    /// Effective length of the decaying end slope at a speed beyond the knots, and the rest of the distance, both in the coordinate.
    fn reach(&self, speed_ratio: f64) -> (f64, f64) {
        let (outside, x) = (self.outside(speed_ratio), &self.knots);
        let damping = DAMPING_LENGTH_RATIO.min(0.5 * (x[x.len() - 1] - x[0]));
        let reach = if damping > 0.0 { damping * (1.0 - (-outside / damping).exp()) } else { 0.0 };
        (reach, outside - reach)
    }

    /// Weights of the knot values in the outward slope at the end nearest to a place outside: the secant, corrected by the curvature at the
    /// inner knot. Needs two knots.
    fn end_slope(&self, at: f64) -> DVector<f64> {
        let (n, x) = (self.knots.len(), &self.knots);
        let (end, inner) = if at < x[0] { (0, 1) } else { (n - 1, n - 2) };
        let h = (x[end] - x[inner]).abs();
        let mut row = self.second.row(inner).transpose() * (h / 6.0);
        row[end] += 1.0 / h;
        row[inner] -= 1.0 / h;
        row
    }

    /// Weights of the knot values in the difference between a constant and a decaying slope beyond the knots; zeros inside.
    pub(crate) fn straight_minus_damped(&self, speed_ratio: f64) -> DVector<f64> {
        if self.knots.len() < 2 || self.outside(speed_ratio) == 0.0 {
            return DVector::zeros(self.knots.len());
        }
        self.end_slope(self.coordinate.of(speed_ratio)) * self.reach(speed_ratio).1
    }

    /// Prior variance of the value at a speed given all knot values, for a roughness variance of 1 (an integrated random walk); 0 at a
    /// knot.
    pub(crate) fn prior_variance(&self, speed_ratio: f64) -> f64 {
        let at = self.coordinate.of(speed_ratio);
        let place = self.knots.partition_point(|knot| *knot < at);
        let near = |knot: &f64| (knot - at).abs() < KNOT_TOLERANCE * (1.0 + at.abs());
        if self.knots[place.saturating_sub(1)..].iter().take(2).any(near) {
            return 0.0;
        }
        let mut knots = self.knots.clone();
        knots.insert(place, at);
        // The precision of one value given all others is on the diagonal.
        let precision = SpeedSpline::with_knots(self.coordinate, knots).penalty[(place, place)];
        if precision > 0.0 { 1.0 / precision } else { 0.0 }
    }

    /// The end of the knots beyond which a speed lies; `None` inside.
    pub(crate) fn nearest_end(&self, speed_ratio: f64) -> Option<End> {
        let slow = self.coordinate.of(speed_ratio) < self.knots[0];
        (self.outside(speed_ratio) > 0.0).then_some(if slow { End::Slow } else { End::Fast })
    }

    /// Distance of a speed from the knots in the coordinate; 0 inside.
    pub(crate) fn outside(&self, speed_ratio: f64) -> f64 {
        let at = self.coordinate.of(speed_ratio);
        let (first, last) = (self.knots[0], self.knots[self.knots.len() - 1]);
        (first - at).max(at - last).max(0.0)
    }
}

/// Splines over speed with equal knots.
#[derive(Debug, Clone)]
pub(crate) struct Splines {
    pub shape: SpeedSpline,
    pub work: SpeedSpline,
    speed_ratios: Vec<f64>,
}

impl Splines {
    pub(crate) fn new(speed_ratios: &[f64]) -> Self {
        Splines {
            shape: SpeedSpline::new(Coordinate::Speed, speed_ratios),
            work: SpeedSpline::new(Coordinate::InverseSpeed, speed_ratios),
            speed_ratios: speed_ratios.to_vec(),
        }
    }

    pub(crate) fn of(&self, parameter: usize) -> &SpeedSpline {
        if parameter < WORK { &self.shape } else { &self.work }
    }

    pub(crate) fn rows(&self, speed_ratio: f64) -> Rows {
        Rows { shape: self.shape.row(speed_ratio), work: self.work.row(speed_ratio) }
    }

    /// Knot values, one row per parameter, of parameters given as a function of speed.
    pub(crate) fn values(&self, at: impl Fn(f64) -> Parameters) -> DMatrix<f64> {
        let mut values = DMatrix::zeros(PARAMETERS, self.len());
        for (k, speed_ratio) in self.speed_ratios.iter().enumerate() {
            values.set_column(k, &DVector::from_row_slice(&at(*speed_ratio)));
        }
        values
    }

    pub(crate) fn len(&self) -> usize {
        self.shape.len()
    }
}

/// Weights of the knot values at a speed.
pub(crate) struct Rows {
    pub shape: DVector<f64>,
    pub work: DVector<f64>,
}

impl Rows {
    pub(crate) fn of(&self, parameter: usize) -> &DVector<f64> {
        if parameter < WORK { &self.shape } else { &self.work }
    }
}

/// Factors on the variance beyond one end; 1 if the roughness explains the deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Widening {
    /// Of the shape of lines.
    pub shape: f64,
    /// Of work, and so of efficiency.
    pub work: f64,
}

/// No widening. Source: definition.
pub(crate) const NO_WIDENING: Widening = Widening { shape: 1.0, work: 1.0 };

/// An end of the measured speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    Slow,
    Fast,
}

/// Widenings of both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EndWidenings {
    pub slow: Widening,
    pub fast: Widening,
}

impl EndWidenings {
    pub(crate) const NONE: EndWidenings = EndWidenings { slow: NO_WIDENING, fast: NO_WIDENING };

    pub(crate) fn both(factors: Widening) -> EndWidenings {
        EndWidenings { slow: factors, fast: factors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn straight_lines_are_kept_and_cost_nothing(
            steps in proptest::collection::vec(0.05..1.0f64, 1..8), slope in -2.0..2.0f64, t in 0.0..1.0f64,
        ) {
            let mut at = 0.0;
            let mut knots = vec![at];
            for step in &steps { at += step; knots.push(at); }
            let spline = SpeedSpline::new(Coordinate::Speed, &knots);
            let values = DVector::from_iterator(knots.len(), knots.iter().map(|k| 0.3 + slope * k));
            let inside = t * at;
            prop_assert!((spline.row(inside).dot(&values) - (0.3 + slope * inside)).abs() < 1e-9);
            prop_assert!((values.transpose() * &spline.penalty * &values)[(0, 0)].abs() < 1e-9);
            // Outside the slope continues and then decays.
            let near = spline.row(at + 1e-6).dot(&values);
            prop_assert!((near - (0.3 + slope * (at + 1e-6))).abs() < 1e-9);
            let far = spline.row(at + 50.0).dot(&values);
            prop_assert!((far - (0.3 + slope * (at + DAMPING_LENGTH_RATIO.min(0.5 * at)))).abs() < 1e-9);
            // The difference to the straight line is the decayed part.
            let straight = far + spline.straight_minus_damped(at + 50.0).dot(&values);
            prop_assert!((straight - (0.3 + slope * (at + 50.0))).abs() < 1e-9);
        }

        /// A straight line through two knots, a third value in their middle at distance h: the curvature is spread over
        /// two parabola halves, integral of g''^2 = 3 d^2 / h^3 for a rise d: Green and Silverman, ch. 2.
        #[test]
        fn the_prior_variance_between_knots_is_that_of_an_integrated_random_walk(h in 0.05..2.0f64) {
            let spline = SpeedSpline::new(Coordinate::Speed, &[0.0, 2.0 * h]);
            let exact = h.powi(3) / 6.0;
            prop_assert!((spline.prior_variance(h) / exact - 1.0).abs() < 1e-9);
            prop_assert!(spline.prior_variance(2.0 * h) == 0.0);
            prop_assert!(spline.prior_variance(3.0 * h) > spline.prior_variance(2.5 * h));
        }

        #[test]
        fn it_is_continuous_with_its_slope(values in proptest::collection::vec(-1.0..1.0f64, 5)) {
            let spline = SpeedSpline::new(Coordinate::Speed, &[0.0, 0.2, 0.5, 0.6, 1.1]);
            let values = DVector::from_vec(values);
            let value = |at: f64| spline.row(at).dot(&values);
            for knot in [0.0, 0.2, 0.5, 0.6, 1.1] {
                let h = 1e-5;
                let (left, right) = ((value(knot) - value(knot - h)) / h, (value(knot + h) - value(knot)) / h);
                // The second derivative is below 1e3 for values of order 1 and knots 0.1 apart.
                prop_assert!((left - right).abs() < 0.05, "{} {}", left, right);
            }
        }
    }
}
