//! The elements of a campaign, one file each: its form (struct, schema, range, default), its value in SI,
//! its consistency checks, and the tests of all that.
//!
//! Doc comments of deserialised types become the schema's descriptions, which editors show and messages quote: they
//! describe what to write. `x-quantity`, `x-min`, `x-max` and `x-above` are explained at [`crate::units::Quantity`].
//!
//! If the program's own struct is in `mapper-core`, the element is its `serde` remote: the compiler compares the
//! fields of both.

pub(crate) mod backend;
pub(crate) mod boundary;
pub(crate) mod display;
pub(crate) mod drift;
pub(crate) mod efficiency;
pub(crate) mod geometry;
pub(crate) mod grid;
pub(crate) mod guards;
pub(crate) mod identification;
pub(crate) mod limits;
pub(crate) mod lines;
pub(crate) mod machine;
pub(crate) mod opening;
pub(crate) mod outputs;
pub(crate) mod readers;
pub(crate) mod reference;
pub(crate) mod repeats;
pub(crate) mod report;
pub(crate) mod safe_state;
pub(crate) mod sensors;
pub(crate) mod sequence;
pub(crate) mod settle_bands;
pub(crate) mod several_sensors;
pub(crate) mod speed_control;
pub(crate) mod surge_search;
pub(crate) mod timing;
pub(crate) mod tolerances;
pub(crate) mod window;
pub(crate) mod zero;
