//! Standard errors of the fit under noise with time correlation.
//!
//! The residual is modelled as the sum of a white and a first-order process. Two quadratic forms of the residual give their variances,
//! corrected for the degrees of freedom of the fit (Rao's MINQUE, which is unbiased). The parameters' covariance is `(J'J)^-1 J' Omega J
//! (J'J)^-1`: ordinary least squares with the actual noise. The noise of the regressors (T1, Tc, flow, pressures) is in the residual and thus
//! in the result.

use crate::NoiseColour;
use crate::single_step::fit::{Fit, dot, products};
use mapper_numerics::coloured_noise::{ColouredNoise, correlate};
use nalgebra::Matrix2;

/// Variances of the two parts of the residual, K2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoiseVariances {
    pub(crate) white_k2: f64,
    pub(crate) first_order_k2: f64,
}

impl NoiseVariances {
    /// Splits a total variance, K2, as declared.
    pub(crate) fn split(total_k2: f64, noise: ColouredNoise) -> Self {
        NoiseVariances {
            white_k2: noise.white_variance_ratio() * total_k2,
            first_order_k2: noise.first_order_variance_ratio() * total_k2,
        }
    }
}

/// Products of the first-order part's correlation matrix with the columns of the fit.
pub(crate) struct Correlation {
    /// `J' R J`.
    jrj: Matrix2<f64>,
    inverse_normal: Matrix2<f64>,
    variances: NoiseVariances,
}

impl Correlation {
    /// Prepares the noise estimate of a fit with samples at `t_s`.
    pub(crate) fn of(fit: &Fit, t_s: &[f64], colour: NoiseColour) -> Self {
        let (g, jacobian) = (&fit.inverse_normal, &fit.jacobian);
        let smoothed = [0, 1].map(|i| correlate(t_s, &jacobian[i], colour.time_constant_s));
        let jrj = products(jacobian, &smoothed);
        let jrrj = products(&smoothed, &smoothed);
        let n = t_s.len() as f64;
        let g_jrj = g * jrj;
        // Sum of squared correlations: the square of a first-order correlation has half the time constant.
        let ones = vec![1.0; t_s.len()];
        let squares: f64 = correlate(t_s, &ones, 0.5 * colour.time_constant_s).iter().sum();
        // Traces of M, M R and M R M R with M = 1 - J (J'J)^-1 J'.
        let trace_m = n - 2.0;
        let trace_mr = n - g_jrj.trace();
        let trace_mrmr = squares - 2.0 * (g * jrrj).trace() + (g_jrj * g_jrj).trace();
        let residual = &fit.residual_k;
        let white_form = dot(residual, residual);
        let smoothed_residual = correlate(t_s, residual, colour.time_constant_s);
        let correlated_form = dot(residual, &smoothed_residual);
        let determinant = trace_m * trace_mrmr - trace_mr * trace_mr;
        let white_k2 = (white_form * trace_mrmr - correlated_form * trace_mr) / determinant;
        let first_order_k2 = (trace_m * correlated_form - trace_mr * white_form) / determinant;
        let alone = |form: f64, trace: f64| if trace > 0.0 { form / trace } else { 0.0 };
        let variances = if determinant <= 0.0 || !first_order_k2.is_finite() || first_order_k2 <= 0.0 {
            NoiseVariances { white_k2: alone(white_form, trace_m), first_order_k2: 0.0 }
        } else if white_k2 <= 0.0 {
            NoiseVariances { white_k2: 0.0, first_order_k2: alone(correlated_form, trace_mrmr) }
        } else {
            NoiseVariances { white_k2, first_order_k2 }
        };
        Correlation { jrj, inverse_normal: *g, variances }
    }

    /// Standard errors of eta and h from the residual.
    pub(crate) fn standard_errors(&self) -> [f64; 2] {
        self.standard_errors_for(self.variances)
    }

    /// Standard errors of eta and h under given noise of T2.
    pub(crate) fn standard_errors_for(&self, variances: NoiseVariances) -> [f64; 2] {
        let g = &self.inverse_normal;
        let covariance = variances.white_k2 * g + variances.first_order_k2 * (g * self.jrj * g);
        covariance.diagonal().map(|variance| variance.max(0.0).sqrt()).into()
    }
}
