//! All integration tests of `mapper-backend-lab`: one program, since each further one would be compiled and linked by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod socket;
mod unread;
