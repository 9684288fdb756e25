//! The measured surge-side ends as CSV: one row per speed line.

use crate::csv::{Column, write_table};
use crate::simulation_table::{digits, heading, number};
use mapper_core::{CompressorMap, ExportError, MapFormat, SurgeFoundBy, SurgeMark};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "surge",
    extension: "surge.csv",
    description: "the surge-side ends that were sought, with standard errors",
    write: Some(write),
    ..MapFormat::NONE
};

fn columns<'a>() -> [Column<&'a SurgeMark>; 13] {
    [
        ("speed_corrected_rpm", |mark| number(mark.speed_corrected_rpm)),
        ("flow_corrected_kg_s", |mark| number(mark.flow_corrected_kg_s)),
        ("flow_standard_error_kg_s", |mark| number(mark.flow_standard_error_kg_s)),
        ("flow_common_standard_error_kg_s", |mark| number(mark.flow_common_standard_error_kg_s)),
        ("pressure_ratio", |mark| number(mark.pressure_ratio)),
        ("pressure_ratio_standard_error", |mark| number(mark.pressure_ratio_standard_error)),
        ("closest_flow_corrected_kg_s", |mark| number(mark.closest_flow_corrected_kg_s)),
        ("found_by", |mark| found_by(mark).to_owned()),
        ("openings", |mark| mark.steps.to_string()),
        ("target_speed_rpm", |mark| number(mark.target_speed_rpm)),
        ("soft_flow_corrected_kg_s", |mark| digits(mark.soft.map(|soft| soft.flow_corrected_kg_s))),
        ("soft_pressure_ratio", |mark| digits(mark.soft.map(|soft| soft.pressure_ratio))),
        ("soft_variation_ratio", |mark| digits(mark.soft.map(|soft| soft.variation_ratio))),
    ]
}

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let header = format!(
        "{}\
         # surge-side ends of the speed lines; one standard error each, the flow meter's gain apart (common)\n\
         # closest_flow: smallest that was measured; found_by: precursor (variation carried on), surge or file\n{}",
        heading(map, "#"),
        map.surge.iter().find_map(|mark| mark.soft).map_or_else(String::new, |soft| format!(
            "# soft: where the coefficient of variation of {} reaches soft_variation_ratio, {:.1} times that far from surge\n",
            soft.channel,
            soft.variation_ratio / soft.quiet_ratio
        ))
    );
    write_table(FORMAT.name, header, columns(), &map.surge)
}

fn found_by(mark: &SurgeMark) -> &'static str {
    match mark.found_by {
        SurgeFoundBy::Precursor => "precursor",
        SurgeFoundBy::Surge => "surge",
        SurgeFoundBy::File => "file",
    }
}
