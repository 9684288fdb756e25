//! Coloured noise: white noise plus a stationary first-order process with the autocorrelation `exp(-|t - s| / time constant)`
//! (Ornstein-Uhlenbeck; AR(1) if samples are evenly spaced).
//!
//! Contains the variance and covariance of means, the product with the correlation matrix, and two
//! ways to whiten residuals.
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
