//! Compressor and turbine maps as text, picture and file: import, fit with prediction errors, and comparison of two maps.

pub(crate) mod imported_map_text;
pub(crate) mod map_comparison_picture;
pub(crate) mod map_comparison_text;
pub(crate) mod map_fit_text;
pub(crate) mod reduced_text;
pub(crate) mod turbine_file;
pub(crate) mod turbine_map_text;
