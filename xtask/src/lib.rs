//! The numbers of the sources that decide a result, for the generated page and for the test that keeps them documented.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod constants;
