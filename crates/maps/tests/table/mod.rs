//! Integration tests of the module `table`.

mod end_blocks;
mod matrices;
mod named_arrays;
mod units_and_machines;
mod wide;
mod workbooks;
