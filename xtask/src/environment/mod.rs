//! Tools and services that the tests need on a computer, and the Python environment of the tests.

pub(crate) mod machine;
pub(crate) mod machine_offers;
pub(crate) mod python_env;
