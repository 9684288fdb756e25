//! Integration tests of the module `gap`.

mod catalogue;
pub(crate) mod common;
mod correction;
mod diagnose;
mod healthy;
mod near_surge;
mod next;
mod structure;
