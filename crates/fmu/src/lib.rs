//! Exports a machine as an FMU (FMI 2.0 co-simulation, C source code), for system simulation programs. [`files`] generates the files in memory
//! from an [`FmuMachine`], and [`archive`] packs them; this crate writes nothing to disk.
//!
//! The equations are C files that ship with the program (`c/`); one generated header contains parameters, start values, the map and the
//! coefficients of the integrator. The header and `modelDescription.xml` come from the same list of variables. The three headers of the
//! standard are included, so that any C99 compiler builds the folder `sources`.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod files;
mod variables;

pub use files::{FmuFile, archive, files};
pub use variables::{FmuError, FmuMachine, FmuMap, table_of_fit};
