//! `machine:`, with its nominal map from a file in any layout of map files.

use crate::checking::{Check, resolve_path};
use crate::elements::turbocharger::geometry::GeometryFile;
use crate::elements::turbocharger::reference::ReferenceFile;
use crate::machine_sizes::AssumedSize;
use mapper_core::{IdentifiedPoint, ImportError, MapDescription, ReferenceState};
use mapper_maps::table::{description_from_yaml, read_any_text};
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};
use mapper_physics::machine::params::Params;
use mapper_yaml::units::Kind;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// The turbocharger under test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// Name.
    pub name: String,
    /// Serial number.
    pub serial_number: Option<String>,
    /// Parameters of the nominal model, the diameter of the declared T2 probe included.
    pub params: Params,
    /// The nominal compressor map.
    pub map: MapSource,
    /// Sizes that the file does not give. Not part of the canonical JSON: `params` has their values.
    #[serde(skip)]
    pub assumed: Vec<AssumedSize>,
    /// Whether the file gives the diameter of the compressor wheel. Not part of the canonical JSON either.
    #[serde(skip)]
    pub wheel_is_declared: bool,
}

/// Source of the nominal compressor map.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MapSource {
    /// The closed form of the model's description.
    ClosedForm,
    /// A table.
    Table {
        /// Path as resolved from the campaign file. Not part of the canonical JSON: only the text identifies the map.
        #[serde(skip)]
        path: PathBuf,
        /// The path in the campaign. Not part of the canonical JSON either.
        #[serde(skip)]
        named: String,
        /// The file's text, which [`crate::nominal_model`] reads.
        text: String,
        /// Reference state of its corrected quantities.
        reference: ReferenceState,
        /// The map description, if the campaign names one.
        #[serde(skip_serializing_if = "Option::is_none")]
        description: Option<DescriptionSource>,
    },
}

/// A map description of a campaign.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DescriptionSource {
    /// The path in the campaign. Not part of the canonical JSON.
    #[serde(skip)]
    pub named: String,
    /// The file's text.
    pub text: String,
}

impl MapSource {
    /// The map of the table; `None` for the closed form.
    pub fn table(&self) -> Option<Result<TabulatedMap, NominalTableError>> {
        let MapSource::Table { text, reference, description, .. } = self else { return None };
        let given =
            description.as_ref().map(|file| description_from_yaml(&file.text, Path::new(&file.named)));
        // The check of the campaign has excluded mistakes of the description.
        let given = given.and_then(Result::ok).unwrap_or_default();
        Some(nominal_table(text, MapDescription { reference: Some(*reference), ..given }))
    }
}

/// The turbocharger under test.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MachineFile {
    /// Name of the machine, as shown on the map.
    #[schemars(length(min = 1), example = &"turbo_a")]
    name: String,
    /// Serial number; put it into quotes if it is a number.
    #[schemars(example = &"TA-0001")]
    serial_number: Option<String>,
    /// Sizes and masses; omitted values are those of Burke et al., Appendix A, scaled to `compressor.wheel_diameter`.
    geometry: Option<GeometryFile>,
    /// The nominal compressor map: `closed_form`, or a table as `file` with its `reference` state.
    #[schemars(example = &"closed_form")]
    map: MapFile,
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum MapFile {
    Named(NamedMap),
    Table(TableFile),
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedMap {
    ClosedForm,
}

/// A map as a table.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TableFile {
    /// Map file in any layout of `mapper map inspect`, relative to the campaign file.
    #[schemars(length(min = 1), example = &"maps/x.csv")]
    pub file: String,
    /// State to which the table's corrected flow and speed refer. The usual choices: SAE (298 K, 100 kPa), Garrett (545 degR, 13.95 psia), BorgWarner (293 K, 98.1 kPa); or `temperature` and `pressure`.
    #[schemars(example = &"SAE")]
    pub reference: ReferenceFile,
    /// Map description, relative to the campaign file, for a map file that does not name its columns or units; `mapper map inspect` writes it.
    #[schemars(length(min = 1), example = &"maps/x.description.yaml")]
    pub description: Option<String>,
}

impl MachineFile {
    /// The machine with the map of the file, and the T2 probe declared for its sensors.
    pub(crate) fn machine(
        self,
        probe_diameter_m: f64,
        origin: &Path,
        files: &dyn Fn(&Path) -> io::Result<String>,
    ) -> io::Result<Machine> {
        let map = match self.map {
            MapFile::Named(NamedMap::ClosedForm) => MapSource::ClosedForm,
            MapFile::Table(table) => {
                let path = resolve_path(origin, &table.file);
                let text = files(&path)?;
                let described = |named: String| {
                    Ok::<_, io::Error>(DescriptionSource {
                        text: files(&resolve_path(origin, &named))?,
                        named,
                    })
                };
                let description = table.description.map(described).transpose()?;
                MapSource::Table {
                    path,
                    named: table.file,
                    text,
                    reference: table.reference.into(),
                    description,
                }
            }
        };
        let mut params = self.geometry.unwrap_or_default().machine();
        params.t2_probe_diameter_m = probe_diameter_m;
        let (name, serial_number) = (self.name, self.serial_number);
        Ok(Machine { name, serial_number, params, map, assumed: Vec::new(), wheel_is_declared: false })
    }
}

/// Checks that the map file can be read and is a map.
pub(crate) fn check(check: &mut Check<'_>) {
    let steps = steps!["machine", "map", "file"];
    let Some(name) = check.text(&steps).filter(|name| !name.is_empty()) else { return };
    let (path, text) = check.file(name);
    let Some(given) = description(check) else { return };
    let text = match text {
        Ok(text) => text,
        Err(error) => {
            let message = format!("the map file `{}` cannot be read: {error}", path.display());
            let remedy = "write its path relative to the campaign file, or `map: closed_form`";
            check.note(FindingKind::MissingFile, &steps, message, remedy);
            return;
        }
    };
    let reference = reference(check);
    let given = MapDescription { reference: Some(reference.unwrap_or(ReferenceState::SAE)), ..given };
    match nominal_table(&text, given) {
        Ok(_) => {}
        // The reference state of the campaign may be missing.
        Err(NominalTableError::Import(ImportError::ReferenceConflict { .. })) if reference.is_none() => {}
        Err(error) => {
            let message = format!("the map file `{}` is not a map: {error}", path.display());
            let remedy = "inspect it with `mapper map inspect`; add missing information in a map description (`map: {file, reference, description}`)";
            check.note(FindingKind::WrongValue, &steps, message, remedy);
        }
    }
}

/// The map description; an empty one if the campaign names none, `None` if it cannot be read.
fn description(check: &mut Check<'_>) -> Option<MapDescription> {
    let steps = steps!["machine", "map", "description"];
    let Some(name) = check.text(&steps).filter(|name| !name.is_empty()) else {
        return Some(MapDescription::default());
    };
    let (path, text) = check.file(name);
    let (kind, problem) = match text.map(|text| description_from_yaml(&text, &path)) {
        Ok(Ok(description)) => return Some(description),
        Ok(Err(findings)) => (FindingKind::WrongValue, findings.to_string()),
        Err(error) => (FindingKind::MissingFile, format!("it cannot be read: {error}")),
    };
    let message = format!("the map description `{}` has a mistake: {problem}", path.display());
    check.note(kind, &steps, message, "correct it; `mapper map inspect` can write one");
    None
}

/// The reference state of the table, if it is given and valid.
fn reference(check: &Check<'_>) -> Option<ReferenceState> {
    let path = steps!["machine", "map", "reference"];
    if let Some(name) = check.text(&path) {
        return ReferenceState::named(name);
    }
    let join = |key: &str| [&path[..], &steps![key]].concat();
    let (t_ref_k, _) = check.quantity(Kind::Temperature, &join("temperature"))?;
    let (p_ref_pa, _) = check.quantity(Kind::Pressure, &join("pressure"))?;
    Some(ReferenceState { t_ref_k, p_ref_pa })
}

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
    use mapper_physics::compressor_map::closed_form_map::CompressorCharacteristic;
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
