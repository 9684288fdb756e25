//! The measured surge-side ends as CSV: one row per speed line.

use crate::heading::heading;
use mapper_core::{CompressorMap, ExportError, MapFormat, SurgeFoundBy, SurgeMark};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "surge",
    extension: "surge.csv",
    description: "the surge-side ends that were sought, with standard errors",
    write: Some(write),
    ..MapFormat::NONE
};

/// Column names, in order.
const COLUMNS: [&str; 10] = [
    "speed_corrected_rpm",
    "flow_corrected_kg_s",
    "flow_standard_error_kg_s",
    "flow_common_standard_error_kg_s",
    "pressure_ratio",
    "pressure_ratio_standard_error",
    "closest_flow_corrected_kg_s",
    "found_by",
    "openings",
    "target_speed_rpm",
];

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let failed = ExportError::failed(FORMAT.name);
    let head = format!(
        "{}\
         # surge-side ends of the speed lines; one standard error each, the flow meter's gain apart (common)\n\
         # closest_flow: smallest that was measured; found_by: precursor (variation carried on) or surge\n",
        heading(map, "#")
    );
    let mut writer = ::csv::Writer::from_writer(head.into_bytes());
    writer.write_record(COLUMNS).map_err(&failed)?;
    for mark in &map.surge {
        writer.write_record(row(mark)).map_err(&failed)?;
    }
    writer.into_inner().map_err(|error| failed(error.into_error().into()))
}

fn row(mark: &SurgeMark) -> [String; 10] {
    // Shortest text that reads back to the same number.
    let number = |value: f64| value.to_string();
    [
        number(mark.speed_corrected_rpm),
        number(mark.flow_corrected_kg_s),
        number(mark.flow_standard_error_kg_s),
        number(mark.flow_common_standard_error_kg_s),
        number(mark.pressure_ratio),
        number(mark.pressure_ratio_standard_error),
        number(mark.closest_flow_corrected_kg_s),
        match mark.found_by {
            SurgeFoundBy::Precursor => "precursor",
            SurgeFoundBy::Surge => "surge",
        }
        .to_owned(),
        mark.steps.to_string(),
        number(mark.target_speed_rpm),
    ]
}
