//! A map as rows of points.

use mapper_core::{CompressorMap, ExportError, MapPoint, SpeedLine, Verdict, Warning, step_number};

/// Column names, in order. A missing number is an empty field; `eta*` are fractions, 95 % intervals.
const COLUMNS: [&str; 28] = [
    "line_speed_corrected_rpm",
    "speed_corrected_rpm",
    "flow_corrected_kg_s",
    "pressure_ratio",
    "eta",
    "eta_low",
    "eta_high",
    "h_w_m2k",
    "h_low_w_m2k",
    "h_high_w_m2k",
    "speed_rpm",
    "flow_kg_s",
    "valve",
    "t1_k",
    "p1_pa",
    "residual_rms_k",
    "dt2_k",
    "dtc_k",
    "method",
    "verdict",
    "warnings",
    "step",
    "flow_measured_corrected_kg_s",
    "pressure_ratio_measured",
    "eta_common_changes",
    "h_common_changes_w_m2k",
    "flow_common_standard_error_ratio",
    "pressure_ratio_common_standard_error",
];

pub(super) fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let failed = ExportError::failed(super::FORMAT.name);
    let mut writer = ::csv::Writer::from_writer(header(map).into_bytes());
    writer.write_record(COLUMNS).map_err(&failed)?;
    for line in &map.lines {
        for point in &line.points {
            writer.write_record(row(line, point)).map_err(&failed)?;
        }
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

fn row(line: &SpeedLine, point: &MapPoint) -> [String; 28] {
    let p = &point.identified;
    // Shortest text that reads back to the same number.
    let number = |value: f64| value.to_string();
    let option = |value: Option<f64>| value.map(number).unwrap_or_default();
    let list = |values: &[f64]| values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(";");
    let with_eta = |value: Option<f64>| option(value.filter(|_| point.eta.is_some()));
    let verdict = match p.verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    };
    [
        number(line.speed_corrected_rpm),
        number(p.speed_corrected_rpm),
        number(point.flow_corrected_kg_s),
        number(point.pressure_ratio),
        option(point.eta),
        with_eta(p.eta_low),
        with_eta(p.eta_high),
        option(p.h_w_m2k),
        option(p.h_low_w_m2k),
        option(p.h_high_w_m2k),
        number(p.speed_rpm),
        number(p.flow_kg_s),
        option(Some(p.valve_opening_ratio).filter(|ratio| ratio.is_finite())),
        number(p.t1_k),
        number(p.p1_pa),
        option(p.residual_rms_k),
        option(p.dt2_k),
        option(p.dtc_k),
        p.method.to_string(),
        verdict.to_owned(),
        p.warnings.iter().map(Warning::code).collect::<Vec<_>>().join(";"),
        step_number(p.step).to_string(),
        number(p.flow_corrected_kg_s),
        number(p.pressure_ratio),
        list(&p.common.eta_changes),
        list(&p.common.h_changes_w_m2k),
        number(p.common.flow_corrected_standard_error_ratio),
        number(p.common.pressure_ratio_standard_error),
    ]
}
