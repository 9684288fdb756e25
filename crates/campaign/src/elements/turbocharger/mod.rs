//! Campaign keys that describe the tested turbocharger: machine, geometry, gases, reference state, and efficiency definition.

pub(crate) mod gas;
pub(crate) mod geometry;
pub(crate) mod machine;
pub(crate) mod reference;
