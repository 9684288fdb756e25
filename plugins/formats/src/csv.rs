//! Map format `csv`: one table with a heading, read and written.

use crate::simulation_table::{GAS_PREFIX, digits, number};
use ::csv::{ReaderBuilder, StringRecord, Trim};
use mapper_core::{
    CommonErrors, CompressorMap, EfficiencyDefinition, ExportError, ImportError, ImportedMap, MapDescription,
    MapFormat, MapPoint, Method, ReferenceState, SpeedLine, SpeedShift, Verdict, Warning, step_number,
};
use mapper_maps::table::{
    Row, check_point_count, efficiency_in_comment, line, read_text, reference_in_comment, resolve_reference,
    text_of,
};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "csv",
    extension: "csv",
    description: "one row a point, units in the column names, reference state and method in `#` lines",
    write: Some(write),
    read: Some(read),
    turbine: crate::turbine::CSV,
    ..MapFormat::NONE
};

const REQUIRED_COLUMNS: [&str; 4] = ["speed_corrected_rpm", "flow_corrected_kg_s", "pressure_ratio", "eta"];

/// Maximum number of common errors of a point; `mapper` writes up to 13.
const MAX_COMMON_ERRORS: usize = 64;

struct Head {
    reference: Option<ReferenceState>,
    machine: String,
    method: Option<Method>,
    efficiency: Option<EfficiencyDefinition>,
    gas: Option<String>,
    /// First step number: 0 for files of version 0.1.0, which do not contain it.
    first_step: f64,
    columns: Columns,
}

/// The column names of the file, and the positions of the four.
struct Columns {
    names: Vec<String>,
    four: [usize; 4],
}

fn read(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    let text = &text_of(bytes)?;
    if is_own(text) { read_own(text, given.reference).map(ImportedMap::from) } else { read_text(text, given) }
}

fn read_own(text: &str, given: Option<ReferenceState>) -> Result<CompressorMap, ImportError> {
    let (mut reference, mut machine, mut method, mut first_step) = (None, String::new(), None, 0.0);
    let (mut efficiency, mut gas) = (None, None);
    for comment in text.lines().filter_map(|line| line.trim_start().strip_prefix('#')) {
        reference = reference.or_else(|| reference_in_comment(comment));
        efficiency = efficiency.or_else(|| efficiency_in_comment(comment));
        if let Some((_, name)) = comment.split_once("compressor map of ") {
            machine = name.trim().chars().take(200).collect();
        }
        if let Some((_, words)) = comment.split_once(GAS_PREFIX) {
            gas = Some(words.trim().chars().take(200).collect());
        }
        if let Some((_, name)) = comment.split_once("method: ") {
            method = method_of(name);
        }
        if comment.trim_start().starts_with("step: ") {
            first_step = 1.0;
        }
    }
    let mut reader = ReaderBuilder::new()
        .comment(Some(b'#'))
        .has_headers(false)
        .trim(Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let mut records = reader.records();
    let first = records.next().ok_or(ImportError::Empty)?;
    let columns = find_columns(&record(first)?)?;
    let head = Head { reference, machine, method, efficiency, gas, first_step, columns };
    let mut rows: Vec<(Row, StringRecord)> = Vec::new();
    for next in records {
        let next = record(next)?;
        if next.iter().all(str::is_empty) {
            continue;
        }
        check_point_count(rows.len(), at(&next))?;
        rows.push((row(&next, &head.columns)?, next));
    }
    read_own_rows(&head, &rows, given)
}

/// The column that only files of `mapper` have.
const OWN_COLUMN: &str = "line_speed_corrected_rpm";

fn is_own(text: &str) -> bool {
    let heading = text.lines().find(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    heading.is_some_and(|line| line.split(',').any(|name| name.trim() == OWN_COLUMN))
}

fn record(record: Result<StringRecord, ::csv::Error>) -> Result<StringRecord, ImportError> {
    record.map_err(|error| {
        let line = error.position().map_or(1, |position| position.line() as usize);
        ImportError::Row { line, source: error.into() }
    })
}

fn at(record: &StringRecord) -> usize {
    record.position().map_or(1, |position| position.line() as usize)
}

fn find_columns(record: &StringRecord) -> Result<Columns, ImportError> {
    let names: Vec<String> = record.iter().map(str::to_owned).collect();
    let mut four = [0; 4];
    for (place, name) in four.iter_mut().zip(REQUIRED_COLUMNS) {
        *place = names.iter().position(|known| known == name).ok_or_else(|| ImportError::NoColumn {
            line: at(record),
            missing: name,
            found: names.join(", ").chars().take(120).collect(),
        })?;
    }
    Ok(Columns { names, four })
}

impl Columns {
    fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    fn text<'a>(&self, record: &'a StringRecord, name: &str) -> Option<&'a str> {
        record.get(self.find(name)?).filter(|text| !text.is_empty())
    }

    /// Numbers separated by semicolons; empty if the column is missing or the field is empty.
    fn list(&self, record: &StringRecord, name: &str) -> Result<Vec<f64>, ImportError> {
        let Some(text) = self.text(record, name) else { return Ok(Vec::new()) };
        text.split(';').take(MAX_COMMON_ERRORS).map(|part| finite(part, record, name)).collect()
    }

    fn number(&self, record: &StringRecord, name: &str) -> Result<Option<f64>, ImportError> {
        let Some(text) = self.text(record, name) else { return Ok(None) };
        finite(text, record, name).map(Some)
    }
}

fn finite(text: &str, record: &StringRecord, name: &str) -> Result<f64, ImportError> {
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| ImportError::NotANumber {
        line: at(record),
        quantity: format!("column {name}"),
        text: text.chars().take(40).collect(),
    })
}

fn row(record: &StringRecord, columns: &Columns) -> Result<Row, ImportError> {
    let field = |index: usize, what: &str| {
        let text = record.get(columns.four[index]).unwrap_or_default();
        let shown: String = text.chars().take(40).collect();
        text.parse().map_err(|_| ImportError::NotANumber {
            line: at(record),
            quantity: what.to_owned(),
            text: shown,
        })
    };
    let eta_text = record.get(columns.four[3]).unwrap_or_default();
    let row = Row {
        at: at(record),
        speed_corrected_rpm: field(0, "corrected speed")?,
        flow_corrected_kg_s: field(1, "corrected flow")?,
        pressure_ratio: field(2, "pressure ratio")?,
        eta: if eta_text.is_empty() { None } else { Some(field(3, "efficiency")?) },
    };
    row.check()?;
    Ok(row)
}

/// A file of `mapper`: lines and all columns as written.
fn read_own_rows(
    head: &Head,
    rows: &[(Row, StringRecord)],
    given: Option<ReferenceState>,
) -> Result<CompressorMap, ImportError> {
    let reference = resolve_reference(head.reference, given)?;
    if rows.is_empty() {
        return Err(ImportError::Empty);
    }
    let mut points = Vec::with_capacity(rows.len());
    for (row, record) in rows {
        let line_rpm = head.columns.number(record, OWN_COLUMN)?.unwrap_or(row.speed_corrected_rpm);
        points.push((line_rpm, own_point(head, row, record, line_rpm, reference)?));
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let lines = points
        .chunk_by(|a, b| a.0 == b.0)
        .map(|members| line(members[0].0, members.iter().map(|(_, point)| point.clone()).collect()))
        .collect();
    let method = head.method.unwrap_or(Method::Imported);
    Ok(CompressorMap {
        machine: head.machine.clone(),
        reference,
        method,
        efficiency: head.efficiency,
        gas: head.gas.clone(),
        wheel_diameter_m: None,
        lines,
        surge: Vec::new(),
        fitted: None,
    })
}

fn own_point(
    head: &Head,
    row: &Row,
    record: &StringRecord,
    line_rpm: f64,
    reference: ReferenceState,
) -> Result<MapPoint, ImportError> {
    let columns = &head.columns;
    let number = |name: &str| columns.number(record, name);
    let or = |name: &str, default: f64| Ok::<_, ImportError>(number(name)?.unwrap_or(default));
    let mut point = row.point(reference, (or("step", head.first_step)? - head.first_step).max(0.0) as usize);
    point.flow_corrected_kg_s = or("flow_measured_corrected_kg_s", row.flow_corrected_kg_s)?;
    point.pressure_ratio = or("pressure_ratio_measured", row.pressure_ratio)?;
    point.speed_rpm = or("speed_rpm", row.speed_corrected_rpm)?;
    point.flow_kg_s = or("flow_kg_s", row.flow_corrected_kg_s)?;
    point.valve_opening_ratio = or("valve", f64::NAN)?;
    point.t1_k = or("t1_k", reference.t_ref_k)?;
    point.p1_pa = or("p1_pa", reference.p_ref_pa)?;
    (point.eta_low, point.eta_high) = (number("eta_low")?, number("eta_high")?);
    (point.h_w_m2k, point.h_low_w_m2k, point.h_high_w_m2k) =
        (number("h_w_m2k")?, number("h_low_w_m2k")?, number("h_high_w_m2k")?);
    point.common = CommonErrors {
        eta_changes: columns.list(record, "eta_common_changes")?,
        h_changes_w_m2k: columns.list(record, "h_common_changes_w_m2k")?,
        flow_corrected_standard_error_ratio: or("flow_common_standard_error_ratio", 0.0)?,
        pressure_ratio_standard_error: or("pressure_ratio_common_standard_error", 0.0)?,
    };
    (point.residual_rms_k, point.dt2_k, point.dtc_k) =
        (number("residual_rms_k")?, number("dt2_k")?, number("dtc_k")?);
    point.method = columns.text(record, "method").and_then(method_of).unwrap_or(Method::Imported);
    point.verdict = match columns.text(record, "verdict") {
        Some("doubtful") => Verdict::Doubtful,
        Some("unusable") => Verdict::Unusable,
        _ if row.eta.is_none() => Verdict::Unusable,
        _ => Verdict::Good,
    };
    point.warnings = columns
        .text(record, "warnings")
        .unwrap_or_default()
        .split(';')
        .filter(|code| !code.is_empty())
        .map(|code| Warning::Other {
            code: code.to_owned(),
            message: "read from a CSV map, which holds the code alone".to_owned(),
        })
        .collect();
    let shift = SpeedShift {
        speed_corrected_rpm: line_rpm - row.speed_corrected_rpm,
        flow_corrected_kg_s: row.flow_corrected_kg_s - point.flow_corrected_kg_s,
        pressure_ratio: row.pressure_ratio - point.pressure_ratio,
    };
    Ok(MapPoint {
        flow_corrected_kg_s: row.flow_corrected_kg_s,
        pressure_ratio: row.pressure_ratio,
        eta: row.eta,
        identified: point,
        shift: (shift.speed_corrected_rpm != 0.0).then_some(shift),
    })
}

fn method_of(name: &str) -> Option<Method> {
    [Method::Steady, Method::Dynamic, Method::Joint, Method::Corrected, Method::Imported]
        .into_iter()
        .find(|method| method.to_string() == name.trim())
}

/// Name of a column, and its text in a row.
pub(crate) type Column<Row> = (&'static str, fn(&Row) -> String);

pub(crate) type PointRow<'a> = (&'a SpeedLine, &'a MapPoint);

/// The columns, in order. A missing number is an empty field; `eta*` are fractions, 95 % intervals.
pub(crate) fn columns<'a>() -> [Column<PointRow<'a>>; 28] {
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

/// The points with their lines.
pub(crate) fn rows(map: &CompressorMap) -> impl Iterator<Item = PointRow<'_>> {
    map.lines.iter().flat_map(|line| line.points.iter().map(move |point| (line, point)))
}

pub(crate) fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    write_table(FORMAT.name, header(map), columns(), rows(map))
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
        crate::simulation_table::heading(map, "#"),
        map.method,
        crate::simulation_table::efficiency_name(map.method),
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
