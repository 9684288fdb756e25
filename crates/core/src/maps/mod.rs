//! Compressor and turbine maps with their reference state and efficiency definition, and the interface of map files.

pub(crate) mod imported_map;
pub(crate) mod map;
pub(crate) mod map_format;
pub(crate) mod reference_state;
pub(crate) mod turbine_map;
