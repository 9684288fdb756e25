//! Noise with memory: white noise plus a stationary first-order process, whose values correlate as
//! `exp(-|t - s| / time constant)` (Ornstein-Uhlenbeck; AR(1) where samples are evenly spaced).
//!
//! Every formula about it is here once: variance and covariance of means, the number of independent samples that a mean
//! is equivalent to, the product with the correlation matrix, and the two ways to make residuals independent.
//!
//! Source: P. E. Kloeden, E. Platen, Numerical Solution of Stochastic Differential Equations (1992), section 4.4; M. B.
//! Priestley, Spectral Analysis and Time Series (1981), section 5.3, for the variance of means.

mod colour;
mod correlate;
mod filter;
mod first_order;
mod means;

pub use colour::ColouredNoise;
pub use correlate::correlate;
pub use filter::{BlockNoise, WhiteningFilter};
pub use first_order::{block_covariance, memory, variance_of_mean};
pub use means::{WhiteningFactor, covariance_of_means};
