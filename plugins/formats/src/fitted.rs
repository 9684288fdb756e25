//! The fitted surface as CSV: one row per node with its errors, extrapolation marked.

use crate::csv::{Column, write_table};
use crate::simulation_table::{heading, number};
use mapper_core::{CompressorMap, ExportError, FittedLine, FittedMap, FittedNode, MapFormat};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "fitted",
    extension: "fitted.csv",
    description: "the fitted lines with standard errors, each node marked measured or extrapolated",
    write: Some(write),
    turbine: crate::turbine::FITTED,
    ..MapFormat::NONE
};

/// A line, a position on it, and its node there.
type Row<'a> = (&'a FittedLine, f64, &'a FittedNode);

fn columns<'a>() -> [Column<Row<'a>>; 14] {
    [
        ("speed_corrected_rpm", |(line, ..)| number(line.speed_corrected_rpm)),
        ("beta", |(_, beta_ratio, _)| number(*beta_ratio)),
        ("flow_corrected_kg_s", |(.., node)| number(node.flow_corrected_kg_s)),
        ("pressure_ratio", |(.., node)| number(node.pressure_ratio)),
        ("eta", |(.., node)| number(node.eta)),
        ("work_ratio", |(.., node)| number(node.work_ratio)),
        ("flow_standard_error_kg_s", |(.., node)| number(node.flow_standard_error_kg_s)),
        ("pressure_ratio_standard_error", |(.., node)| number(node.pressure_ratio_standard_error)),
        ("eta_standard_error", |(.., node)| number(node.eta_standard_error)),
        ("flow_common_standard_error_kg_s", |(.., node)| number(node.flow_common_standard_error_kg_s)),
        ("pressure_ratio_common_standard_error", |(.., node)| {
            number(node.pressure_ratio_common_standard_error)
        }),
        ("eta_common_standard_error", |(.., node)| number(node.eta_common_standard_error)),
        ("line", |(line, ..)| (if line.measured { "measured" } else { "between_or_beyond" }).to_owned()),
        ("support", |(.., node)| support(node).to_owned()),
    ]
}

/// At a pressure ratio below 1 it does not compress.
fn support(node: &FittedNode) -> &'static str {
    match (node.pressure_ratio > 1.0 && node.eta > 0.0, node.extrapolated) {
        (false, _) => "unusable",
        (true, true) => "extrapolated",
        (true, false) => "measured",
    }
}

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let fitted = map.fitted.as_ref().ok_or(ExportError::NeedsFit { format: FORMAT.name })?;
    let rows = fitted.lines.iter().flat_map(|line| {
        fitted.beta_ratio.iter().zip(&line.nodes).map(move |(beta_ratio, node)| (line, *beta_ratio, node))
    });
    write_table(FORMAT.name, header(map, fitted), columns(), rows)
}

fn header(map: &CompressorMap, fitted: &FittedMap) -> String {
    format!(
        "{}\
         # fitted speed lines; scatter of the points about them: {:.2} % of distance, {:.2} points of efficiency\n\
         # *_standard_error: one standard error; flow and pressure ratio: the parts of the error across the line\n\
         # *_common_standard_error: what all places share (gains, offsets); in eta_standard_error it is included\n\
         # beta: 0 at the choke end, 1 at the surge end; line: measured or not; support: measured, extrapolated, or unusable where it does not compress\n",
        heading(map, "#"),
        100.0 * fitted.distance_rms_ratio,
        100.0 * fitted.eta_rms,
    )
}
