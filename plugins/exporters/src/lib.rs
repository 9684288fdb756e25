//! A map as bytes of a file: an exporter is a function.
//!
//! To add a format, write one module with one function of type [`Exporter`], and one line in [`EXPORTERS`].
//! Exporters do no IO; the caller writes the bytes. The same map gives the same bytes.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod csv;
mod error;
mod fitted_csv;
mod fitted_items;
mod heading;
mod heat_picture;
mod json;
mod modelica;
mod monotone;
mod npss;
mod png;
mod pycycle;
mod sae;
mod simscape;
mod simulation_table;
mod surface;
mod svg;
mod thermal;
mod turbine;

pub use error::ExportError;
pub use heat_picture::{ErrorAtGradient, error_figure, heat_transfer_figure};
pub use surface::efficiency_surface;
pub use svg::{map_figure, map_panel};
pub use thermal::ThermalExport;
pub use turbine::{TurbinePoint, turbine_points, turbine_text};

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
        name: "sae",
        extension: "txt",
        description: "SAE text: corrected rpm, corrected kg/s, pressure ratio, efficiency, from choke to surge",
        export: sae::export,
    },
    ExporterEntry {
        name: "fitted",
        extension: "fitted.csv",
        description: "the fitted lines with standard errors, each node marked measured or extrapolated",
        export: fitted_csv::export,
    },
    ExporterEntry {
        name: "modelica",
        extension: "modelica.txt",
        description: "tables over corrected speed and beta for Modelica.Blocks.Tables.CombiTable2Ds",
        export: modelica::export,
    },
    ExporterEntry {
        name: "simscape",
        extension: "m",
        description: "MATLAB script: tables over corrected speed and beta, and over corrected speed and pressure ratio",
        export: simscape::export,
    },
    ExporterEntry {
        name: "npss",
        extension: "npss.map",
        description: "NPSS tables of flow, pressure ratio and efficiency over beta and corrected speed",
        export: npss::export,
    },
    ExporterEntry {
        name: "pycycle",
        extension: "py",
        description: "Python module with a pyCycle map: [alpha][Nc][Rline]",
        export: pycycle::export,
    },
    ExporterEntry {
        name: "svg",
        extension: "svg",
        description: "picture: speed lines with efficiency contours, and efficiency with its 95 % interval",
        export: svg::export,
    },
    ExporterEntry {
        name: "png",
        extension: "png",
        description: "the picture as pixels",
        export: png::export,
    },
];

/// The format of a name.
pub fn find(name: &str) -> Option<&'static ExporterEntry> {
    EXPORTERS.iter().find(|entry| entry.name == name)
}
