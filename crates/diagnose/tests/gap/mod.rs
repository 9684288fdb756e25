//! All integration tests of `mapper-diagnose`: one program, since each further one would be compiled and linked by itself.

mod catalogue;
pub(crate) mod common;
mod correction;
mod diagnose;
mod healthy;
mod near_surge;
mod next;
