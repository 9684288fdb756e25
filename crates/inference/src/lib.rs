//! Bayesian inference on a linear-Gaussian model: which parameters differ from neutral, and the posterior of all others.
//!
//! [`mixture`] computes the probability of every set of parameters that may differ from neutral on one Gaussian, and draws
//! from the mixture of all sets. [`hypotheses`] finds which of many faults explain the residuals of linear balances, [`search`] does so
//! if each set needs a fit of a nonlinear model, and [`descent`] is that fit. [`interval`] gives the shortest interval of a number that depends on such draws.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod descent;
pub mod hypotheses;
pub mod interval;
pub mod mixture;
pub mod posterior;
pub mod search;
pub mod time_history;
