//! Integration tests of the module `gap`.

mod baseline;
mod catalogue;
pub(crate) mod common;
mod correction;
mod diagnose;
mod near_surge;
mod next;
mod stored;
mod structure;
