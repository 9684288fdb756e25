//! The speed lines of a fit: the shape of one line, and splines over speed.

use mapper_core::FittedLine;
use mapper_physics::compressor_map::closed_form_map::pressure_ratio_of_signed_head;
use nalgebra::{DMatrix, DVector};

// One speed line in similarity coordinates: flow over speed, isentropic head over its square.
// Ellipse family of O. Leufven and L. Eriksson ("A surge and choke capable compressor flow model", Control
// Engineering Practice 21 (2013) 1871-1883; LiU CPgui): a zero-slope point, a choke point and two exponents,
// `((flow - flow_zs)/(flow_ch - flow_zs))^n + ((head - head_ch)/(head_zs - head_ch))^k = 1`. The angle around
// the ellipse's centre parametrises it, so that the flat part at surge, the vertical part at choke and the surge side of the zero-slope
// point are one smooth curve. The radius has a small harmonic correction.
// Efficiency is isentropic head over actual work. The logarithm of the work coefficient (Euler work minus slip, plus
// friction and recirculation) is a cubic of the flow coefficient with two terms for the drop towards choke; it
// changes little with speed, so efficiency can be extrapolated over speed.

/// Range of ln of an exponent minus its minimum. Bound: from corners to nearly a rectangle; beyond, the line does not change visibly.
const EXPONENT_LN: (f64, f64) = (-4.0, 2.2);
/// Range of ln of the work coefficient. Bound: keeps it finite while a fit searches.
const WORK_LN: (f64, f64) = (-8.0, 5.0);
/// Largest flow coordinate of the work coefficient, in halves of the range. Bound: a cubic must not run away beyond the points.
const MAX_FLOW_COORDINATE: f64 = 1.6;
/// Start of Newton's steps. Bound: a start value.
const START_RADIUS_LN: f64 = 0.15;
/// Precision of an angle or of ln of the radius; Newton's error after a step is about its square. Bound: far below any error of a point.
const ANGLE_PRECISION_RAD: f64 = 1e-7;

/// Terms of the radius' correction. Bound: more would follow the scatter of points.
const HARMONICS: usize = 2;
/// Terms of the work coefficient. Bound: more would follow the scatter of points.
const WORK_TERMS: usize = 6;
/// Parameters of a line. Source: choke flow, head and flow at zero slope, choke head, two exponents, and the terms.
pub(crate) const PARAMETERS: usize = 6 + HARMONICS + WORK_TERMS;

pub(crate) type Index = usize;
/// Parameter: logarithm of the choke flow.
pub(crate) const CHOKE_FLOW: Index = 0;
/// Parameter: logarithm of the head at zero slope.
pub(crate) const ZERO_SLOPE_HEAD: Index = 1;
/// Parameter: logit of the zero-slope flow over the choke flow.
pub(crate) const ZERO_SLOPE_FLOW: Index = 2;
/// Parameter: head at choke over head at zero slope, softly limited.
pub(crate) const CHOKE_HEAD: Index = 3;
/// Parameters: logarithms of the exponents minus [`MIN_EXPONENT`].
pub(crate) const EXPONENTS: [Index; 2] = [4, 5];
/// First parameter of the correction.
const HARMONIC: Index = 6;
/// First parameter of the work coefficient.
pub(crate) const WORK: Index = 6 + HARMONICS;

/// Parameters of a line, see the constants.
pub(crate) type Parameters = [f64; PARAMETERS];

/// Minimum exponent. Bound: at 1 the line would have corners.
const MIN_EXPONENT: f64 = 1.05;
/// Maximum absolute choke head over the head at zero slope. Bound: measured lines end above it.
const MAX_CHOKE_HEAD_RATIO: f64 = 0.7;
/// Minimum angle, rad. Bound: low enough for a pressure ratio below 1 on every line ([`MAX_CHOKE_HEAD_RATIO`]).
pub(crate) const MIN_ANGLE_RAD: f64 = -3.0;
/// Range of the angle for the nearest place, rad. Bound: 0 is choke, pi/2 zero slope; below 0 the line is vertical, and no point lies far
/// beyond surge.
pub(crate) const ANGLE_RANGE_RAD: (f64, f64) = (-0.6, 0.8 * std::f64::consts::PI);

/// Location and scale of the flow coefficients, so that the terms of the work coefficient are of order 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FlowFrame {
    /// Centre of the measured flows over the speed ratio, kg/s.
    pub middle_kg_s: f64,
    /// Half their range, kg/s.
    pub half_range_kg_s: f64,
}

/// A place on a line in similarity coordinates; the speed ratio is the speed over the fit's nominal one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Flow over the speed ratio, kg/s.
    pub flow_at_nominal_kg_s: f64,
    /// Isentropic head over the speed ratio's square; see `mapper_physics::compressor_map::characteristic`.
    pub head: f64,
    /// Work in the units of `head`.
    pub work: f64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct PhysicalPlace {
    pub flow_kg_s: f64,
    pub pressure_ratio: f64,
    pub eta: f64,
}

/// A line as a curve over the angle.
#[derive(Debug, Clone)]
pub(crate) struct LineShape {
    choke_flow: f64,
    zero_slope_flow: f64,
    choke_head: f64,
    zero_slope_head: f64,
    exponents: [f64; 2],
    harmonics: [f64; HARMONICS],
    work: [f64; WORK_TERMS],
    frame: FlowFrame,
}

impl LineShape {
    pub(crate) fn new(p: &Parameters, frame: FlowFrame) -> Self {
        let choke_flow = p[CHOKE_FLOW].exp();
        let zero_slope_head = p[ZERO_SLOPE_HEAD].exp();
        let mut harmonics = [0.0; HARMONICS];
        harmonics.copy_from_slice(&p[HARMONIC..WORK]);
        let mut work = [0.0; WORK_TERMS];
        work.copy_from_slice(&p[WORK..]);
        LineShape {
            choke_flow,
            zero_slope_flow: choke_flow / (1.0 + (-p[ZERO_SLOPE_FLOW]).exp()),
            choke_head: zero_slope_head
                * MAX_CHOKE_HEAD_RATIO
                * (p[CHOKE_HEAD] / MAX_CHOKE_HEAD_RATIO).tanh(),
            zero_slope_head,
            exponents: EXPONENTS.map(|i| MIN_EXPONENT + p[i].clamp(EXPONENT_LN.0, EXPONENT_LN.1).exp()),
            harmonics,
            work,
            frame,
        }
    }

    /// The place at an angle, rad.
    pub(crate) fn at(&self, angle_rad: f64) -> Place {
        let (x, y) = if angle_rad <= 0.0 {
            // Choked: the flow is constant while the head falls.
            (1.0, angle_rad)
        } else {
            let (sin, cos) = angle_rad.sin_cos();
            let r = self.radius(angle_rad, cos.abs(), sin.abs());
            (r * cos, r * sin)
        };
        let flow = self.zero_slope_flow + (self.choke_flow - self.zero_slope_flow) * x;
        let head = self.choke_head + (self.zero_slope_head - self.choke_head) * y;
        let log_work: f64 =
            self.work_terms(flow, head).iter().zip(&self.work).map(|(term, c)| term * c).sum();
        Place { flow_at_nominal_kg_s: flow, head, work: log_work.clamp(WORK_LN.0, WORK_LN.1).exp() }
    }

    /// Derivatives of the logarithm of the work coefficient by its parameters, at a place of the line.
    pub(crate) fn work_terms(&self, flow: f64, head: f64) -> [f64; WORK_TERMS] {
        let z = ((flow - self.frame.middle_kg_s) / self.frame.half_range_kg_s)
            .clamp(-MAX_FLOW_COORDINATE, MAX_FLOW_COORDINATE);
        let y = (head - self.choke_head) / (self.zero_slope_head - self.choke_head);
        let drop = (1.0 - y).clamp(0.0, 1.0);
        [1.0, z, z * z, drop, drop * drop, z * z * z]
    }

    /// Distance of the curve from the ellipse's centre, in units of its half axes.
    fn radius(&self, angle_rad: f64, cos: f64, sin: f64) -> f64 {
        let [n, k] = self.exponents;
        let (log_cos, log_sin) = (cos.max(f64::MIN_POSITIVE).ln(), sin.max(f64::MIN_POSITIVE).ln());
        // The ellipse's equation as ln((r cos)^n + (r sin)^k) = 0 in ln r: convex, nearly straight, of slope between n
        // and k, so that Newton's steps need no guard and few rounds.
        let mut log_r = -log_cos.max(log_sin) - START_RADIUS_LN;
        for _ in 0..20 {
            let (a, b) = ((n * (log_r + log_cos)).exp(), (k * (log_r + log_sin)).exp());
            let sum = a + b;
            let step = sum.ln() * sum / (n * a + k * b);
            log_r -= step;
            // The error after a step is about the square of the step.
            if step.abs() < ANGLE_PRECISION_RAD {
                break;
            }
        }
        let r = log_r.exp();
        // The correction and its slope are zero at choke, so that the line stays vertical there.
        let correction: f64 = sin
            * sin
            * self
                .harmonics
                .iter()
                .enumerate()
                .map(|(j, c)| c * (2.0 * (j as f64 + 1.0) * angle_rad).sin())
                .sum::<f64>();
        r * (1.0 + correction.clamp(-0.5, 0.5))
    }

    /// The place at a speed over the fit's nominal speed.
    pub(crate) fn physical(&self, angle_rad: f64, speed_ratio: f64) -> PhysicalPlace {
        let place = self.at(angle_rad);
        PhysicalPlace {
            flow_kg_s: place.flow_at_nominal_kg_s * speed_ratio,
            pressure_ratio: pressure_ratio_of_signed_head(place.head * speed_ratio * speed_ratio),
            eta: place.head / place.work,
        }
    }
}

/// Number of pairs of neighbouring lines with intersecting segments.
pub(crate) fn count_crossings(lines: &[FittedLine]) -> usize {
    lines.windows(2).filter(|pair| lines_cross(&pair[0], &pair[1])).count()
}

fn lines_cross(a: &FittedLine, b: &FittedLine) -> bool {
    let points = |line: &FittedLine| -> Vec<(f64, f64)> {
        line.nodes.iter().map(|n| (n.flow_corrected_kg_s, n.pressure_ratio)).collect()
    };
    let (a, b) = (points(a), points(b));
    a.windows(2).any(|s| b.windows(2).any(|t| segments_meet(s[0], s[1], t[0], t[1])))
}

fn segments_meet(a: (f64, f64), b: (f64, f64), c: (f64, f64), d: (f64, f64)) -> bool {
    let side =
        |p: (f64, f64), q: (f64, f64), r: (f64, f64)| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

/// Minimum square of a slope by angle. Bound: excludes division by zero at corners.
pub(crate) const MIN_SQUARE_SLOPE: f64 = 1e-12;
/// Shortest step that is tried, rad. Bound: a tenth of the precision.
const MIN_STEP_RAD: f64 = 1e-8;

/// Units of distance of a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scales {
    pub flow_kg_s: f64,
    pub ratio: f64,
}

/// Nearest place to a point (foot of the perpendicular), with the line's direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot {
    pub angle_rad: f64,
    pub place: PhysicalPlace,
    /// Derivatives by angle of scaled flow, scaled pressure ratio, efficiency.
    pub slope: [f64; 3],
    /// Distance with sign, in scales: positive outside the line.
    pub distance: f64,
}

/// Maximum step along the line, rad. Bound: the direction of a line changes little over it.
const MAX_STEP_RAD: f64 = 0.12;
/// Half step of the difference quotients by angle, rad. Bound: between rounding and curvature.
pub(crate) const DIFFERENCE_STEP_RAD: f64 = 1e-5;

/// Finds the nearest place, from `guess_rad` if it is given, else on the whole line.
pub(crate) fn nearest(
    shape: &LineShape,
    speed_ratio: f64,
    (flow_kg_s, pressure_ratio): (f64, f64),
    scales: Scales,
    guess_rad: Option<f64>,
) -> Foot {
    let at = |angle: f64| {
        let place = shape.physical(angle, speed_ratio);
        let offset = (
            (flow_kg_s - place.flow_kg_s) / scales.flow_kg_s,
            (pressure_ratio - place.pressure_ratio) / scales.ratio,
        );
        Trial { place, offset, square: offset.0 * offset.0 + offset.1 * offset.1 }
    };
    let (start, low, high) = match guess_rad {
        Some(guess) => (guess, guess - MAX_STEP_RAD, guess + MAX_STEP_RAD),
        None => search_grid(&|angle| at(angle).square),
    };
    // Gauss-Newton in one variable; a step that does not reduce the distance is halved.
    let mut best = at(start);
    let mut foot = foot_at(shape, speed_ratio, start, &best, scales);
    for _ in 0..8 {
        let (x, y) = best.offset;
        let [sx, sy, _] = foot.slope;
        let length = sx * sx + sy * sy;
        if length.is_nan() || length <= MIN_SQUARE_SLOPE {
            break;
        }
        let mut step = (foot.angle_rad + (x * sx + y * sy) / length).clamp(low, high) - foot.angle_rad;
        let mut trial = at(foot.angle_rad + step);
        while trial.square >= best.square && step.abs() > MIN_STEP_RAD {
            step *= 0.5;
            trial = at(foot.angle_rad + step);
        }
        if trial.square >= best.square {
            break;
        }
        best = trial;
        foot = foot_at(shape, speed_ratio, foot.angle_rad + step, &best, scales);
        if step.abs() < ANGLE_PRECISION_RAD {
            break;
        }
    }
    foot
}

/// A place on the line, with the point's offset from it in scales and the square of their distance.
struct Trial {
    place: PhysicalPlace,
    offset: (f64, f64),
    square: f64,
}

/// The best angle of ever finer grids over the whole line, with its neighbours on the last grid.
fn search_grid(squared: &impl Fn(f64) -> f64) -> (f64, f64, f64) {
    let (mut low, mut high) = ANGLE_RANGE_RAD;
    let mut best = low;
    // The first grid distinguishes the flat from the steep part.
    for mesh in [48, 10] {
        let step = (high - low) / f64::from(mesh);
        let mut min = f64::INFINITY;
        for i in 0..=mesh {
            let angle = low + step * f64::from(i);
            let value = squared(angle);
            if value < min {
                (min, best) = (value, angle);
            }
        }
        (low, high) = (best - step, best + step);
    }
    (best, low, high)
}

fn foot_at(
    shape: &LineShape,
    speed_ratio: f64,
    angle_rad: f64,
    &Trial { place, offset: (x, y), .. }: &Trial,
    scales: Scales,
) -> Foot {
    let (before, after) = (
        shape.physical(angle_rad - DIFFERENCE_STEP_RAD, speed_ratio),
        shape.physical(angle_rad + DIFFERENCE_STEP_RAD, speed_ratio),
    );
    let slope = [
        (after.flow_kg_s - before.flow_kg_s) / scales.flow_kg_s / (2.0 * DIFFERENCE_STEP_RAD),
        (after.pressure_ratio - before.pressure_ratio) / scales.ratio / (2.0 * DIFFERENCE_STEP_RAD),
        (after.eta - before.eta) / (2.0 * DIFFERENCE_STEP_RAD),
    ];
    let (nx, ny) = normal(&slope);
    Foot { angle_rad, place, slope, distance: x * nx + y * ny }
}

/// Unit vector across the line, outwards (towards more flow and pressure ratio).
pub(crate) fn normal(slope: &[f64; 3]) -> (f64, f64) {
    let length = slope[0].hypot(slope[1]).max(f64::MIN_POSITIVE);
    (slope[1] / length, -slope[0] / length)
}

// A natural cubic spline over a coordinate of speed, with a roughness penalty.
// Source: P. J. Green, B. W. Silverman, Nonparametric Regression and Generalized Linear Models (1994), ch. 2: values
// at the knots as parameters, `g'' = R^-1 Q' g`, integral of `g''^2` equal to `g' K g` with `K = Q R^-1 Q'`.

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

#[derive(Debug, Clone)]
pub(crate) struct SpeedSpline {
    coordinate: Coordinate,
    knots: Vec<f64>,
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
        /// Flow never falls and head never rises on the way from zero slope to choke, whatever the exponents.
        #[test]
        fn the_line_falls_from_zero_slope_to_choke(
            ratio in -2.0..2.0f64, choke in -0.6..0.5f64, n in -1.5..1.5f64, k in -1.5..1.5f64,
        ) {
            let mut p = [0.0; PARAMETERS];
            (p[ZERO_SLOPE_FLOW], p[CHOKE_HEAD], p[EXPONENTS[0]], p[EXPONENTS[1]]) = (ratio, choke, n, k);
            let shape = LineShape::new(&p, FlowFrame { middle_kg_s: 0.5, half_range_kg_s: 0.5 });
            let walk: Vec<Place> = (0..=40).map(|i| shape.at(f64::from(i) / 40.0 * std::f64::consts::FRAC_PI_2)).collect();
            for pair in walk.windows(2) {
                prop_assert!(pair[1].flow_at_nominal_kg_s <= pair[0].flow_at_nominal_kg_s + 1e-9 && pair[1].head >= pair[0].head - 1e-9);
            }
            // The ellipse's equation itself.
            for place in &walk {
                let x = (place.flow_at_nominal_kg_s - shape.zero_slope_flow) / (shape.choke_flow - shape.zero_slope_flow);
                let y = (place.head - shape.choke_head) / (shape.zero_slope_head - shape.choke_head);
                prop_assert!((x.abs().powf(shape.exponents[0]) + y.abs().powf(shape.exponents[1]) - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_cross_is_a_cross_and_neighbours_are_none() {
        assert!(segments_meet((0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)));
        assert!(!segments_meet((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)));
        assert!(!segments_meet((0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 3.5)));
    }
}

#[cfg(test)]
mod speed_spline_tests {
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
