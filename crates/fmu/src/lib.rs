//! A machine as an FMU: FMI 2.0 for co-simulation, in C source, with no file of the world touched.
//!
//! The equations are C files that ship with the program (`c/`); what differs from machine to machine (parameters, start values, the
//! map, the coefficients of the integrator) is written into one header, and the same list of variables makes that header and
//! `modelDescription.xml`. The standard's own three headers are next to them, so that any C99 compiler builds the folder `sources`.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod archive;
mod c_text;
mod description;
mod files;
mod fitted;
mod header;
mod machine;
mod sources;
mod variable;
mod variables;

pub use archive::archive;
pub use files::{FmuFile, files};
pub use fitted::table_of_fit;
pub use machine::{FmuError, FmuMachine, FmuMap};
