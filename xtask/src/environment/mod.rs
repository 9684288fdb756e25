//! Tools and services that the tests need on a computer, and the Python environment of the tests.

pub(crate) mod capabilities;
pub(crate) mod machine;
pub(crate) mod python_env;
