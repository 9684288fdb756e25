//! A map as rows of points.

use crate::labels::{digits, number};
use mapper_core::{CompressorMap, ExportError, MapPoint, SpeedLine, Verdict, Warning, step_number};

/// Name of a column, and its text in a row.
pub(crate) type Column<Row> = (&'static str, fn(&Row) -> String);

type Row<'a> = (&'a SpeedLine, &'a MapPoint);

/// The columns, in order. A missing number is an empty field; `eta*` are fractions, 95 % intervals.
fn columns<'a>() -> [Column<Row<'a>>; 28] {
    [
        ("line_speed_corrected_rpm", |(line, _)| number(line.speed_corrected_rpm)),
        ("speed_corrected_rpm", |(_, point)| number(point.identified.speed_corrected_rpm)),
        ("flow_corrected_kg_s", |(_, point)| number(point.flow_corrected_kg_s)),
        ("pressure_ratio", |(_, point)| number(point.pressure_ratio)),
        ("eta", |(_, point)| digits(point.eta)),
        ("eta_low", |(_, point)| with_eta(point, point.identified.eta_low)),
        ("eta_high", |(_, point)| with_eta(point, point.identified.eta_high)),
        ("h_w_m2k", |(_, point)| digits(point.identified.h_w_m2k)),
        ("h_low_w_m2k", |(_, point)| digits(point.identified.h_low_w_m2k)),
        ("h_high_w_m2k", |(_, point)| digits(point.identified.h_high_w_m2k)),
        ("speed_rpm", |(_, point)| number(point.identified.speed_rpm)),
        ("flow_kg_s", |(_, point)| number(point.identified.flow_kg_s)),
        ("valve", |(_, point)| {
            digits(Some(point.identified.valve_opening_ratio).filter(|ratio| ratio.is_finite()))
        }),
        ("t1_k", |(_, point)| number(point.identified.t1_k)),
        ("p1_pa", |(_, point)| number(point.identified.p1_pa)),
        ("residual_rms_k", |(_, point)| digits(point.identified.residual_rms_k)),
        ("dt2_k", |(_, point)| digits(point.identified.dt2_k)),
        ("dtc_k", |(_, point)| digits(point.identified.dtc_k)),
        ("method", |(_, point)| point.identified.method.to_string()),
        ("verdict", |(_, point)| verdict(point).to_owned()),
        ("warnings", |(_, point)| {
            point.identified.warnings.iter().map(Warning::code).collect::<Vec<_>>().join(";")
        }),
        ("step", |(_, point)| step_number(point.identified.step).to_string()),
        ("flow_measured_corrected_kg_s", |(_, point)| number(point.identified.flow_corrected_kg_s)),
        ("pressure_ratio_measured", |(_, point)| number(point.identified.pressure_ratio)),
        ("eta_common_changes", |(_, point)| list(&point.identified.common.eta_changes)),
        ("h_common_changes_w_m2k", |(_, point)| list(&point.identified.common.h_changes_w_m2k)),
        ("flow_common_standard_error_ratio", |(_, point)| {
            number(point.identified.common.flow_corrected_standard_error_ratio)
        }),
        ("pressure_ratio_common_standard_error", |(_, point)| {
            number(point.identified.common.pressure_ratio_standard_error)
        }),
    ]
}

pub(super) fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let rows = map.lines.iter().flat_map(|line| line.points.iter().map(move |point| (line, point)));
    write_table(super::FORMAT.name, header(map), columns(), rows)
}

/// A table of these columns after comment lines.
pub(crate) fn write_table<Row, const N: usize>(
    format: &'static str,
    header: String,
    columns: [Column<Row>; N],
    rows: impl IntoIterator<Item = Row>,
) -> Result<Vec<u8>, ExportError> {
    let failed = ExportError::failed(format);
    let mut writer = ::csv::Writer::from_writer(header.into_bytes());
    writer.write_record(columns.map(|(name, _)| name)).map_err(&failed)?;
    for row in rows {
        writer.write_record(columns.map(|(_, text)| text(&row))).map_err(&failed)?;
    }
    writer.into_inner().map_err(|error| failed(error.into_error().into()))
}

fn header(map: &CompressorMap) -> String {
    format!(
        "{}\
         # method: {}\n\
         # units: SI as in the column names, speeds in rpm; pressures and temperatures are total; ratios and eta are fractions\n\
         # eta: isentropic, total to total ({}); *_low and *_high bound the 95 % interval; empty where undefined\n\
         # flow_corrected_kg_s and pressure_ratio: brought to line_speed_corrected_rpm by similarity; *_measured: before\n\
         # *_common_changes*: what one standard deviation of each error that all points share changes, separated by semicolons; \
         the rest of an interval is the point's own\n\
         # step: number of the step in its run, from 1\n\
         # h: heat-transfer coefficient between gas and compressor housing; warnings: codes separated by semicolons\n",
        crate::heading::heading(map, "#"),
        map.method,
        crate::heading::efficiency_name(map.method),
    )
}

fn with_eta(point: &MapPoint, value: Option<f64>) -> String {
    digits(value.filter(|_| point.eta.is_some()))
}

fn list(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(";")
}

fn verdict(point: &MapPoint) -> &'static str {
    match point.identified.verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    }
}
