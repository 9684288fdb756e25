//! Fits one step, with the lag of the T2 probe.

use crate::IdentifyConfig;
use crate::step_data::samples::{Row, Samples};
use mapper_core::{Bound, InletConvection};
use mapper_numerics::SLOPE_STEP;
use mapper_numerics::least_squares::{DampedFit, minimise};
use mapper_numerics::statistics::rms;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{CompressionInputs, compress, compressed_k};
use mapper_physics::laws::convection::InletLaw;
use mapper_physics::laws::thermocouple;
use mapper_physics::machine::params::Params;
use nalgebra::{Matrix2, Vector2};

/// Distance from a bound, ratio, below which a parameter is on it. Bound: above the tolerance of the fit.
const AT_BOUND_RATIO: f64 = 1e-6;
/// Size of heat-transfer coefficients, W/(m2 K); half of it is a start value. Bound: a size only; the paper has 100 to 1000.
const USUAL_H_W_M2K: f64 = 1e3;
/// Determinant, relative to the diagonal, below which two parameters cannot be distinguished. Bound: rounding of f64.
const SINGULAR_RATIO: f64 = 1e-13;
/// Maximum temperature rise of the start values, ratio to the isentropic one. Bound: an apparent efficiency of a quarter.
const MAX_APPARENT_RISE: f64 = 4.0;

/// Search range of the efficiency, fraction. Above 1 is impossible and is reported; the fit may go there to show it. Bound: above 1 is
/// impossible and is reported; the fit may go there to show it.
pub(crate) const ETA_BOUNDS: (f64, f64) = (0.05, 2.0);
/// Search range of the heat-transfer coefficient, W/(m2 K). Bound: boiling water reaches 1e5, gas never.
pub(crate) const H_BOUNDS_W_M2K: (f64, f64) = (0.0, 1e5);

/// Parameters of eqs. 1-3 in addition to the samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    pub(crate) alpha_area_ratio: f64,
    pub(crate) internal_area_m2: f64,
    /// The law of h before the wheel, if it differs from h.
    pub(crate) inlet: Option<InletLaw>,
    pub(crate) probe: Probe,
    pub(crate) air: Air,
}

impl Geometry {
    /// As declared. The exponent of the inlet's law is that of Appendix A: a single step does not determine one.
    pub(crate) fn of(config: &IdentifyConfig) -> Self {
        let own = InletLaw {
            exponent: Params::default().compressor.nusselt_exponent,
            inlet_diameter_m: config.inlet_diameter_m,
            outlet_diameter_m: config.outlet_diameter_m,
        };
        Geometry {
            alpha_area_ratio: config.alpha_area_ratio,
            internal_area_m2: config.internal_area_m2,
            inlet: (config.inlet_convection == InletConvection::Own).then_some(own),
            probe: Probe { diameter_m: config.probe_diameter_m, pipe_diameter_m: config.outlet_diameter_m },
            air: config.air,
        }
    }

    /// Ratio of h before the wheel to h after it.
    fn inlet_h_ratio(&self, row: &Row, eta: f64) -> f64 {
        let bulk_k = || compressed_k(row.t1_k, row.rise_ratio, eta, self.air.between(row.p1_pa, row.p2_pa));
        self.inlet.map_or(1.0, |law| law.h_ratio(row.t1_k, bulk_k()))
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) eta: f64,
    pub(crate) h_w_m2k: f64,
    /// Measured minus fitted T2, K.
    pub(crate) residual_k: Vec<f64>,
    /// Derivatives of the probe's reading by eta (K) and by h (K m2 K/W), after projecting out its first reading.
    pub(crate) jacobian: [Vec<f64>; 2],
    /// Derivative of the gas's own T2 by h, K m2 K/W.
    pub(crate) gas_by_h: Vec<f64>,
    /// Response of the probe to the gas; `None` without inertia.
    pub(crate) probe_response: Option<ProbeResponse>,
    /// `(J'J)^-1`.
    pub(crate) inverse_normal: Matrix2<f64>,
}

impl Fit {
    /// The probe's response to a change of the gas's T2.
    pub(crate) fn read(&self, gas_change_k: Vec<f64>) -> Vec<f64> {
        match &self.probe_response {
            Some(probe_response) => probe_response.read(&gas_change_k),
            None => gas_change_k,
        }
    }

    /// Parameter change due to a change of the reading: `(J'J)^-1 J' y`.
    pub(crate) fn response(&self, t2_change_k: &[f64]) -> [f64; 2] {
        (self.inverse_normal * right(&self.jacobian, t2_change_k)).into()
    }

    pub(crate) fn residual_rms_k(&self) -> f64 {
        rms(&self.residual_k).unwrap_or(0.0)
    }

    /// Name of a parameter on its bound, if any.
    pub(crate) fn at_bound(&self) -> Option<Bound> {
        let near = |value: f64, bound: f64, size: f64| (value - bound).abs() < AT_BOUND_RATIO * size;
        if near(self.eta, ETA_BOUNDS.0, 1.0) || near(self.eta, ETA_BOUNDS.1, 1.0) {
            return Some(Bound::Eta { eta: self.eta });
        }
        if near(self.h_w_m2k, H_BOUNDS_W_M2K.0, USUAL_H_W_M2K)
            || near(self.h_w_m2k, H_BOUNDS_W_M2K.1, H_BOUNDS_W_M2K.1)
        {
            return Some(Bound::H { h_w_m2k: self.h_w_m2k });
        }
        None
    }
}

/// T2 by eqs. 1-3 for one row, K.
#[inline]
pub(crate) fn t2_k(geometry: Geometry, row: &Row, eta: f64, h_w_m2k: f64) -> f64 {
    let inputs = CompressionInputs {
        t1_k: row.t1_k,
        tc_k: row.tc_k,
        flow_kg_s: row.flow_kg_s,
        isentropic_rise_ratio: row.rise_ratio,
        efficiency: eta,
        h_w_m2k,
        inlet_h_ratio: geometry.inlet_h_ratio(row, eta),
        alpha_area_ratio: geometry.alpha_area_ratio,
        internal_area_m2: geometry.internal_area_m2,
        air: geometry.air.between(row.p1_pa, row.p2_pa),
    };
    compress(&inputs, None).t2_k
}

/// Measured minus predicted T2, K, without the part that the probe's first reading explains.
fn residual_k(
    samples: &Samples,
    geometry: Geometry,
    probe_response: Option<&ProbeResponse>,
    [eta, h_w_m2k]: [f64; 2],
) -> Vec<f64> {
    let gas_k: Vec<f64> = samples.rows.iter().map(|row| t2_k(geometry, row, eta, h_w_m2k)).collect();
    let read_k = probe_response.map_or_else(|| gas_k.clone(), |probe_response| probe_response.read(&gas_k));
    let mut residual_k: Vec<f64> = samples.rows.iter().zip(&read_k).map(|(row, b)| row.t2_k - b).collect();
    if let Some(probe_response) = probe_response {
        probe_response.without_first_reading(&mut residual_k);
    }
    residual_k
}

/// The least-squares fit within the bounds; `None` if it does not converge (or for fewer than 3 samples).
pub(crate) fn fit(samples: &Samples, geometry: Geometry) -> Option<Fit> {
    if samples.len() < 3 {
        return None;
    }
    let probe_response = ProbeResponse::of(samples, geometry.probe);
    let at = start(samples, geometry);
    let residual = residual_k(samples, geometry, probe_response.as_ref(), at);
    let fit = linearised(samples, geometry, probe_response, at, residual)?;
    let mut descent = Descent { samples, geometry, fit };
    minimise(&mut descent, 0.0)?;
    Some(descent.fit)
}

/// A fit on its way to the minimum, with its derivatives.
struct Descent<'a> {
    samples: &'a Samples,
    geometry: Geometry,
    fit: Fit,
}

impl DampedFit for Descent<'_> {
    type Equations = (Matrix2<f64>, Vector2<f64>);
    /// Both parameters with the residual, K.
    type Place = ([f64; 2], Vec<f64>);

    fn linearise(&self) -> Option<(f64, Self::Equations)> {
        let Fit { jacobian, residual_k, .. } = &self.fit;
        Some((square(residual_k), (products(jacobian, jacobian), right(jacobian, residual_k))))
    }

    fn step(&self, (normal, right): &Self::Equations, cost: f64, damping: f64) -> Option<(Self::Place, f64)> {
        let Descent { samples, geometry, fit } = self;
        let damped = normal + Matrix2::from_diagonal(&(damping * normal.diagonal()));
        let step = inverted(damped)? * right;
        let to = [
            (fit.eta + step[0]).clamp(ETA_BOUNDS.0, ETA_BOUNDS.1),
            (fit.h_w_m2k + step[1]).clamp(H_BOUNDS_W_M2K.0, H_BOUNDS_W_M2K.1),
        ];
        let there = residual_k(samples, *geometry, fit.probe_response.as_ref(), to);
        let next = square(&there);
        (next < cost).then_some(((to, there), next))
    }

    fn move_to(&mut self, (to, residual_k): Self::Place) -> Option<()> {
        self.fit = linearised(self.samples, self.geometry, self.fit.probe_response.clone(), to, residual_k)?;
        Some(())
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn square(column: &[f64]) -> f64 {
    dot(column, column)
}

/// Scalar products of each column of `a` with each of `b`.
pub(crate) fn products(a: &[Vec<f64>; 2], b: &[Vec<f64>; 2]) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| dot(&a[i], &b[j]))
}

fn right(jacobian: &[Vec<f64>; 2], column: &[f64]) -> Vector2<f64> {
    Vector2::from_fn(|i, _| dot(&jacobian[i], column))
}

/// A fit with its derivatives at given parameters; `None` if they are singular or not finite.
fn linearised(
    samples: &Samples,
    geometry: Geometry,
    probe_response: Option<ProbeResponse>,
    [eta, h_w_m2k]: [f64; 2],
    residual_k: Vec<f64>,
) -> Option<Fit> {
    let step_eta = SLOPE_STEP * eta;
    // A relative step needs an h above 0.
    let step_h = SLOPE_STEP * h_w_m2k.max(1.0);
    let mut jacobian = [Vec::with_capacity(samples.len()), Vec::with_capacity(samples.len())];
    for row in &samples.rows {
        let by_eta = (t2_k(geometry, row, eta + step_eta, h_w_m2k)
            - t2_k(geometry, row, eta - step_eta, h_w_m2k))
            / (2.0 * step_eta);
        let by_h = (t2_k(geometry, row, eta, h_w_m2k + step_h) - t2_k(geometry, row, eta, h_w_m2k - step_h))
            / (2.0 * step_h);
        jacobian[0].push(by_eta);
        jacobian[1].push(by_h);
    }
    let gas_by_h = jacobian[1].clone();
    if let Some(probe_response) = &probe_response {
        for column in &mut jacobian {
            *column = probe_response.read(column);
            probe_response.without_first_reading(column);
        }
    }
    let inverse_normal = inverted(products(&jacobian, &jacobian))?;
    Some(Fit { eta, h_w_m2k, residual_k, jacobian, gas_by_h, probe_response, inverse_normal })
}

/// Inverse of a symmetric positive definite matrix; `None` if it is numerically singular.
fn inverted(m: Matrix2<f64>) -> Option<Matrix2<f64>> {
    let determinant = m.determinant();
    (determinant.is_finite() && determinant > SINGULAR_RATIO * m[(0, 0)] * m[(1, 1)])
        .then(|| m.try_inverse())?
}

/// Start values: with the measured T2 in the heat terms, eqs. 1-3 are linear in 1/eta and h except for one product, which takes 1/eta from the
/// temperature rise.
fn start(samples: &Samples, geometry: Geometry) -> [f64; 2] {
    let (mut rise_k, mut isentropic_k) = (0.0, 0.0);
    for row in &samples.rows {
        rise_k += row.t2_k - row.t1_k;
        isentropic_k += row.t1_k * row.rise_ratio;
    }
    let apparent = (rise_k / isentropic_k).clamp(1.0, MAX_APPARENT_RISE);
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for row in &samples.rows {
        let t2_k = row.t2_k;
        let before = geometry.inlet_h_ratio(row, 1.0 / apparent)
            * geometry.alpha_area_ratio
            * geometry.internal_area_m2
            / (row.flow_kg_s * geometry.air.heat_capacity_j_kgk(row.t1_k));
        let after = (1.0 - geometry.alpha_area_ratio) * geometry.internal_area_m2
            / (row.flow_kg_s * geometry.air.heat_capacity_j_kgk(t2_k));
        let columns = Vector2::new(
            row.t1_k * row.rise_ratio,
            before * (row.tc_k - row.t1_k) * (1.0 + row.rise_ratio * apparent) + after * (row.tc_k - t2_k),
        );
        right += columns * (t2_k - row.t1_k);
        normal += columns * columns.transpose();
    }
    let inside = |value: f64, (low, high): (f64, f64), fallback: f64| {
        if value.is_finite() && value > low && value < high { value } else { fallback }
    };
    let found: Option<[f64; 2]> = inverted(normal).map(|g| (g * right).into());
    let [inverse_eta, h_w_m2k] = found.unwrap_or([apparent, f64::NAN]);
    [
        inside(1.0 / inverse_eta, ETA_BOUNDS, (1.0 / apparent).clamp(1.0 / MAX_APPARENT_RISE, 1.0)),
        inside(h_w_m2k, H_BOUNDS_W_M2K, 0.5 * USUAL_H_W_M2K),
    ]
}

// The reading of a probe that lags the gas, along the rows of a step (eqs. 11-12).
// At the start of a window the probe's reading depends on the seconds before it. That first reading enters linearly and fades with the
// probe's time constant. For a fit of one step it is a nuisance parameter, so it is projected out of residual and derivatives (variable
// projection: Golub and Pereyra, SIAM J. Numer. Anal. 10:413, 1973). The remaining fit has as many parameters as without a probe.

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
