//! All integration tests of `mapper-diagnose`: one program, since each further one would be compiled and linked by itself. Those of `inside` belong
//! to the library's own tests.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod drift;
mod driven;
