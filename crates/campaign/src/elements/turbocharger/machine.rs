//! `machine:`

use crate::checking::{Check, resolve_path};
use crate::elements::turbocharger::geometry::GeometryFile;
use crate::elements::turbocharger::reference::ReferenceFile;
use crate::machine_sizes::AssumedSize;
use crate::nominal_table::{NominalTableError, nominal_table};
use mapper_core::{ImportError, MapDescription, ReferenceState};
use mapper_maps::table::description_from_yaml;
use mapper_physics::compressor_map::tabulated_map::TabulatedMap;
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
    ///
    /// # Errors
    /// [`NominalTableError`] if the text is not a map; this cannot happen in a checked campaign.
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
    ///
    /// # Errors
    /// If the map file can no longer be read.
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
