//! Compressor and turbine maps as text, picture and file: import, fit with prediction errors, and comparison of two maps.

pub(crate) mod map_comparison_picture;
pub(crate) mod map_documents;
pub(crate) mod turbine_file;
