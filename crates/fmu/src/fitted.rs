//! Converts a fitted map to the speed lines of an FMU.

use mapper_core::{FittedMap, FittedNode, ReferenceState};
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};

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
