//! Efficiency between the points of a compressor map, as a mesh over flow and pressure ratio: used for the picture of a map and for the
//! page, so that both show the same contours.

mod fitted;
mod levels;
mod monotone;
mod surface;

pub use fitted::fitted_surface;
pub use levels::contour_levels;
pub use surface::{
    InterpolatedLine, SUBDIVISIONS, efficiency_surface, interpolate_between_lines, interpolated_lines,
    points_surge_to_choke, speed_curve,
};
