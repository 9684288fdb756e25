//! Reads the nominal map of a campaign from a file in any layout of map files.

use mapper_core::{IdentifiedPoint, ImportError, MapDescription};
use mapper_maps::table::read_any_text;
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};

/// Reason why a file is not a nominal map.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum NominalTableError {
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(
        "the map has no efficiencies, and the nominal model needs them: give a map that has some, or `map: closed_form`"
    )]
    NoEfficiency,
    /// The values are impossible for a compressor.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Reads the nominal map. `given` is the map description with at least the reference state.
///
/// # Errors
/// [`NominalTableError`] with the line of the file.
pub fn nominal_table(
    text: &str,
    given: impl Into<MapDescription>,
) -> Result<TabulatedMap, NominalTableError> {
    let map = read_any_text(text, &given.into())?.map;
    let points = map.lines.iter().flat_map(|line| &line.points);
    let mut points: Vec<(&IdentifiedPoint, f64)> =
        points.filter_map(|point| Some((&point.identified, point.eta?))).collect();
    if points.is_empty() {
        return Err(NominalTableError::NoEfficiency);
    }
    // In the order of the file, since messages count lines.
    points.sort_by_key(|(point, _)| point.step);
    let row = |(point, efficiency): &(&IdentifiedPoint, f64)| MapRow {
        speed_corrected_rpm: point.speed_corrected_rpm,
        flow_corrected_kg_s: point.flow_corrected_kg_s,
        pressure_ratio: point.pressure_ratio,
        efficiency: *efficiency,
    };
    let rows: Vec<MapRow> = points.iter().map(row).collect();
    Ok(TabulatedMap::new(&rows, map.reference)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ReferenceState;
    use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
    use proptest::prelude::*;

    const SAMPLE: &str = "RPM,WC,PRC,ETAC\n50000,0.04,1.31,0.58\n50000,0.06,1.30,0.63\n50000,0.08,1.2,0.6\n\
                          70000,0.06,1.7,0.6\n70000,0.09,1.65,0.7\n70000,0.12,1.5,0.65\n";

    fn read(text: &str) -> Result<TabulatedMap, NominalTableError> {
        nominal_table(text, Some(ReferenceState::SAE))
    }

    #[test]
    fn the_real_looking_sample_reads_and_a_broken_one_says_where() {
        let map = read(SAMPLE).unwrap();
        assert_eq!(map.speeds_corrected_rpm(), [50e3, 70e3]);
        assert!((map.evaluate(50e3, 1.30).flow_corrected_kg_s - 0.06).abs() < 1e-12);
        assert!(matches!(
            read(&SAMPLE.replace("0.09", "oops")),
            Err(NominalTableError::Import(ImportError::NotANumber { line: 6, .. }))
        ));
        let negative = read(&SAMPLE.replace("0.09", "-1"));
        assert!(matches!(negative, Err(NominalTableError::Import(ImportError::Value { line: 6, .. }))));
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
            Err(NominalTableError::Import(ImportError::Row { line: 1, .. }))
        ));
        assert!(matches!(
            read(&text.replace("krpm", "rpm")),
            Err(NominalTableError::Import(ImportError::Slow { .. }))
        ));
        // rpm under a heading of krpm.
        assert!(matches!(
            read(&SAMPLE.replace("RPM", "N [krpm]")),
            Err(NominalTableError::Import(ImportError::Value { .. }))
        ));
    }

    proptest! {
        #[test]
        fn any_text_is_a_map_or_an_error(text in "[0-9.,;#\\n a-z\\[\\]/-]{0,200}") {
            let _ = read(&text);
        }
    }
}
