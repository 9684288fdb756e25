//! Contour lines and bands of a field on a structured grid, with labels, for map pictures.

pub(crate) mod bands;
pub(crate) mod contour_item;
pub(crate) mod contour_label;
pub(crate) mod grid;
pub(crate) mod marching;
