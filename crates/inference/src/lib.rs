//! The statistical core: which hypotheses explain data, how probable each is, and which the data do not distinguish.
//!
//! 1. A source of hypotheses (a gap, a drift, a closure, a log without steps, the balances of a recording) predicts how each changes the
//!    readings. [`TimeHistory`](hypotheses::TimeHistory) states when a cause acts.
//! 2. [`hypotheses`] finds the most probable set of causes if the predictions are linear, in closed form. [`search`] does so if each set needs
//!    a fit of a nonlinear model ([`descend`](mapper_numerics::least_squares::descend)), by adding, replacing and removing one cause at a time.
//! 3. [`posterior`] turns the evidence of the sets into probabilities: of each cause, of none, of an unmodelled one. It says whether a
//!    cause is named, and which causes are alike.
//! 4. [`mixture`] is the same for parameters that are neutral or free on one Gaussian; it draws from the mixture of all sets.
//! 5. [`posterior`] also gives the shortest interval of a number that depends on such draws.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod hypotheses;
pub mod mixture;
pub mod posterior;
pub mod search;
