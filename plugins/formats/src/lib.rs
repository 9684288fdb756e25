//! File formats of compressor maps for `mapper`: [`FORMATS`] lists all of them, one file each with writer, reader or both.
//!
//! To add one, write its file with a constant `FORMAT`, and its line below.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod map_picture;
mod simulation_table;
mod turbine;

pub use map_picture::map_figure;
pub use mapper_chart::efficiency_mesh::efficiency_surface;
pub use mapper_maps::table::parse_reference;

use mapper_core::MapFormats;

/// Declares the formats' modules and the list of them.
macro_rules! formats {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*

        /// Every format, in display order.
        pub const FORMATS: MapFormats = MapFormats(&[$($name::FORMAT),*]);
    };
}

formats! {
    csv,
    json,
    sae,
    xlsx,
    fitted,
    surge,
    modelica,
    simscape,
    mat,
    npss,
    gsp,
    pycycle,
    svg,
    png,
}
