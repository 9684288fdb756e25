//! Draws charts and compressor maps for reports and pages. Describe a [`Figure`] of [`Panel`]s and get an SVG document or a PNG picture.
//!
//! The same figure gives the same bytes: numbers are written with a fixed format, and nothing depends on time,
//! locale or hash order. The SVG is self-contained (no fonts, scripts or links) on a white ground.
//!
//! Bad numbers cause no errors: points that are NaN or infinite are omitted and break a line, empty data give an empty frame, and the axis
//! of constant data is widened.
//!
//! Contour lines run over a [`StructuredGrid`] with any coordinates ([`contour_lines`]); cells with an unknown corner are not drawn, so a
//! contour ends exactly at the edge of the known region.
//!
//! ```
//! use mapper_chart::{Axis, Figure, Line, Panel, Scatter, palette};
//! let panel = Panel::new(Axis::new("corrected mass flow, kg/s"), Axis::new("pressure ratio P2/P1, 1"))
//!     .with(Line::new(vec![(0.03, 1.9), (0.06, 1.8)], palette::BLUE).label("110 krpm"))
//!     .with(Scatter::new(vec![(0.03, 1.9), (0.06, 1.8)], palette::BLUE).label("measured"));
//! let svg = Figure::new("turbo_a").subtitle("reference state 298 K, 100 kPa").panel(panel).to_svg();
//! assert!(svg.starts_with("<svg"));
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod contours;
mod draw;
pub mod efficiency_mesh;
mod figure;
mod frame;
mod items;
mod layout;
mod map_drawing;
pub mod palette;
mod svg;
mod text;

pub use contours::{Contours, StructuredGrid, contour_lines};
pub use figure::{Axis, Figure, Panel};
pub use items::{
    Annotation, Dash, Item, Line, LineEnd, Marker, Note, PointLabels, Polygon, Rule, RuleAt, Scatter,
    ScatterPoint,
};
pub use map_drawing::{ContourDrawing, EtaDrawing, LineDrawing, MapDrawing, NodeDrawing};
pub use palette::Colour;
pub use svg::PngError;
