//! A map as bytes of a file: an exporter is a function.
//!
//! To add a format, write one module with one function of type [`Exporter`], and one line in [`EXPORTERS`].
//! Exporters do no IO; the caller writes the bytes. The same map gives the same bytes.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod csv;
mod error;
mod json;
mod monotone;
mod surface;
mod svg;

pub use error::ExportError;
pub use surface::efficiency_surface;
pub use svg::{map_figure, map_panel};

use mapper_core::CompressorMap;

/// Turns a map into the bytes of a file.
pub type Exporter = fn(&CompressorMap) -> Result<Vec<u8>, ExportError>;

/// One format.
#[derive(Debug, Clone, Copy)]
pub struct ExporterEntry {
    /// Name as written in campaigns and on the command line.
    pub name: &'static str,
    /// File name extension without the dot.
    pub extension: &'static str,
    /// One line for people.
    pub description: &'static str,
    /// The exporter.
    pub export: Exporter,
}

/// Every format.
pub const EXPORTERS: &[ExporterEntry] = &[
    ExporterEntry {
        name: "csv",
        extension: "csv",
        description: "one row a point, units in the column names, reference state and method in `#` lines",
        export: csv::export,
    },
    ExporterEntry {
        name: "json",
        extension: "json",
        description: "the whole map with every point's uncertainty, warnings and window",
        export: json::export,
    },
    ExporterEntry {
        name: "svg",
        extension: "svg",
        description: "picture: speed lines with efficiency contours, and efficiency with its 95 % interval",
        export: svg::export,
    },
];

/// The format of a name.
pub fn find(name: &str) -> Option<&'static ExporterEntry> {
    EXPORTERS.iter().find(|entry| entry.name == name)
}
