//! The machine and the map of an FMU, from a campaign or a fitted map.

use mapper_core::{FittedMap, FittedNode, ReferenceState};
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::machine::state::State;

/// Minimum efficiency in the map of an FMU. Below it the fit no longer describes a compressor.
const MIN_EFFICIENCY: f64 = 0.05;

/// The speed lines of a fit, including extrapolated ones, without the end on the choke side at which the gas is not compressed.
///
/// # Errors
/// [`MapError`] if the remaining lines cannot be simulated.
pub fn table_of_fit(fitted: &FittedMap, reference: ReferenceState) -> Result<TabulatedMap, MapError> {
    let compresses =
        |node: &&FittedNode| node.pressure_ratio > 1.0 && (MIN_EFFICIENCY..=1.0).contains(&node.eta);
    let rows: Vec<MapRow> = fitted
        .lines
        .iter()
        .flat_map(|line| {
            line.nodes.iter().filter(compresses).map(|node| MapRow {
                speed_corrected_rpm: line.speed_corrected_rpm,
                flow_corrected_kg_s: node.flow_corrected_kg_s,
                pressure_ratio: node.pressure_ratio,
                efficiency: node.eta,
            })
        })
        .collect();
    TabulatedMap::new(&rows, reference)
}

/// The compressor map of an FMU.
#[derive(Debug, Clone)]
pub enum FmuMap {
    /// The nominal machine's closed form.
    ClosedForm(ClosedFormMap),
    /// Speed lines.
    Table(TabulatedMap),
}

/// A machine to export.
#[derive(Debug, Clone)]
pub struct FmuMachine<'a> {
    /// Name for users.
    pub name: &'a str,
    /// One sentence on the origin of its numbers.
    pub origin: &'a str,
    /// Parameters.
    pub params: &'a Params,
    /// Compressor map.
    pub map: &'a FmuMap,
    /// Start values of the inputs.
    pub boundary: &'a BoundaryConditions,
    /// Initial state, unless the importer sets another one.
    pub start: &'a State,
}

impl FmuMachine<'_> {
    /// The model identifier of the FMI standard: the name as a C identifier of at most 60 characters.
    pub fn identifier(&self) -> String {
        let mut text: String =
            self.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).take(60).collect();
        if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            text.insert_str(0, "machine_");
        }
        text
    }
}

/// Reason why an FMU cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FmuError {
    #[error("{name} = {value}: an FMU needs a finite number")]
    NotFinite { name: String, value: f64 },
    #[error("the archive cannot be written: {0}")]
    Archive(#[from] zip::result::ZipError),
    #[error("a file of the archive cannot be written: {0}")]
    File(#[from] std::io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_becomes_a_c_identifier() {
        let params = Params::default();
        let map = FmuMap::ClosedForm(ClosedFormMap { wheel_diameter_m: 0.052 });
        let (boundary, start) = (BoundaryConditions::default(), State::new(1e4, 2e5, 300.0, 400.0, 300.0));
        let identifier = |name: &str| {
            FmuMachine { name, origin: "", params: &params, map: &map, boundary: &boundary, start: &start }
                .identifier()
        };
        assert_eq!(identifier("turbo_a"), "turbo_a");
        assert_eq!(identifier("2 Lader/ä"), "machine_2_Lader__");
        assert_eq!(identifier(""), "machine_");
        assert!(identifier(&"x".repeat(1000)).len() <= 60);
    }
}
