//! Complete plans from a request: construction, key figures, input hashes, and comparison with other orders.

pub(crate) mod plan;
pub(crate) mod plan_builder;
