//! Commands of `cargo xtask` for developers: tests, performance measurement, and generated documents.

pub(crate) mod docs;
pub(crate) mod fleet_test;
pub(crate) mod performance;
pub(crate) mod quick;
pub(crate) mod test;
