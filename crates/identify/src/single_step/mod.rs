//! Identification of efficiency and heat transfer from one step alone, with uncertainties and expected results.

pub(crate) mod budgets;
pub(crate) mod covariance;
pub(crate) mod dynamic;
pub(crate) mod expected;
pub(crate) mod fit;
pub(crate) mod steady;
