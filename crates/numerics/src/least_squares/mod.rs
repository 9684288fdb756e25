//! Nonlinear least squares by damped steps: the control of the damping, and the solution of the damped normal equations, whose matrix
//! is full or arrow-shaped.
//!
//! [`descent`] is the fit of a model whose runs are costly: undamped steps within bounds, shortened if they do not help.
//!
//! The caller defines the problem: residuals, weights, bounds, and estimates between the steps. docs/decisions/0010-numerics.md gives
//! the reasons for not using a library.
//!
//! Source: K. Levenberg, Quarterly of Applied Mathematics 2 (1944); D. W. Marquardt, SIAM Journal 11 (1963), whose damping is
//! relative to the diagonal, so that units of the parameters do not matter.

mod arrow;
mod damping;
pub mod descent;

pub use arrow::{Arrow, ArrowBlock, Reduced};
pub use damping::{DampedFit, Damping, DampingRule, damped_step, inverse, minimise};
