//! The fitted surface as CSV: one row per node with its errors, extrapolation marked.

use crate::heading::heading;
use mapper_core::{CompressorMap, ExportError, FittedLine, FittedMap, FittedNode, MapFormat};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "fitted",
    extension: "fitted.csv",
    description: "the fitted lines with standard errors, each node marked measured or extrapolated",
    write: Some(write),
    turbine: crate::turbine::FITTED,
    ..MapFormat::NONE
};

/// Column names, in order.
const COLUMNS: [&str; 14] = [
    "speed_corrected_rpm",
    "beta",
    "flow_corrected_kg_s",
    "pressure_ratio",
    "eta",
    "work_ratio",
    "flow_standard_error_kg_s",
    "pressure_ratio_standard_error",
    "eta_standard_error",
    "flow_common_standard_error_kg_s",
    "pressure_ratio_common_standard_error",
    "eta_common_standard_error",
    "line",
    "support",
];

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let fitted = map.fitted.as_ref().ok_or(ExportError::NeedsFit { format: FORMAT.name })?;
    let failed = ExportError::failed(FORMAT.name);
    let mut writer = ::csv::Writer::from_writer(header(map, fitted).into_bytes());
    writer.write_record(COLUMNS).map_err(&failed)?;
    for line in &fitted.lines {
        for (beta_ratio, node) in fitted.beta_ratio.iter().zip(&line.nodes) {
            writer.write_record(row(line, *beta_ratio, node)).map_err(&failed)?;
        }
    }
    writer.into_inner().map_err(|error| failed(error.into_error().into()))
}

fn header(map: &CompressorMap, fitted: &FittedMap) -> String {
    format!(
        "{}\
         # fitted speed lines; scatter of the points about them: {:.2} % of distance, {:.2} points of efficiency\n\
         # *_standard_error: one standard error; flow and pressure ratio: the parts of the error across the line\n\
         # *_common_standard_error: what all places share (gains, offsets); in eta_standard_error it is included\n\
         # beta: 0 at the choke end, 1 at the surge end; line: measured or not; support: measured or extrapolated\n",
        heading(map, "#"),
        100.0 * fitted.distance_rms_ratio,
        100.0 * fitted.eta_rms,
    )
}

fn row(line: &FittedLine, beta_ratio: f64, node: &FittedNode) -> [String; 14] {
    // Shortest text that reads back to the same number.
    let number = |value: f64| value.to_string();
    [
        number(line.speed_corrected_rpm),
        number(beta_ratio),
        number(node.flow_corrected_kg_s),
        number(node.pressure_ratio),
        number(node.eta),
        number(node.work_ratio),
        number(node.flow_standard_error_kg_s),
        number(node.pressure_ratio_standard_error),
        number(node.eta_standard_error),
        number(node.flow_common_standard_error_kg_s),
        number(node.pressure_ratio_common_standard_error),
        number(node.eta_common_standard_error),
        (if line.measured { "measured" } else { "between_or_beyond" }).to_owned(),
        (if node.extrapolated { "extrapolated" } else { "measured" }).to_owned(),
    ]
}
