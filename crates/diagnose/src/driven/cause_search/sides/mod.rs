//! Modules of sides.

pub(crate) mod compressor;
pub(crate) mod side;
pub(crate) mod turbine;
