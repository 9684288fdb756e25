//! Campaign files: YAML text -> a checked [`Campaign`], or all its mistakes, each with its place and remedy.
//!
//! The text becomes a tree that keeps positions; the tree is checked against the JSON schema that
//! [`json_schema`] also gives to editors, units and ranges included; then against itself (grid, limits, window,
//! files). Only a text without mistakes is deserialised, and only then points are judged for reachability.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod campaign;
mod checking;
mod consistency;
mod deserialise;
mod elements;
mod finding;
mod load;
mod nightly;
mod quantity_check;
mod reach;
mod render;
mod scalar;
mod schema;
mod si;
mod structure;
mod tree;

pub use campaign::Campaign;
pub use finding::{Finding, FindingKind, Findings};
pub use load::{
    CampaignError, FILE_SIZE_LIMIT, MAP_SIZE_LIMIT, backend_mistake, check, check_with, format_mistake, load,
};
pub use mapper_units as units;
pub use nightly::{Nightly, NightlyError, NightlyGroup, NightlyMistake, load_nightly};
pub use reach::{Unreachable, nominal_model, unreachable_points};
pub use schema::json_schema;
