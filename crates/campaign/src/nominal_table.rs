//! The nominal map from a file: a table with names and units in its heading, or four bare columns.

use mapper_core::{MAP_COLUMNS, ReferenceState};
use mapper_physics::tabulated_map::{MapError, MapRow, TabulatedMap};
use mapper_yaml::units::{
    FoundColumn, HeadingError, Kind, TableText, WantedColumn, find_columns, with_units_row,
};

/// Quantities of the four columns.
const KINDS: [Kind; 4] = [Kind::Speed, Kind::MassFlow, Kind::Fraction, Kind::Fraction];

/// Why a file is not a nominal map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NominalTableError {
    /// The heading does not identify the columns.
    #[error(
        "line {line}: {source}; or leave the heading out and give rpm, kg/s, pressure ratio and efficiency in this order"
    )]
    Heading {
        /// Line of the file, from 1.
        line: usize,
        /// What is wrong with it.
        source: HeadingError,
    },
    /// An invalid row.
    #[error(
        "line {line} of the map: `{text}` does not hold the four numbers of a point (speed, flow, pressure ratio, efficiency)"
    )]
    Row {
        /// Line of the file, from 1.
        line: usize,
        /// Its text, shortened.
        text: String,
    },
    /// The numbers are not those of a compressor.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Reads separated text (`,`, or `;` or tab with decimal point or comma). A first line without numbers names the columns and their
/// units, in any order and among others; units may be on a line of their own below it. Without names they are corrected rpm, corrected
/// kg/s, pressure ratio and efficiency. `#` starts a comment.
///
/// # Errors
/// [`NominalTableError`] with the line of the file.
pub fn nominal_table(text: &str, reference: ReferenceState) -> Result<TabulatedMap, NominalTableError> {
    let content = text.lines().enumerate().filter_map(|(index, line)| {
        let content = line.split('#').next().unwrap_or_default().trim().trim_start_matches('\u{feff}');
        (!content.is_empty()).then_some((index + 1, content))
    });
    let mut content = content.peekable();
    let table = TableText::of(content.peek().map_or("", |(_, line)| line));
    let has_number = |line: &str| table.fields(line).into_iter().any(|field| table.number(field).is_some());
    let bare = |index| FoundColumn { index, unit: None };
    let mut columns = [bare(0), bare(1), bare(2), bare(3)];
    if let Some((line, names)) = content.next_if(|(_, first)| !has_number(first)) {
        let names: Vec<String> = table.fields(names).into_iter().map(str::to_owned).collect();
        let plain: Vec<&str> = names.iter().map(String::as_str).collect();
        let below = content.peek().and_then(|(_, below)| with_units_row(&plain, &table.fields(below)));
        if below.is_some() {
            content.next();
        }
        columns = columns_of(&below.unwrap_or(names))
            .map_err(|source| NominalTableError::Heading { line, source })?;
    }
    let mut rows = Vec::new();
    for (line, content) in content {
        let fields = table.fields(content);
        let number =
            |column: FoundColumn| table.number(fields.get(column.index)?).map(|value| column.inside(value));
        let [Some(speed_corrected_rpm), Some(flow_corrected_kg_s), Some(pressure_ratio), Some(efficiency)] =
            columns.map(number)
        else {
            return Err(NominalTableError::Row { line, text: content.chars().take(60).collect() });
        };
        rows.push(MapRow { speed_corrected_rpm, flow_corrected_kg_s, pressure_ratio, efficiency });
    }
    Ok(TabulatedMap::new(&rows, reference)?)
}

/// The four columns by their names and units.
fn columns_of(names: &[String]) -> Result<[FoundColumn; 4], HeadingError> {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let wanted: [WantedColumn<'_>; 4] = std::array::from_fn(|i| WantedColumn {
        quantity: MAP_COLUMNS[i].0,
        names: MAP_COLUMNS[i].1,
        kind: KINDS[i],
    });
    find_columns(&names, wanted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_physics::characteristic::CompressorCharacteristic;
    use proptest::prelude::*;

    const SAMPLE: &str = "RPM,WC,PRC,ETAC\n50000,0.04,1.31,0.58\n50000,0.06,1.30,0.63\n50000,0.08,1.2,0.6\n\
                          70000,0.06,1.7,0.6\n70000,0.09,1.65,0.7\n70000,0.12,1.5,0.65\n";

    fn read(text: &str) -> Result<TabulatedMap, NominalTableError> {
        nominal_table(text, ReferenceState::SAE)
    }

    #[test]
    fn the_real_looking_sample_reads_and_a_broken_one_says_where() {
        let map = read(SAMPLE).unwrap();
        assert_eq!(map.speeds_corrected_rpm(), [50e3, 70e3]);
        assert!((map.evaluate(50e3, 1.30).flow_corrected_kg_s - 0.06).abs() < 1e-12);
        assert!(matches!(read(&SAMPLE.replace("0.09", "oops")), Err(NominalTableError::Row { line: 6, .. })));
        let negative = read(&SAMPLE.replace("0.09", "-1"));
        assert!(matches!(
            negative,
            Err(NominalTableError::Map(MapError::Value { row: 5, quantity: "flow", .. }))
        ));
    }

    /// The same map by columns in another order, with units, among others.
    #[test]
    fn the_heading_counts() {
        let rows = SAMPLE.lines().skip(1).map(|line| {
            let row: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
            format!("{};x;{};{};{}\n", 100.0 * row[3], 1e3 * row[1], row[0] / 1e3, row[2])
        });
        let text = format!("eta [%];remark;flow (g/s);N / krpm;PR [-]\n{}", rows.collect::<String>());
        let (named, bare) = (read(&text).unwrap(), read(SAMPLE).unwrap());
        for pr in [1.25, 1.3, 1.5, 1.6] {
            let (a, b) = (named.evaluate(60e3, pr), bare.evaluate(60e3, pr));
            // Written and read through another unit: only rounding differs.
            assert!((a.flow_corrected_kg_s / b.flow_corrected_kg_s - 1.0).abs() < 1e-12);
            assert!((a.efficiency / b.efficiency - 1.0).abs() < 1e-12);
        }
        // The units below the names, and decimal commas.
        let (_, below) = text.split_once('\n').unwrap();
        let german = format!("eta;remark;flow;N;PR\n%;;g/s;krpm;-\n{}", below.replace('.', ","));
        assert_eq!(read(&german).unwrap().fingerprint(), named.fingerprint());
        assert!(matches!(
            read(&text.replace("g/s", "slugs")),
            Err(NominalTableError::Heading { line: 1, .. })
        ));
        assert!(matches!(
            read(&text.replace("krpm", "rpm")),
            Err(NominalTableError::Map(MapError::Slow { .. }))
        ));
        // rpm under a heading of krpm.
        assert!(matches!(
            read(&SAMPLE.replace("RPM", "N [krpm]")),
            Err(NominalTableError::Map(MapError::Fast { .. }))
        ));
    }

    proptest! {
        #[test]
        fn any_text_is_a_map_or_an_error(text in "[0-9.,;#\\n a-z\\[\\]/-]{0,200}") {
            let _ = read(&text);
        }
    }
}
