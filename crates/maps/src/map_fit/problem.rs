//! The penalised least-squares problem: residuals at the nearest places of the line, their derivatives, and the penalty.
//!
//! The unknowns are the line parameters at knots over speed, and for every line an offset of flow, head and work (errors of speed and of
//! the day that a whole line shares). The residuals are orthogonal distance and efficiency, with Cauchy weights at three standard errors.

use crate::map_fit::MapFitError;
use crate::map_fit::observations::{Observation, Observations};
use crate::map_fit::speed_lines::{
    CHOKE_FLOW, CHOKE_HEAD, EXPONENTS, FlowFrame, Foot, LineShape, MIN_SQUARE_SLOPE, PARAMETERS, Parameters,
    Rows, Scales, Splines, WORK, ZERO_SLOPE_FLOW, ZERO_SLOPE_HEAD, nearest, normal,
};
use mapper_numerics::statistics::{mean, median, quantile};
use nalgebra::{DMatrix, DVector};

/// Standard errors beyond which a residual loses weight. Bound: by chance exceeded once in 370 times.
pub(crate) const ROBUST_SIGMAS: f64 = 3.0;

/// Range of the precision of a roughness over its starting value. Bound: twenty times stiffer is visually straight; a stiffer one would
/// make errors beyond the measured lines too small.
pub(crate) const ROUGHNESS_PRECISION_RANGE: [f64; 2] = [0.03, 20.0];

pub(crate) struct Precisions {
    /// Precision of the roughness of each parameter over speed.
    pub(crate) rough: Parameters,
    /// Precision of each line offset.
    pub(crate) lines: [f64; 3],
    /// Scales of the residuals of distance and efficiency.
    pub(crate) scales: [f64; 2],
}

/// Minimum distance of knots over speed, ratio. Bound: stands hold a speed within 1 %.
const MIN_KNOT_DISTANCE_RATIO: f64 = 0.02;
/// Choke flow over the largest flow of a line. Bound: a start value.
const START_CHOKE_RATIO: f64 = 1.03;
/// Head at zero slope over the largest head of a line. Bound: a start value.
const START_HEAD_RATIO: f64 = 1.005;
/// Logit of the zero-slope flow over the choke flow. Bound: a start value, a ratio of 0.3.
const START_ZERO_SLOPE_FLOW: f64 = -0.8;
/// Head at choke over head at zero slope. Bound: a start value.
const START_CHOKE_HEAD: f64 = 0.1;
/// Logarithm of the exponents minus their minimum. Bound: a start value, exponents of 2: an ellipse.
const START_EXPONENT: f64 = -0.05;
/// Penalty of the start values' roughness. Bound: a start value.
const START_PENALTY: f64 = 0.03;
/// Minimum flow, head or work of which a logarithm is taken. Bound: excludes the logarithm of zero.
const SMALL: f64 = 1e-9;
/// Minimum efficiency of a point for the start values. Bound: near choke, work is the ratio of two small numbers.
const MIN_ETA: f64 = 0.2;
/// Ridge of the start values. Bound: keeps matrices regular, far below any weight.
const RIDGE: f64 = 1e-6;
/// Step of the derivatives by a parameter. Bound: between rounding and curvature for parameters of order 1.
pub(crate) const PARAMETER_STEP: f64 = 1e-5;
/// Minimum range of flow, ratio to the largest. Bound: excludes division by zero.
const MIN_RANGE_RATIO: f64 = 1e-6;

/// Parameters that an offset of a whole line changes: flow; head with work (an error of speed, without effect on efficiency); work alone
/// (efficiency).
pub(crate) const LINE_OFFSETS: [&[usize]; 3] = [&[CHOKE_FLOW], &[ZERO_SLOPE_HEAD, WORK], &[WORK]];
/// Maximum number of knots over speed. Bound: effort; maps have up to ten lines.
const MAX_KNOTS: usize = 10;
/// Prior standard deviations of each parameter's level about its starting value. Bound: where points determine a parameter, wider than
/// any line: ln of flow and head, 2; logit of the zero-slope flow, 0.7; choke head, 0.25; ln of the exponents, 0.4; corrections of the
/// radius, 0.03, the scatter of a line about an ellipse; ln of the work, 2, its slopes, 1, and its curvatures, 0.5, more than an
/// efficiency changes along a line.
const LEVEL_SD: Parameters = [2.0, 2.0, 0.7, 0.25, 0.4, 0.4, 0.03, 0.03, 2.0, 1.0, 1.0, 0.5, 0.5, 0.5];

pub(crate) struct Problem<'a> {
    pub(crate) data: &'a Observations,
    pub(crate) frame: FlowFrame,
    pub(crate) splines: Splines,
    pub(crate) rows: Vec<Rows>,
    pub(crate) start: Parameters,
}

/// Unknowns: parameters at knots and offsets of lines.
#[derive(Clone)]
pub(crate) struct Unknowns {
    pub(crate) values: DMatrix<f64>,
    pub(crate) offsets: DMatrix<f64>,
}

impl<'a> Problem<'a> {
    /// `frame`: that of another fit, so that parameters are comparable; `None` for the data's own.
    pub(crate) fn new(data: &'a Observations, frame: Option<FlowFrame>) -> Self {
        let mut ratios: Vec<f64> =
            data.lines_rpm.iter().map(|speed| speed / data.nominal_speed_rpm).collect();
        ratios.dedup_by(|b, a| *b < *a * (1.0 + MIN_KNOT_DISTANCE_RATIO));
        let splines = Splines::new(&if ratios.len() <= MAX_KNOTS { ratios } else { select_knots(&ratios) });
        let rows = data.points.iter().map(|p| splines.rows(p.speed_ratio)).collect();
        let frame = frame.unwrap_or_else(|| frame_of(data));
        let mut problem = Problem { data, frame, splines, rows, start: [0.0; PARAMETERS] };
        problem.start = problem.starting_level();
        problem
    }

    fn line_maxima(&self, value: impl Fn(&Observation) -> f64) -> Vec<f64> {
        let mut maxima = vec![f64::MIN; self.data.lines_rpm.len()];
        for point in &self.data.points {
            maxima[point.line] = maxima[point.line].max(value(point));
        }
        maxima
    }

    fn starting_level(&self) -> Parameters {
        let mean = |values: &[f64]| mean(values).unwrap_or(f64::NAN);
        let mut level = [0.0; PARAMETERS];
        level[CHOKE_FLOW] = (START_CHOKE_RATIO * mean(&self.line_maxima(Observation::flow))).ln();
        level[ZERO_SLOPE_HEAD] = mean(&self.line_maxima(Observation::head)).max(SMALL).ln();
        level[ZERO_SLOPE_FLOW] = START_ZERO_SLOPE_FLOW;
        level[CHOKE_HEAD] = START_CHOKE_HEAD;
        EXPONENTS.iter().for_each(|i| level[*i] = START_EXPONENT);
        level
    }

    /// A quadratic work coefficient through all points, and each line's own size.
    pub(crate) fn initial(&self) -> Result<Unknowns, MapFitError> {
        let knots = self.splines.len();
        let mut values = DMatrix::from_fn(PARAMETERS, knots, |q, _| self.start[q]);
        let with_eta: Vec<(f64, f64)> = self
            .data
            .points
            .iter()
            .filter_map(|p| {
                let work = (p.head() / p.eta.filter(|eta| *eta >= MIN_ETA)?).max(SMALL).ln();
                Some(((p.flow() - self.frame.middle_kg_s) / self.frame.half_range_kg_s, work))
            })
            .collect();
        let terms = DMatrix::from_fn(with_eta.len(), 3, |i, j| with_eta[i].0.powi(j as i32));
        let works = DVector::from_iterator(with_eta.len(), with_eta.iter().map(|w| w.1));
        let square = terms.tr_mul(&terms) + DMatrix::identity(3, 3) * RIDGE;
        let work = square.cholesky().ok_or(MapFitError::Singular)?.solve(&terms.tr_mul(&works));
        for j in 0..3 {
            values.row_mut(WORK + j).fill(work[j]);
        }
        let basis = DMatrix::from_fn(self.rows.len(), knots, |i, k| self.rows[i].shape[k]);
        let smoother = basis.tr_mul(&basis)
            + &self.splines.shape.penalty * (START_PENALTY / self.rows.len() as f64)
            + DMatrix::identity(knots, knots) * RIDGE;
        let smoother = smoother.cholesky().ok_or(MapFitError::Singular)?;
        for (parameter, sizes, factor) in [
            (CHOKE_FLOW, self.line_maxima(Observation::flow), START_CHOKE_RATIO),
            (ZERO_SLOPE_HEAD, self.line_maxima(Observation::head), START_HEAD_RATIO),
        ] {
            let logs = DVector::from_iterator(
                self.rows.len(),
                self.data.points.iter().map(|p| (factor * sizes[p.line].max(SMALL)).ln()),
            );
            values.row_mut(parameter).copy_from(&smoother.solve(&basis.tr_mul(&logs)).transpose());
        }
        Ok(Unknowns { values, offsets: DMatrix::zeros(LINE_OFFSETS.len(), self.data.lines_rpm.len()) })
    }

    pub(crate) fn parameters(&self, unknowns: &Unknowns, point: usize) -> Parameters {
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

    pub(crate) fn feet(&self, unknowns: &Unknowns, before: Option<&[Foot]>) -> Vec<Foot> {
        let foot = |(i, p): (usize, &Observation)| {
            let shape = LineShape::new(&self.parameters(unknowns, i), self.frame);
            let guess = before.map(|feet| feet[i].angle_rad);
            nearest(&shape, p.speed_ratio, (p.flow_kg_s, p.pressure_ratio), scales(p), guess)
        };
        self.data.points.iter().enumerate().map(foot).collect()
    }

    pub(crate) fn residuals(&self, feet: &[Foot]) -> Vec<[f64; 2]> {
        let residual =
            |(p, foot): (&Observation, &Foot)| [foot.distance, p.eta.map_or(0.0, |eta| eta - foot.place.eta)];
        self.data.points.iter().zip(feet).map(residual).collect()
    }

    pub(crate) fn weights(&self, residuals: &[[f64; 2]], scale: &[f64; 2]) -> Vec<[f64; 2]> {
        let weight = |(p, r): (&Observation, &[f64; 2])| {
            let variance = [scale[0] * scale[0], scale[1] * scale[1] + p.eta_error * p.eta_error];
            let cauchy = |i: usize| {
                1.0 / (1.0 + r[i] * r[i] / variance[i] / (ROBUST_SIGMAS * ROBUST_SIGMAS)) / variance[i]
            };
            [cauchy(0), if p.eta.is_some() { cauchy(1) } else { 0.0 }]
        };
        self.data.points.iter().zip(residuals).map(weight).collect()
    }

    pub(crate) fn cost(&self, residuals: &[[f64; 2]], weights: &[[f64; 2]]) -> f64 {
        residuals.iter().zip(weights).map(|(r, w)| w[0] * r[0] * r[0] + w[1] * r[1] * r[1]).sum()
    }

    /// Derivatives of the residuals, each row times the root of its weight.
    pub(crate) fn jacobian(&self, unknowns: &Unknowns, feet: &[Foot], weights: &[[f64; 2]]) -> DMatrix<f64> {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut out = DMatrix::zeros(2 * feet.len(), PARAMETERS * knots + LINE_OFFSETS.len() * lines);
        for (i, (p, foot)) in self.data.points.iter().zip(feet).enumerate() {
            let parameters = self.parameters(unknowns, i);
            let (nx, ny) = normal(&foot.slope);
            let length = (foot.slope[0].powi(2) + foot.slope[1].powi(2)).max(MIN_SQUARE_SLOPE);
            let root = weights[i].map(f64::sqrt);
            let shape = LineShape::new(&parameters, self.frame);
            let here = shape.at(foot.angle_rad);
            let work_terms = shape.work_terms(here.flow_at_nominal_kg_s, here.head);
            for q in 0..PARAMETERS {
                let (x, y, eta) = if q >= WORK {
                    // The work parameters affect efficiency only.
                    (0.0, 0.0, -foot.place.eta * work_terms[q - WORK])
                } else {
                    let mut moved = parameters;
                    moved[q] += PARAMETER_STEP;
                    let place = LineShape::new(&moved, self.frame).physical(foot.angle_rad, p.speed_ratio);
                    (
                        (place.flow_kg_s - foot.place.flow_kg_s) / p.flow_scale_kg_s / PARAMETER_STEP,
                        (place.pressure_ratio - foot.place.pressure_ratio) / p.ratio_scale / PARAMETER_STEP,
                        (place.eta - foot.place.eta) / PARAMETER_STEP,
                    )
                };
                // The nearest place moves along the line as the line moves.
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

    pub(crate) fn penalty(
        &self,
        unknowns: &Unknowns,
        precisions: &Precisions,
    ) -> (DMatrix<f64>, DVector<f64>) {
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

    pub(crate) fn penalty_value(&self, unknowns: &Unknowns, precisions: &Precisions) -> f64 {
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

    fn level_precision(&self, parameter: usize) -> f64 {
        1.0 / (LEVEL_SD[parameter].powi(2) * self.splines.len() as f64)
    }

    pub(crate) fn stepped(&self, unknowns: &Unknowns, step: &DVector<f64>) -> Unknowns {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut next = unknowns.clone();
        // At most half a logarithm per step: the linearisation is not valid beyond.
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

    pub(crate) fn rms(&self, residuals: &[[f64; 2]]) -> [f64; 2] {
        let with_eta = self.data.points.iter().filter(|p| p.eta.is_some()).count().max(1);
        let sum = |c: usize| residuals.iter().map(|r| r[c] * r[c]).sum::<f64>();
        [(sum(0) / residuals.len().max(1) as f64).sqrt(), (sum(1) / with_eta as f64).sqrt()]
    }
}

fn frame_of(data: &Observations) -> FlowFrame {
    let flows: Vec<f64> = data.points.iter().map(Observation::flow).collect();
    let (low, high) = (quantile(&flows, 0.0).unwrap_or(0.0), quantile(&flows, 1.0).unwrap_or(1.0));
    let middle_kg_s = median(&flows).unwrap_or(0.5);
    FlowFrame { middle_kg_s, half_range_kg_s: (0.5 * (high - low)).max(MIN_RANGE_RATIO * high) }
}

fn scales(point: &Observation) -> Scales {
    Scales { flow_kg_s: point.flow_scale_kg_s, ratio: point.ratio_scale }
}

/// Selects [`MAX_KNOTS`] of the speeds, spread over their ranks.
fn select_knots(ratios: &[f64]) -> Vec<f64> {
    let last = (ratios.len() - 1) as f64;
    (0..MAX_KNOTS)
        .map(|i| {
            let at = last * i as f64 / (MAX_KNOTS - 1) as f64;
            let below = (at.floor() as usize).min(ratios.len() - 2);
            ratios[below] + (at - below as f64) * (ratios[below + 1] - ratios[below])
        })
        .collect()
}
