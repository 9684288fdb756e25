//! The numbers of the sources that decide a result, for the generated page and for the test that keeps them documented.

pub mod constants;
