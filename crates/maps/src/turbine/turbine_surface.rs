//! A quantity of a turbine map as a polynomial over vane position, speed and one coordinate of the expansion, by linear least squares.

use mapper_core::half_width_95;
use mapper_numerics::statistics::{SHARE_975, range, student_quantile};
use nalgebra::{DMatrix, DVector};

/// Maximum leverage of a point. Bound: excludes division by zero.
const MAX_LEVERAGE: f64 = 1.0 - 1e-9;
/// Distance of equal coordinates, ratio to the largest. Bound: stands hold speeds and positions within 1 %.
const SAME_COORDINATE_RATIO: f64 = 0.02;

/// Vane position, speed, coordinate of the expansion.
pub(crate) type Place = [f64; 3];
/// Exponents of the three coordinates.
pub(crate) type Term = [i32; 3];

#[derive(Debug, Clone)]
pub(crate) struct Observation {
    pub place: Place,
    pub value: f64,
    pub line: usize,
    /// Changes of the value by one standard deviation of each error that all values share; the same places in all.
    pub changes: Vec<f64>,
}

#[derive(Debug, Clone)]
pub(crate) struct Surface {
    terms: Vec<Term>,
    coefficients: DVector<f64>,
    /// Those of the change by each error that all values share.
    common: Vec<DVector<f64>>,
    inverse: DMatrix<f64>,
    centre: Place,
    half_range: Place,
    /// Standard deviation of a value about the surface: of the residuals, or the error at left-out lines if it is larger.
    pub sigma: f64,
    /// Half of a 95 % interval over its standard error.
    quantile: f64,
    /// Root mean square error at left-out lines.
    pub left_out_rms: f64,
}

/// Minimum number of points per term. Bound: with fewer the residuals underestimate the error.
const MIN_POINTS_PER_TERM: usize = 2;

impl Surface {
    /// Fits the first terms of `candidates`, in the number with the smallest error at left-out lines. `None` without enough points.
    pub fn fit(observations: &[Observation], candidates: &[Term]) -> Option<Surface> {
        let (centre, half_range) = ranges(observations)?;
        // Powers that the places do not determine are left out: two vane positions have no curvature.
        let usable: Vec<Term> = candidates
            .iter()
            .filter(|term| (0..3).all(|axis| (term[axis] as usize) < distinct(observations, axis)))
            .copied()
            .collect();
        let max_terms = usable.len().min(observations.len() / MIN_POINTS_PER_TERM);
        let fitted = (1..=max_terms).filter_map(|count| {
            let terms = usable.get(..count)?.to_vec();
            Surface::of_terms(observations, terms, centre, half_range)
        });
        fitted.min_by(|a, b| a.left_out_rms.total_cmp(&b.left_out_rms))
    }

    fn of_terms(
        observations: &[Observation],
        terms: Vec<Term>,
        centre: Place,
        half_range: Place,
    ) -> Option<Surface> {
        let lines = 1 + observations.iter().map(|observation| observation.line).max()?;
        let mut surface = Surface {
            coefficients: DVector::zeros(terms.len()),
            common: Vec::new(),
            inverse: DMatrix::zeros(terms.len(), terms.len()),
            terms,
            centre,
            half_range,
            sigma: f64::NAN,
            quantile: f64::NAN,
            left_out_rms: f64::INFINITY,
        };
        let mut squares = Vec::new();
        for line in inner_lines(observations, lines) {
            let (left_out, kept): (Vec<Observation>, Vec<Observation>) =
                observations.iter().cloned().partition(|observation| observation.line == line);
            // With few lines the rest cannot be fitted: single points are left out below instead.
            if surface.solve(&kept).is_some() {
                squares.extend(left_out.iter().map(|o| (o.value - surface.value(o.place)).powi(2)));
            }
        }
        surface.solve(observations)?;
        if squares.is_empty() {
            // The residual of a left-out point is its residual over 1 minus its leverage.
            let left_out = |o: &Observation| {
                ((o.value - surface.value(o.place)) / (1.0 - surface.leverage(o.place))).powi(2)
            };
            squares = observations.iter().map(left_out).collect();
        }
        let freedom =
            observations.len().checked_sub(surface.terms.len()).filter(|freedom| *freedom > 0)? as f64;
        let residuals: f64 = observations.iter().map(|o| (o.value - surface.value(o.place)).powi(2)).sum();
        surface.left_out_rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        surface.sigma = (residuals / freedom).sqrt().max(surface.left_out_rms);
        surface.quantile = student_quantile(SHARE_975, freedom)?;
        surface.left_out_rms.is_finite().then_some(surface)
    }

    fn solve(&mut self, observations: &[Observation]) -> Option<()> {
        if observations.len() < self.terms.len() {
            return None;
        }
        let rows: Vec<DVector<f64>> = observations.iter().map(|o| self.row(o.place)).collect();
        let mut normal = DMatrix::zeros(self.terms.len(), self.terms.len());
        let mut right = DVector::zeros(self.terms.len());
        for (row, observation) in rows.iter().zip(observations) {
            normal += row * row.transpose();
            right += row * observation.value;
        }
        let condition = normal.clone().symmetric_eigenvalues();
        // Coordinates are scaled to -1 to 1, so that the eigenvalues of a determined fit are within some decades.
        if condition.min() < MIN_EIGENVALUE_RATIO * condition.max() {
            return None;
        }
        let factor = normal.cholesky()?;
        self.inverse = factor.inverse();
        self.coefficients = factor.solve(&right);
        let errors = observations.iter().map(|observation| observation.changes.len()).min().unwrap_or(0);
        let change = |error: usize| {
            let moved =
                rows.iter().zip(observations).map(|(row, observation)| row * observation.changes[error]);
            factor.solve(&moved.fold(DVector::zeros(self.terms.len()), |sum, row| sum + row))
        };
        self.common = (0..errors).map(change).collect();
        Some(())
    }

    fn row(&self, place: Place) -> DVector<f64> {
        let scaled: Vec<f64> =
            (0..3).map(|axis| (place[axis] - self.centre[axis]) / self.half_range[axis]).collect();
        let term = |term: &Term| scaled.iter().zip(term).map(|(value, power)| value.powi(*power)).product();
        DVector::from_iterator(self.terms.len(), self.terms.iter().map(term))
    }

    pub fn value(&self, place: Place) -> f64 {
        self.row(place).dot(&self.coefficients)
    }

    fn leverage(&self, place: Place) -> f64 {
        let row = self.row(place);
        (row.transpose() * &self.inverse * &row)[(0, 0)].min(MAX_LEVERAGE)
    }

    /// Standard error of a measured value at a place: of the surface and of the scatter about it.
    pub fn standard_error(&self, place: Place) -> f64 {
        self.sigma * (1.0 + self.leverage(place)).sqrt()
    }

    /// Half of the 95 % interval of a measured value at a place: by its scatter, and by the errors that all values share.
    pub fn half_width(&self, place: Place) -> f64 {
        let row = self.row(place);
        let common: f64 = self.common.iter().map(|coefficients| row.dot(coefficients).powi(2)).sum();
        (self.quantile * self.standard_error(place)).hypot(half_width_95(common.sqrt()))
    }
}

/// Minimum ratio of the eigenvalues of a determined fit. Bound: at 1e-10 coefficients keep five of fifteen digits.
const MIN_EIGENVALUE_RATIO: f64 = 1e-10;

fn ranges(observations: &[Observation]) -> Option<(Place, Place)> {
    let mut centre = [0.0; 3];
    let mut half_range = [1.0; 3];
    for axis in 0..3 {
        let (low, high) = range(observations.iter().map(|observation| observation.place[axis]));
        if low > high {
            return None;
        }
        centre[axis] = 0.5 * (low + high);
        if high > low {
            half_range[axis] = 0.5 * (high - low);
        }
    }
    Some((centre, half_range))
}

/// The lines with both slower and faster neighbours, since leaving an outer line out would test extrapolation. All lines if there are few.
fn inner_lines(observations: &[Observation], lines: usize) -> Vec<usize> {
    let (low, high) = range(observations.iter().map(|observation| observation.place[1]));
    let is_outermost = |line: &usize| {
        let mut own = observations.iter().filter(|observation| observation.line == *line);
        own.any(|observation| {
            observation.place[1] <= low * (1.0 + MAX_LINE_SPEED_DIFFERENCE_RATIO)
                || observation.place[1] >= high * (1.0 - MAX_LINE_SPEED_DIFFERENCE_RATIO)
        })
    };
    let inner: Vec<usize> = (0..lines).filter(|line| !is_outermost(line)).collect();
    if inner.len() < 2 { (0..lines).collect() } else { inner }
}

/// Maximum relative difference of speed within a line. Bound: it varies by 1 %, and lines of maps are at least 5 % apart.
const MAX_LINE_SPEED_DIFFERENCE_RATIO: f64 = 0.015;

/// Number of distinct coordinates along an axis. Those less than 2 % of the largest apart count as one, such as a controlled speed.
fn distinct(observations: &[Observation], axis: usize) -> usize {
    let mut values: Vec<f64> = observations.iter().map(|observation| observation.place[axis]).collect();
    values.sort_by(f64::total_cmp);
    let largest = values.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let mut count = 0;
    let mut last = f64::NEG_INFINITY;
    for value in values {
        if value > last + SAME_COORDINATE_RATIO * largest || count == 0 {
            count += 1;
            last = value;
        }
    }
    count
}
