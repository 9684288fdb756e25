//! Rodas5P: a stiffly accurate Rosenbrock method of order 5 with dense output of order 4.
//!
//! Source: G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the
//! Julia Differential Equations package", BIT Numerical Mathematics 63:27 (2023). A one-step method, because a rig's
//! inputs have kinks and a multistep method restarts at each; docs/decisions compares it with libraries.

use nalgebra::{Const, DimMin, SMatrix, SVector};

/// Stages of a step.
pub const STAGES: usize = 8;
/// Diagonal of the stages' matrix.
pub const GAMMA: f64 = 0.211_937_563_194_290_14;

/// Weights of the previous stages in a stage's state.
#[rustfmt::skip]
pub const A: [[f64; 7]; STAGES] = [
    [0.0; 7],
    [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [2.849394379747939, 0.45842242204463923, 0.0, 0.0, 0.0, 0.0, 0.0],
    [-6.954028509809101, 2.489845061869568, -10.358996098473584, 0.0, 0.0, 0.0, 0.0],
    [2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641, 0.0, 0.0, 0.0],
    [-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 0.0, 0.0],
    [-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 0.0],
    [-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 1.0],
];

/// Weights of the previous stages in a stage's right-hand side.
#[rustfmt::skip]
pub const C: [[f64; 7]; STAGES] = [
    [0.0; 7],
    [-14.155112264123755, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [-17.97296035885952, -2.859693295451294, 0.0, 0.0, 0.0, 0.0, 0.0],
    [147.12150275711716, -1.41221402718213, 71.68940251302358, 0.0, 0.0, 0.0, 0.0],
    [165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306, 0.0, 0.0, 0.0],
    [24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471, 0.0, 0.0],
    [30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623, -28.087943162872662, 0.0],
    [37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002, -54.66780262877968, -9.48861652309627],
];

/// Places of the stages within the step.
#[rustfmt::skip]
pub const STAGE_TIME: [f64; STAGES] = [
    0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0,
];

/// Weights of df/dt.
#[rustfmt::skip]
pub const TIME_DERIVATIVE: [f64; STAGES] = [
    0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0, 0.0,
];

/// Weights of the stages in the dense output.
#[rustfmt::skip]
pub const DENSE: [[f64; STAGES]; 3] = [
    [25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073, 1.1241088310450404, 0.4272876194431874, -0.17202221070155493],
    [-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372],
    [11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722],
];

/// A system of `N` ordinary differential equations.
pub trait OdeSystem<const N: usize> {
    /// Rates at `t_s`. Non-finite rates make the integrator retry the step with a smaller one.
    fn rates(&mut self, t_s: f64, y: &[f64; N]) -> [f64; N];

    /// Whether the rates depend on time between kinks.
    fn depends_on_time(&self) -> bool {
        true
    }

    /// df/dt at fixed `y`; `None` if the system does not depend on time. It is a forward difference, because there may be a kink at the
    /// start. Inputs are linear or exponential over much longer times.
    fn time_derivative(&mut self, t_s: f64, y: &[f64; N], rates: &[f64; N]) -> Option<[f64; N]> {
        if !self.depends_on_time() {
            return None;
        }
        let ahead_s = 1e-6;
        let rates_ahead = self.rates(t_s + ahead_s, y);
        Some(std::array::from_fn(|i| (rates_ahead[i] - rates[i]) / ahead_s))
    }
}

/// Local error allowed per step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances<const N: usize> {
    /// Relative to the state.
    pub relative_ratio: f64,
    /// Absolute, in the state's own units.
    pub absolute: [f64; N],
}

/// An accepted step with its dense output.
#[derive(Debug, Clone, Copy)]
pub struct Step<const N: usize> {
    /// Start, s.
    pub t0_s: f64,
    /// End, s.
    pub t1_s: f64,
    /// State at the start.
    pub y0: [f64; N],
    /// State at the end.
    pub y1: [f64; N],
    dense: [[f64; N]; 3],
}

impl<const N: usize> Step<N> {
    /// State within the step by the method's own interpolant (order 4).
    #[inline]
    pub fn at(&self, t_s: f64) -> [f64; N] {
        let theta = (t_s - self.t0_s) / (self.t1_s - self.t0_s);
        let rest = 1.0 - theta;
        std::array::from_fn(|i| {
            let curve = self.dense[0][i] + theta * (self.dense[1][i] + theta * self.dense[2][i]);
            rest * self.y0[i] + theta * (self.y1[i] + rest * curve)
        })
    }
}

/// Reason why an integration could not continue.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum IntegrationError {
    #[error(
        "the integration needs steps below {step_s:.1e} s at {t_s:.6} s; the inputs or parameters there are beyond the model"
    )]
    StepTooSmall { t_s: f64, step_s: f64 },
    #[error(
        "the integration took more than {steps} steps and is at {t_s:.6} s; loosen the tolerance or shorten the run"
    )]
    TooManySteps { t_s: f64, steps: usize },
}

/// The step-size control and the state that is carried from step to step.
#[derive(Debug, Clone)]
pub struct Integrator<const N: usize> {
    /// Current time, s.
    pub t_s: f64,
    /// Current state.
    pub y: [f64; N],
    tolerances: Tolerances<N>,
    next_step_s: f64,
    steps: usize,
}

/// Maximum number of steps of one integrator; far above the needs of any campaign.
const MAX_STEPS: usize = 50_000_000;

impl<const N: usize> Integrator<N>
where
    // Required by nalgebra's LU; true of every N.
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    /// Starts at `t_s` with `y`.
    pub fn new(t_s: f64, y: [f64; N], tolerances: Tolerances<N>) -> Self {
        Integrator { t_s, y, tolerances, next_step_s: 0.0, steps: 0 }
    }

    /// Forgets the step size: call this after a jump of the inputs.
    pub fn restart(&mut self) {
        self.next_step_s = 0.0;
    }

    /// Steps taken so far.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Takes one step, at most to `end_s` (> `t_s`).
    pub fn step(&mut self, system: &mut impl OdeSystem<N>, end_s: f64) -> Result<Step<N>, IntegrationError> {
        self.steps += 1;
        if self.steps > MAX_STEPS {
            return Err(IntegrationError::TooManySteps { t_s: self.t_s, steps: MAX_STEPS });
        }
        let (t0_s, y0) = (self.t_s, self.y);
        let f0 = system.rates(t0_s, &y0);
        let jacobian = self.jacobian(system, t0_s, &y0, &f0);
        let time_derivative = system.time_derivative(t0_s, &y0, &f0);
        let remaining_s = end_s - t0_s;
        let mut h = if self.next_step_s > 0.0 { self.next_step_s } else { self.first_step_s(&y0, &f0) };
        let mut rejected = false;
        loop {
            // Two equal steps instead of a long and a tiny one.
            let ends_here = h >= remaining_s * (1.0 - 1e-9);
            let step_s = if ends_here {
                remaining_s
            } else if h > 0.5 * remaining_s {
                0.5 * remaining_s
            } else {
                h
            };
            if step_s <= 1e-14 * t0_s.abs().max(1.0) && !ends_here {
                return Err(IntegrationError::StepTooSmall { t_s: t0_s, step_s });
            }
            let stages = self.stages(system, &jacobian, &f0, time_derivative.as_ref(), step_s);
            let error = stages.as_ref().map_or(f64::INFINITY, |stages| self.error_norm(&y0, stages));
            if let (Some(stages), true) = (stages, error <= 1.0) {
                // The error estimate is of order 4, so the local error goes with the fifth power of the step.
                let factor = (0.9 * error.max(1e-10).powf(-0.2)).clamp(0.2, 6.0);
                let proposed_s = step_s * if rejected { factor.min(1.0) } else { factor };
                // A step limited by `end_s` shows little about the largest possible step.
                self.next_step_s = if step_s < h { proposed_s.max(h) } else { proposed_s };
                let t1_s = if ends_here { end_s } else { t0_s + step_s };
                self.t_s = t1_s;
                self.y = stages.y1;
                return Ok(Step { t0_s, t1_s, y0, y1: stages.y1, dense: stages.dense });
            }
            rejected = true;
            h = step_s * if error.is_finite() { (0.9 * error.powf(-0.2)).clamp(0.1, 0.9) } else { 0.1 };
            if h < 1e-14 * t0_s.abs().max(1.0) {
                return Err(IntegrationError::StepTooSmall { t_s: t0_s, step_s: h });
            }
        }
    }

    /// Takes exactly one step, to `end_s` (> `t_s`), without control of its error: on a frozen grid of steps, runs with
    /// slightly different parameters differ smoothly, which a step-size control would spoil. Also returns the estimate of its error, in
    /// tolerances.
    pub fn step_on_grid(
        &mut self,
        system: &mut impl OdeSystem<N>,
        end_s: f64,
    ) -> Result<(Step<N>, f64), IntegrationError> {
        let (t0_s, y0) = (self.t_s, self.y);
        let f0 = system.rates(t0_s, &y0);
        let jacobian = self.jacobian(system, t0_s, &y0, &f0);
        let time_derivative = system.time_derivative(t0_s, &y0, &f0);
        let failed = IntegrationError::StepTooSmall { t_s: t0_s, step_s: end_s - t0_s };
        let stages =
            self.stages(system, &jacobian, &f0, time_derivative.as_ref(), end_s - t0_s).ok_or(failed)?;
        if !stages.y1.iter().all(|value| value.is_finite()) {
            return Err(failed);
        }
        let error = self.error_norm(&y0, &stages);
        self.steps += 1;
        self.t_s = end_s;
        self.y = stages.y1;
        Ok((Step { t0_s, t1_s: end_s, y0, y1: stages.y1, dense: stages.dense }, error))
    }

    fn scale(&self, i: usize, a: f64, b: f64) -> f64 {
        self.tolerances.absolute[i] + self.tolerances.relative_ratio * a.abs().max(b.abs())
    }

    fn first_step_s(&self, y: &[f64; N], f: &[f64; N]) -> f64 {
        let mut norm = 0.0f64;
        for i in 0..N {
            norm = norm.max(f[i].abs() / (self.scale(i, y[i], y[i])));
        }
        // A first step that moves no state by more than about ten thousand tolerances.
        (1e4_f64.min(1e-2 / self.tolerances.relative_ratio) / norm.max(1e-12)).clamp(1e-6, 1.0)
    }

    /// Forward differences, relative step sqrt(machine epsilon).
    fn jacobian(
        &self,
        system: &mut impl OdeSystem<N>,
        t_s: f64,
        y: &[f64; N],
        f: &[f64; N],
    ) -> SMatrix<f64, N, N> {
        let mut jacobian = SMatrix::<f64, N, N>::zeros();
        let mut shifted = *y;
        for column in 0..N {
            shifted[column] = y[column] + 1.5e-8 * y[column].abs().max(1e-3);
            let step = shifted[column] - y[column];
            let rates = system.rates(t_s, &shifted);
            for row in 0..N {
                jacobian[(row, column)] = (rates[row] - f[row]) / step;
            }
            shifted[column] = y[column];
        }
        jacobian
    }

    fn stages(
        &self,
        system: &mut impl OdeSystem<N>,
        jacobian: &SMatrix<f64, N, N>,
        f0: &[f64; N],
        time_derivative: Option<&[f64; N]>,
        h: f64,
    ) -> Option<Stages<N>> {
        let inverse_h = 1.0 / h;
        let lu = (SMatrix::<f64, N, N>::identity() * (inverse_h / GAMMA) - jacobian).lu();
        let mut u = [SVector::<f64, N>::zeros(); STAGES];
        let mut y_stage = self.y;
        for stage in 0..STAGES {
            let mut right = if stage == 0 {
                SVector::from(*f0)
            } else {
                y_stage = self.y;
                for (before, weight) in A[stage].iter().enumerate().take(stage) {
                    for i in 0..N {
                        y_stage[i] += weight * u[before][i];
                    }
                }
                SVector::from(system.rates(self.t_s + STAGE_TIME[stage] * h, &y_stage))
            };
            for (before, weight) in C[stage].iter().enumerate().take(stage) {
                right += u[before] * (weight * inverse_h);
            }
            if let Some(slope) = time_derivative {
                right += SVector::from(*slope) * (h * TIME_DERIVATIVE[stage]);
            }
            if !lu.solve_mut(&mut right) || !right.iter().all(|value| value.is_finite()) {
                return None;
            }
            u[stage] = right;
        }
        // Stiffly accurate: the last stage's state plus its own increment is the step's result, and that increment
        // is the estimate of its error.
        let y1 = std::array::from_fn(|i| y_stage[i] + u[STAGES - 1][i]);
        let dense = DENSE.map(|weights| {
            std::array::from_fn(|i| weights.iter().zip(&u).map(|(weight, u)| weight * u[i]).sum())
        });
        Some(Stages { y1, error: u[STAGES - 1].into(), dense })
    }

    fn error_norm(&self, y0: &[f64; N], stages: &Stages<N>) -> f64 {
        let sum: f64 = (0..N)
            .map(|i| {
                let error = stages.error[i] / self.scale(i, y0[i], stages.y1[i]);
                error * error
            })
            .sum();
        (sum / N as f64).sqrt()
    }
}

struct Stages<const N: usize> {
    y1: [f64; N],
    error: [f64; N],
    dense: [[f64; N]; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Prothero-Robinson: y' = -L (y - cos t) - sin t, solution cos t; stiff, and time-dependent.
    struct ProtheroRobinson {
        stiffness: f64,
    }

    impl OdeSystem<1> for ProtheroRobinson {
        fn rates(&mut self, t: f64, y: &[f64; 1]) -> [f64; 1] {
            [-self.stiffness * (y[0] - t.cos()) - t.sin()]
        }
        fn time_derivative(&mut self, t: f64, _: &[f64; 1], _: &[f64; 1]) -> Option<[f64; 1]> {
            Some([-self.stiffness * t.sin() - t.cos()])
        }
    }

    #[test]
    fn follows_the_known_solution_at_any_stiffness_within_its_tolerance() {
        for stiffness in [1.0, 1e3, 1e6] {
            for relative_ratio in [1e-5, 1e-8] {
                let tolerances = Tolerances { relative_ratio, absolute: [relative_ratio] };
                let mut system = ProtheroRobinson { stiffness };
                let mut integrator = Integrator::new(0.0, [1.0], tolerances);
                let (mut worst_end, mut worst_within) = (0.0f64, 0.0f64);
                while integrator.t_s < 10.0 {
                    let step = integrator.step(&mut system, 10.0).unwrap();
                    worst_end = worst_end.max((step.y1[0] - step.t1_s.cos()).abs());
                    for i in 0..=10 {
                        let t = step.t0_s + (step.t1_s - step.t0_s) * f64::from(i) / 10.0;
                        worst_within = worst_within.max((step.at(t)[0] - t.cos()).abs());
                    }
                }
                // Local errors of some hundred steps may add.
                assert!(
                    worst_end < 100.0 * relative_ratio,
                    "L = {stiffness}, rtol = {relative_ratio}: {worst_end:e}"
                );
                // The interpolant is one order lower, and where the equation is infinitely stiff the error estimate
                // sees only the ends of a step.
                if stiffness == 1.0 {
                    assert!(
                        worst_within < 100.0 * relative_ratio,
                        "rtol = {relative_ratio}: {worst_within:e}"
                    );
                }
            }
        }
    }

    /// Van der Pol, mu = 1000: reference of the test set for IVP solvers (Mazzia & Magherini), y(2) in scaled form.
    struct VanDerPol;

    impl OdeSystem<2> for VanDerPol {
        fn rates(&mut self, _: f64, y: &[f64; 2]) -> [f64; 2] {
            [y[1], ((1.0 - y[0] * y[0]) * y[1] - y[0]) / 1e-6]
        }
        fn time_derivative(&mut self, _: f64, _: &[f64; 2], _: &[f64; 2]) -> Option<[f64; 2]> {
            None
        }
    }

    #[test]
    fn van_der_pol_ends_where_the_test_set_says() {
        let tolerances = Tolerances { relative_ratio: 1e-9, absolute: [1e-9; 2] };
        let mut integrator = Integrator::new(0.0, [2.0, 0.0], tolerances);
        while integrator.t_s < 2.0 {
            integrator.step(&mut VanDerPol, 2.0).unwrap();
        }
        assert!((integrator.y[0] - 1.706_167_732_170_483).abs() < 1e-6, "{}", integrator.y[0]);
        assert!((integrator.y[1] + 0.892_809_701_024_795_6).abs() < 1e-6, "{}", integrator.y[1]);
    }
}
