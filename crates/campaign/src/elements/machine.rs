//! `machine:`

use super::geometry::GeometryFile;
use super::reference::ReferenceFile;
use crate::checking::{Check, beside};
use crate::machine_sizes::AssumedSize;
use crate::nominal_table::nominal_table;
use mapper_core::ReferenceState;
use mapper_physics::params::Params;
use mapper_yaml::FindingKind;
use mapper_yaml::steps;
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
        /// The path as the campaign writes it. Not part of the canonical JSON either.
        #[serde(skip)]
        named: String,
        /// The file's text, which [`crate::nominal_model`] reads.
        text: String,
        /// State to which its corrected quantities refer.
        reference: ReferenceState,
    },
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

// Untagged: the form of the YAML node shows which variant it is, and the schema was checked before.
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
    /// CSV file, relative to the campaign file.
    #[schemars(length(min = 1), example = &"maps/x.csv")]
    pub file: String,
    /// State to which the table's corrected flow and speed refer. The usual choices: SAE (298 K, 100 kPa), Garrett (545 degR, 13.95 psia), BorgWarner (293 K, 98.1 kPa); or `temperature` and `pressure`.
    #[schemars(example = &"SAE")]
    pub reference: ReferenceFile,
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
                let path = beside(origin, &table.file);
                let text = files(&path)?;
                MapSource::Table { path, named: table.file, text, reference: table.reference.into() }
            }
        };
        let mut params = self.geometry.unwrap_or_default().machine();
        params.t2_probe_diameter_m = probe_diameter_m;
        Ok(Machine { name: self.name, serial_number: self.serial_number, params, map, assumed: Vec::new() })
    }
}

/// Checks that the map file can be read and is a map.
pub(crate) fn check(check: &mut Check<'_>) {
    let steps = steps!["machine", "map", "file"];
    let Some(name) = check.text(&steps).filter(|name| !name.is_empty()) else { return };
    let (path, text) = check.file(name);
    match text {
        Err(error) => {
            let message = format!("the map file `{}` cannot be read: {error}", path.display());
            let remedy = "write its path relative to the campaign file, or `map: closed_form`";
            check.note(FindingKind::MissingFile, &steps, message, remedy);
        }
        // This check does not depend on the reference state, which may still be missing.
        Ok(text) => {
            if let Err(error) = nominal_table(&text, ReferenceState::SAE) {
                let message = format!("the map file `{}` is not a map: {error}", path.display());
                let remedy = "each row needs corrected speed, corrected flow, pressure ratio and efficiency; in rpm, kg/s and as a fraction where the heading names no unit";
                check.note(FindingKind::WrongValue, &steps, message, remedy);
            }
        }
    }
}
