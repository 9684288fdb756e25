//! CSV: one row per point. Lines that begin with `#` give the reference of the numbers. Tables from other programs are read by the
//! names of the four columns that a map needs.

mod read;
mod write;

use mapper_core::MapFormat;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "csv",
    extension: "csv",
    further_extensions: &[],
    description: "one row a point, units in the column names, reference state and method in `#` lines",
    write: Some(write::write),
    draw: None,
    read: Some(read::read),
    turbine: crate::turbine::CSV,
};
