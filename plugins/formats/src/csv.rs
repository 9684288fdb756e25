//! CSV: one row per point. Lines that start with `#` give the reference state. Tables of other programs need the four required columns.

mod read;
mod write;

pub(crate) use write::{Column, write_table};

use mapper_core::MapFormat;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "csv",
    extension: "csv",
    description: "one row a point, units in the column names, reference state and method in `#` lines",
    write: Some(write::write),
    read: Some(read::read),
    turbine: crate::turbine::CSV,
    ..MapFormat::NONE
};
