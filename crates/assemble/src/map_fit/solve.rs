//! The penalised least-squares problem and its smoothing.
//!
//! Unknown are the line parameters at knots over speed, and for every line an offset of flow, head and work (errors of
//! speed and of the day that a whole line shares). Residuals are orthogonal distance and efficiency, weighted down where
//! they are large (Cauchy weights at three standard errors). The penalty of each parameter over speed, the scatter of
//! the lines and the two residual scales are variance components, estimated together with the fit by the update of
//! S. N. Wood and M. Fasiolo ("A generalized Fellner-Schall method for smoothing parameter optimization", Biometrics 73
//! (2017) 1071-1081). No number is tuned to a machine: what a map has enough lines to show is followed, the rest stays
//! straight over speed.

use super::MapFitError;
use super::line_shape::{
    CHOKE_FLOW, EXPONENTS, FlowFrame, LineShape, PARAMETERS, Parameters, WORK, ZERO_SLOPE_HEAD,
};
use super::nearest::{Foot, Scales, nearest, normal};
use super::observations::{Observation, Observations};
use super::speed_spline::{Coordinate, SpeedSpline};
use nalgebra::{DMatrix, DVector};

/// Parameters that an offset of a whole line moves together: flow; head with work, as an error of speed does, which
/// leaves efficiency alone; work alone, which is efficiency.
const LINE_OFFSETS: [&[usize]; 3] = [&[CHOKE_FLOW], &[ZERO_SLOPE_HEAD, WORK], &[WORK]];
/// Most knots over speed.
const MOST_KNOTS: usize = 10;
/// Rounds with everything fixed but the parameters, rounds that estimate the variances, and rounds to settle.
const ROUNDS: [usize; 3] = [8, 22, 15];
/// Largest relative change of a variance component at which the estimation has settled.
const SETTLED: f64 = 0.05;
/// Standard errors beyond which a residual loses weight.
const ROBUST: f64 = 3.0;
/// Standard deviations of the level of each parameter about its starting value: wide for what points determine.
const LEVEL_SD: Parameters = [2.0, 2.0, 0.7, 0.25, 0.4, 0.4, 0.03, 0.03, 2.0, 1.0, 1.0, 0.5, 0.5, 0.5];
/// Scatter of whole lines where the estimation starts: small, since on a map of few lines what begins as scatter is never
/// found to be shape.
const SCATTER: f64 = 0.005;
/// Scales of the residuals where the estimation starts: the first always, the others where it ends [`FAR`] off.
const START_SCALES: [f64; 3] = [0.01, 0.003, 0.02];
/// Root mean square of distance or efficiency beyond which a fit is tried from other scales.
const FAR: f64 = 0.006;
/// Roughness of each parameter over speed where the estimation starts.
const ROUGHNESS: Parameters = [0.5, 0.5, 3.0, 1.0, 1.5, 1.5, 0.15, 0.15, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];

/// Splines over speed with equal knots.
#[derive(Debug, Clone)]
pub(crate) struct Splines {
    /// Of the line's shape.
    pub shape: SpeedSpline,
    /// Of the work coefficient.
    pub work: SpeedSpline,
}

impl Splines {
    fn new(speed_ratios: &[f64]) -> Self {
        Splines {
            shape: SpeedSpline::new(Coordinate::Speed, speed_ratios),
            work: SpeedSpline::new(Coordinate::Slowness, speed_ratios),
        }
    }

    fn of(&self, parameter: usize) -> &SpeedSpline {
        if parameter < WORK { &self.shape } else { &self.work }
    }

    fn rows(&self, speed_ratio: f64) -> Rows {
        Rows { shape: self.shape.row(speed_ratio), work: self.work.row(speed_ratio) }
    }

    fn len(&self) -> usize {
        self.shape.len()
    }
}

/// Weights of the knot values at a speed.
struct Rows {
    shape: DVector<f64>,
    work: DVector<f64>,
}

impl Rows {
    fn of(&self, parameter: usize) -> &DVector<f64> {
        if parameter < WORK { &self.shape } else { &self.work }
    }
}

/// A solved problem.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    pub splines: Splines,
    pub frame: FlowFrame,
    /// Parameters at the knots.
    values: DMatrix<f64>,
    /// Covariance of all unknowns, parameters first (parameter by parameter, knot by knot).
    covariance: DMatrix<f64>,
    /// One over the penalty: variance of the roughness.
    roughness_variance: Parameters,
    /// Standard deviations of the line offsets, logarithms.
    pub line_scatter: [f64; 3],
    /// Root mean squares of distance and efficiency.
    pub rms: [f64; 2],
    /// Minus twice the logarithm of the marginal likelihood by Laplace's approximation, but for a constant of the data.
    improbability: f64,
    /// Highest efficiency of the fit at the points, fraction.
    pub best_eta: f64,
    /// Angles of the feet, in the order of the points.
    pub angles_rad: Vec<f64>,
}

impl Solution {
    /// Parameters of the smooth surface at a speed.
    pub(crate) fn parameters(&self, speed_ratio: f64) -> Parameters {
        let rows = self.splines.rows(speed_ratio);
        std::array::from_fn(|q| self.values.row(q).transpose().dot(rows.of(q)))
    }

    pub(crate) fn shape(&self, speed_ratio: f64) -> LineShape {
        LineShape::new(&self.parameters(speed_ratio), self.frame)
    }

    /// Covariance of the parameters at a speed: of the surface, of a line about it, and of what may happen between the
    /// knots and beyond them.
    pub(crate) fn covariance(&self, speed_ratio: f64) -> DMatrix<f64> {
        let (rows, knots) = (self.splines.rows(speed_ratio), self.splines.len());
        // The roughness was estimated on this many second differences: Student's quantile over the normal one (first
        // terms of its Cornish-Fisher series at 97.5 %), squared.
        let freedom = knots.saturating_sub(2).max(1) as f64;
        let few = (1.0 + 1.21 / freedom + 1.44 / freedom.powi(2)).powi(2);
        let open =
            (self.splines.shape.open_variance(speed_ratio), self.splines.work.open_variance(speed_ratio));
        let mut out = DMatrix::zeros(PARAMETERS, PARAMETERS);
        for a in 0..PARAMETERS {
            for b in 0..PARAMETERS {
                let block = self.covariance.view((a * knots, b * knots), (knots, knots));
                out[(a, b)] = (rows.of(a).transpose() * block * rows.of(b))[(0, 0)];
            }
            out[(a, a)] += if a < WORK { open.0 } else { open.1 } * self.roughness_variance[a] * few;
        }
        for (index, together) in LINE_OFFSETS.iter().enumerate() {
            for (a, b) in together.iter().flat_map(|a| together.iter().map(move |b| (*a, *b))) {
                out[(a, b)] += self.line_scatter[index].powi(2);
            }
        }
        out
    }
}

/// What a round of the fit works on.
struct Problem<'a> {
    data: &'a Observations,
    frame: FlowFrame,
    splines: Splines,
    rows: Vec<Rows>,
    start: Parameters,
}

/// Unknowns: parameters at knots and offsets of lines.
#[derive(Clone)]
struct Unknowns {
    values: DMatrix<f64>,
    offsets: DMatrix<f64>,
}

/// Variance components, as precisions.
struct Precisions {
    rough: Parameters,
    lines: [f64; 3],
    /// Scales of distance and efficiency.
    scales: [f64; 2],
}

/// What a round of the fit is for.
enum Phase {
    /// The parameters come near, the variances stand.
    Free,
    /// The variances are estimated.
    Estimate,
    /// The parameters follow the last variances.
    Settle,
}

/// Fits. `stiffness` (1 or more) is the factor on the least penalty that the estimation may choose.
///
/// Where the points end far from their lines, the estimation may have settled on scatter where there is shape, or on
/// outliers where there are none: then it is made again from other scales, and the most probable is kept.
pub(crate) fn solve(data: &Observations, stiffness: f64) -> Result<Solution, MapFitError> {
    let [first, others @ ..] = START_SCALES;
    let mut best = solve_from(data, stiffness, first)?;
    if best.rms[0] > FAR || best.rms[1] > FAR {
        for scale in others {
            if let Ok(other) = solve_from(data, stiffness, scale)
                && other.improbability < best.improbability
            {
                best = other;
            }
        }
    }
    Ok(best)
}

fn solve_from(data: &Observations, stiffness: f64, start_scale: f64) -> Result<Solution, MapFitError> {
    let mut problem = Problem::new(data);
    let start_rough: Parameters = ROUGHNESS.map(|r| stiffness / (r * r));
    let mut precisions =
        Precisions { rough: start_rough, lines: [1.0 / SCATTER.powi(2); 3], scales: [start_scale; 2] };
    let mut unknowns = problem.initial()?;
    problem.start =
        std::array::from_fn(|q| if q < WORK { problem.start[q] } else { unknowns.values[(q, 0)] });
    let mut feet = problem.feet(&unknowns, None);
    let mut damping = 1e-2;
    let [free, estimate, settle] = ROUNDS;
    let mut phase = Phase::Free;
    for round in 0..free + estimate + settle {
        let residuals = problem.residuals(&feet);
        let weights = problem.weights(&residuals, &precisions.scales);
        let jacobian = problem.jacobian(&unknowns, &feet, &weights);
        let (penalty, gradient) = problem.penalty(&unknowns, &precisions);
        let scaled = DVector::from_iterator(
            2 * residuals.len(),
            residuals.iter().zip(&weights).flat_map(|(r, w)| [r[0] * w[0].sqrt(), r[1] * w[1].sqrt()]),
        );
        let transposed = jacobian.transpose();
        let gradient = &transposed * scaled + gradient;
        // Not tr_mul: a product of two matrices goes through matrixmultiply's kernels.
        let normal_matrix = transposed * &jacobian + &penalty;
        let cost = problem.cost(&residuals, &weights) + problem.penalty_value(&unknowns, &precisions);
        let mut better = None;
        for _ in 0..6 {
            let mut damped = normal_matrix.clone();
            for i in 0..damped.nrows() {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = damped.cholesky().map(|factor| -factor.solve(&gradient));
            if let Some(step) = step.filter(|step| step.iter().all(|v| v.is_finite())) {
                let next = problem.stepped(&unknowns, &step);
                let next_feet = problem.feet(&next, Some(&feet));
                let next_cost = problem.cost(&problem.residuals(&next_feet), &weights)
                    + problem.penalty_value(&next, &precisions);
                if next_cost < cost {
                    better = Some((next, next_feet, next_cost));
                    break;
                }
            }
            damping = (damping * 5.0).max(1e-6);
        }
        let gain = better.as_ref().map_or(0.0, |(.., next_cost)| cost - next_cost);
        if let Some((next, next_feet, _)) = better {
            (unknowns, feet) = (next, next_feet);
            damping = (damping / 5.0).max(1e-9);
        }
        match phase {
            Phase::Free if round + 1 >= free || gain < 1e-2 * cost => phase = Phase::Estimate,
            Phase::Estimate => {
                let inverse = normal_matrix.cholesky().ok_or(MapFitError::Singular)?.inverse();
                let residuals = problem.residuals(&feet);
                let change =
                    problem.update(&mut precisions, &unknowns, &inverse, &jacobian, &residuals, &start_rough);
                if round + 1 >= free + estimate || (change < SETTLED && gain < 1e-3 * cost) {
                    // A foot may have been caught on a wrong part of the line: look at the whole line once more.
                    feet = problem.feet(&unknowns, None);
                    phase = Phase::Settle;
                }
            }
            Phase::Settle if gain < 1e-4 * cost => break,
            _ => {}
        }
    }
    let residuals = problem.residuals(&feet);
    let jacobian = problem.jacobian(&unknowns, &feet, &problem.weights(&residuals, &precisions.scales));
    let information = jacobian.transpose() * &jacobian + problem.penalty(&unknowns, &precisions).0;
    let factor = information.cholesky().ok_or(MapFitError::Singular)?;
    let improbability = problem.improbability(&unknowns, &precisions, &residuals)
        + 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let covariance = factor.inverse();
    // As a user meets the map: points against the smooth surface, without the lines' own offsets.
    let smooth =
        Unknowns { offsets: DMatrix::zeros(LINE_OFFSETS.len(), data.lines_rpm.len()), ..unknowns.clone() };
    let smooth_feet = problem.feet(&smooth, Some(&feet));
    Ok(Solution {
        rms: problem.rms(&problem.residuals(&smooth_feet)),
        improbability,
        best_eta: smooth_feet.iter().map(|foot| foot.place.eta).fold(0.0, f64::max),
        angles_rad: smooth_feet.iter().map(|foot| foot.angle_rad).collect(),
        splines: problem.splines,
        frame: problem.frame,
        values: unknowns.values,
        covariance,
        roughness_variance: precisions.rough.map(|p| 1.0 / p),
        line_scatter: precisions.lines.map(|p| 1.0 / p.sqrt()),
    })
}

impl<'a> Problem<'a> {
    fn new(data: &'a Observations) -> Self {
        let mut ratios: Vec<f64> =
            data.lines_rpm.iter().map(|speed| speed / data.nominal_speed_rpm).collect();
        ratios.dedup_by(|b, a| *b < *a * 1.02);
        let splines = Splines::new(&if ratios.len() <= MOST_KNOTS { ratios } else { thinned(&ratios) });
        let rows = data.points.iter().map(|p| splines.rows(p.speed_ratio)).collect();
        let mut flows: Vec<f64> = data.points.iter().map(Observation::flow).collect();
        flows.sort_by(f64::total_cmp);
        let (low, high) = (flows.first().copied().unwrap_or(0.0), flows.last().copied().unwrap_or(1.0));
        let middle = flows.get(flows.len() / 2).copied().unwrap_or(0.5);
        let frame = FlowFrame { middle, half: (0.5 * (high - low)).max(1e-6 * high) };
        let mut problem = Problem { data, frame, splines, rows, start: [0.0; PARAMETERS] };
        problem.start = problem.starting_level();
        problem
    }

    /// Largest value of a line's points, for each line.
    fn line_maxima(&self, value: impl Fn(&Observation) -> f64) -> Vec<f64> {
        let mut largest = vec![f64::MIN; self.data.lines_rpm.len()];
        for point in &self.data.points {
            largest[point.line] = largest[point.line].max(value(point));
        }
        largest
    }

    fn starting_level(&self) -> Parameters {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let mut level = [0.0; PARAMETERS];
        level[CHOKE_FLOW] = (1.03 * mean(&self.line_maxima(Observation::flow))).ln();
        level[ZERO_SLOPE_HEAD] = mean(&self.line_maxima(Observation::head)).max(1e-9).ln();
        level[super::line_shape::ZERO_SLOPE_FLOW] = -0.8;
        level[super::line_shape::CHOKE_HEAD] = 0.1;
        // Exponents near 2: an ellipse.
        EXPONENTS.iter().for_each(|i| level[*i] = -0.05);
        level
    }

    /// A quadratic work coefficient through all points, and each line's own size.
    fn initial(&self) -> Result<Unknowns, MapFitError> {
        let knots = self.splines.len();
        let mut values = DMatrix::from_fn(PARAMETERS, knots, |q, _| self.start[q]);
        let with_eta: Vec<(f64, f64)> = self
            .data
            .points
            .iter()
            .filter_map(|p| {
                let work = (p.head() / p.eta?.max(0.05)).max(1e-9).ln();
                Some(((p.flow() - self.frame.middle) / self.frame.half, work))
            })
            .collect();
        let terms = DMatrix::from_fn(with_eta.len(), 3, |i, j| with_eta[i].0.powi(j as i32));
        let works = DVector::from_iterator(with_eta.len(), with_eta.iter().map(|w| w.1));
        let square = terms.tr_mul(&terms) + DMatrix::identity(3, 3) * 1e-6;
        let work = square.cholesky().ok_or(MapFitError::Singular)?.solve(&terms.tr_mul(&works));
        for j in 0..3 {
            values.row_mut(WORK + j).fill(work[j]);
        }
        let basis = DMatrix::from_fn(self.rows.len(), knots, |i, k| self.rows[i].shape[k]);
        let smoother = basis.tr_mul(&basis)
            + &self.splines.shape.penalty * (0.03 / self.rows.len() as f64)
            + DMatrix::identity(knots, knots) * 1e-6;
        let smoother = smoother.cholesky().ok_or(MapFitError::Singular)?;
        for (parameter, sizes, factor) in [
            (CHOKE_FLOW, self.line_maxima(Observation::flow), 1.03),
            (ZERO_SLOPE_HEAD, self.line_maxima(Observation::head), 1.005),
        ] {
            let logs = DVector::from_iterator(
                self.rows.len(),
                self.data.points.iter().map(|p| (factor * sizes[p.line].max(1e-9)).ln()),
            );
            values.row_mut(parameter).copy_from(&smoother.solve(&basis.tr_mul(&logs)).transpose());
        }
        Ok(Unknowns { values, offsets: DMatrix::zeros(LINE_OFFSETS.len(), self.data.lines_rpm.len()) })
    }

    fn parameters(&self, unknowns: &Unknowns, point: usize) -> Parameters {
        let rows = &self.rows[point];
        let mut p: Parameters = std::array::from_fn(|q| {
            unknowns.values.row(q).iter().zip(rows.of(q).iter()).map(|(v, w)| v * w).sum::<f64>()
        });
        for (index, parameter) in
            LINE_OFFSETS.iter().enumerate().flat_map(|(i, all)| all.iter().map(move |q| (i, q)))
        {
            p[*parameter] += unknowns.offsets[(index, self.data.points[point].line)];
        }
        p
    }

    fn feet(&self, unknowns: &Unknowns, before: Option<&[Foot]>) -> Vec<Foot> {
        let foot = |(i, p): (usize, &Observation)| {
            let shape = LineShape::new(&self.parameters(unknowns, i), self.frame);
            let guess = before.map(|feet| feet[i].angle_rad);
            nearest(&shape, p.speed_ratio, (p.flow_kg_s, p.pressure_ratio), scales(p), guess)
        };
        self.data.points.iter().enumerate().map(foot).collect()
    }

    fn residuals(&self, feet: &[Foot]) -> Vec<[f64; 2]> {
        let residual =
            |(p, foot): (&Observation, &Foot)| [foot.distance, p.eta.map_or(0.0, |eta| eta - foot.place.eta)];
        self.data.points.iter().zip(feet).map(residual).collect()
    }

    fn weights(&self, residuals: &[[f64; 2]], scale: &[f64; 2]) -> Vec<[f64; 2]> {
        let weight = |(p, r): (&Observation, &[f64; 2])| {
            let variance = [scale[0] * scale[0], scale[1] * scale[1] + p.eta_error * p.eta_error];
            let cauchy = |i: usize| 1.0 / (1.0 + r[i] * r[i] / variance[i] / (ROBUST * ROBUST)) / variance[i];
            [cauchy(0), if p.eta.is_some() { cauchy(1) } else { 0.0 }]
        };
        self.data.points.iter().zip(residuals).map(weight).collect()
    }

    fn cost(&self, residuals: &[[f64; 2]], weights: &[[f64; 2]]) -> f64 {
        residuals.iter().zip(weights).map(|(r, w)| w[0] * r[0] * r[0] + w[1] * r[1] * r[1]).sum()
    }

    /// Derivatives of the residuals, each row times the root of its weight.
    fn jacobian(&self, unknowns: &Unknowns, feet: &[Foot], weights: &[[f64; 2]]) -> DMatrix<f64> {
        const STEP: f64 = 1e-5;
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut out = DMatrix::zeros(2 * feet.len(), PARAMETERS * knots + LINE_OFFSETS.len() * lines);
        for (i, (p, foot)) in self.data.points.iter().zip(feet).enumerate() {
            let parameters = self.parameters(unknowns, i);
            let (nx, ny) = normal(&foot.slope);
            let length = (foot.slope[0].powi(2) + foot.slope[1].powi(2)).max(1e-12);
            let root = weights[i].map(f64::sqrt);
            let shape = LineShape::new(&parameters, self.frame);
            let here = shape.at(foot.angle_rad);
            let work_terms = shape.work_terms(here.flow, here.head);
            for q in 0..PARAMETERS {
                let (x, y, eta) = if q >= WORK {
                    // Work moves nothing but efficiency.
                    (0.0, 0.0, -foot.place.eta * work_terms[q - WORK])
                } else {
                    let mut moved = parameters;
                    moved[q] += STEP;
                    let place = LineShape::new(&moved, self.frame).physical(foot.angle_rad, p.speed_ratio);
                    (
                        (place.flow_kg_s - foot.place.flow_kg_s) / p.flow_scale_kg_s / STEP,
                        (place.pressure_ratio - foot.place.pressure_ratio) / p.ratio_scale / STEP,
                        (place.eta - foot.place.eta) / STEP,
                    )
                };
                // The foot moves along the line as the line moves.
                let along = (x * foot.slope[0] + y * foot.slope[1]) / length;
                let derivative = [-(x * nx + y * ny), -(eta - foot.slope[2] * along)];
                for c in 0..2 {
                    let value = derivative[c] * root[c];
                    for k in 0..knots {
                        out[(2 * i + c, q * knots + k)] = value * self.rows[i].of(q)[k];
                    }
                    for (index, _) in LINE_OFFSETS.iter().enumerate().filter(|(_, all)| all.contains(&q)) {
                        out[(2 * i + c, PARAMETERS * knots + index * lines + p.line)] += value;
                    }
                }
            }
        }
        out
    }

    /// Matrix of the penalty and its gradient.
    fn penalty(&self, unknowns: &Unknowns, precisions: &Precisions) -> (DMatrix<f64>, DVector<f64>) {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let size = PARAMETERS * knots + LINE_OFFSETS.len() * lines;
        let (mut matrix, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for q in 0..PARAMETERS {
            let level = self.level_precision(q);
            let block = &self.splines.of(q).penalty * precisions.rough[q];
            let values = unknowns.values.row(q).transpose();
            let mut part = &block * &values;
            matrix.view_mut((q * knots, q * knots), (knots, knots)).copy_from(&block);
            for k in 0..knots {
                matrix[(q * knots + k, q * knots + k)] += level;
                part[k] += level * (values[k] - self.start[q]);
            }
            gradient.rows_mut(q * knots, knots).copy_from(&part);
        }
        for (index, precision) in precisions.lines.iter().enumerate() {
            for line in 0..lines {
                let at = PARAMETERS * knots + index * lines + line;
                matrix[(at, at)] = *precision;
                gradient[at] = precision * unknowns.offsets[(index, line)];
            }
        }
        (matrix, gradient)
    }

    fn penalty_value(&self, unknowns: &Unknowns, precisions: &Precisions) -> f64 {
        let mut sum = 0.0;
        for q in 0..PARAMETERS {
            let values = unknowns.values.row(q).transpose();
            sum += precisions.rough[q] * values.dot(&(&self.splines.of(q).penalty * &values));
            let level = values.iter().map(|v| (v - self.start[q]).powi(2)).sum::<f64>();
            sum += self.level_precision(q) * level;
        }
        for (index, precision) in precisions.lines.iter().enumerate() {
            sum += precision * unknowns.offsets.row(index).norm_squared();
        }
        sum
    }

    /// [`Solution::improbability`] without the determinant of the information.
    fn improbability(&self, unknowns: &Unknowns, precisions: &Precisions, residuals: &[[f64; 2]]) -> f64 {
        let mut sum = self.penalty_value(unknowns, precisions);
        for (p, r) in self.data.points.iter().zip(residuals) {
            let scales = precisions.scales.map(|s| s * s);
            let loss = |variance: f64, r: f64| {
                variance.ln() + ROBUST * ROBUST * (r * r / variance / (ROBUST * ROBUST)).ln_1p()
            };
            sum += loss(scales[0], r[0]);
            if p.eta.is_some() {
                sum += loss(scales[1] + p.eta_error * p.eta_error, r[1]);
            }
        }
        let free = self.splines.len().saturating_sub(2) as f64;
        sum -= precisions.rough.iter().map(|p| free * p.ln()).sum::<f64>();
        sum - precisions.lines.iter().map(|p| self.data.lines_rpm.len() as f64 * p.ln()).sum::<f64>()
    }

    fn level_precision(&self, parameter: usize) -> f64 {
        1.0 / (LEVEL_SD[parameter].powi(2) * self.splines.len() as f64)
    }

    fn stepped(&self, unknowns: &Unknowns, step: &DVector<f64>) -> Unknowns {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut next = unknowns.clone();
        // Half a logarithm at a time: beyond, the linearisation says nothing.
        let limited = |at: usize| step[at].clamp(-0.5, 0.5);
        for q in 0..PARAMETERS {
            for k in 0..knots {
                next.values[(q, k)] += limited(q * knots + k);
            }
        }
        for index in 0..LINE_OFFSETS.len() {
            for line in 0..lines {
                next.offsets[(index, line)] += limited(PARAMETERS * knots + index * lines + line);
            }
        }
        next
    }

    /// One step of the variance components; the largest relative change of one.
    fn update(
        &self,
        precisions: &mut Precisions,
        unknowns: &Unknowns,
        inverse: &DMatrix<f64>,
        jacobian: &DMatrix<f64>,
        residuals: &[[f64; 2]],
        start_rough: &Parameters,
    ) -> f64 {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut change = 0.0f64;
        let mut set = |precision: &mut f64, next: f64| {
            change = change.max((next / *precision - 1.0).abs());
            *precision = next;
        };
        for (q, start) in start_rough.iter().enumerate() {
            let values = unknowns.values.row(q).transpose();
            let block = inverse.view((q * knots, q * knots), (knots, knots));
            let used = precisions.rough[q] * (block * &self.splines.of(q).penalty).trace();
            let free = (knots.saturating_sub(2) as f64 - used).max(1e-2);
            let wanted = free / (values.dot(&(&self.splines.of(q).penalty * &values)) + 1e-9);
            let step = (wanted / precisions.rough[q]).clamp(0.3, 3.0);
            // Twenty times stiffer than where it starts is a straight line to the eye; more would only make errors too
            // sure beyond the measured lines.
            let next = (precisions.rough[q] * step).clamp(0.03 * start, 20.0 * start);
            set(&mut precisions.rough[q], next);
        }
        for (index, precision) in precisions.lines.iter_mut().enumerate() {
            let first = PARAMETERS * knots + index * lines;
            let trace: f64 = (first..first + lines).map(|i| inverse[(i, i)]).sum();
            let wanted = (lines as f64 - *precision * trace).max(0.01)
                / (unknowns.offsets.row(index).norm_squared() + 1e-9);
            // Between 0.05 % and 3 %: less is no error of speed, more is another machine.
            let next = (*precision * (wanted / *precision).clamp(0.5, 2.0)).clamp(1.0 / 9e-4, 4e6);
            set(precision, next);
        }
        let projected = jacobian * inverse;
        for c in 0..2 {
            let mut sum = [0.0; 3];
            for (i, (p, r)) in self.data.points.iter().zip(residuals).enumerate() {
                if c == 1 && p.eta.is_none() {
                    continue;
                }
                let own = if c == 1 { p.eta_error.powi(2) } else { 0.0 };
                let variance = precisions.scales[c].powi(2) + own;
                let robust = 1.0 / (1.0 + r[c] * r[c] / variance / (ROBUST * ROBUST));
                // What a point declares of itself is no scatter of the fit's.
                let share = precisions.scales[c].powi(2) / variance;
                let leverage = projected.row(2 * i + c).dot(&jacobian.row(2 * i + c));
                sum[0] += robust * share * share * (r[c] * r[c] - own).max(0.0);
                sum[1] += robust * share * share;
                sum[2] += (leverage * share * share).min(1.0);
            }
            let degrees = (sum[1] - sum[2]).max(0.25 * sum[1]).max(1e-9);
            let wanted = (sum[0] / degrees).sqrt();
            let scale = precisions.scales[c];
            set(&mut precisions.scales[c], wanted.clamp((0.7 * scale).max(1e-3), (1.2 * scale).min(0.03)));
        }
        change
    }

    fn rms(&self, residuals: &[[f64; 2]]) -> [f64; 2] {
        let with_eta = self.data.points.iter().filter(|p| p.eta.is_some()).count().max(1);
        let sum = |c: usize| residuals.iter().map(|r| r[c] * r[c]).sum::<f64>();
        [(sum(0) / residuals.len().max(1) as f64).sqrt(), (sum(1) / with_eta as f64).sqrt()]
    }
}

/// Units of distance of a point's line.
pub(crate) fn scales(point: &Observation) -> Scales {
    Scales { flow_kg_s: point.flow_scale_kg_s, ratio: point.ratio_scale }
}

/// [`MOST_KNOTS`] of the speeds, spread over their ranks.
fn thinned(ratios: &[f64]) -> Vec<f64> {
    let last = (ratios.len() - 1) as f64;
    (0..MOST_KNOTS)
        .map(|i| {
            let at = last * i as f64 / (MOST_KNOTS - 1) as f64;
            let below = (at.floor() as usize).min(ratios.len() - 2);
            ratios[below] + (at - below as f64) * (ratios[below + 1] - ratios[below])
        })
        .collect()
}
