//! A fitted map as the speed lines that an FMU holds.

use mapper_core::{FittedMap, FittedNode, ReferenceState};
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};

/// Lowest efficiency that an FMU's map holds: below it the fit has no compressor any more, and the model's floor is above it.
const LOWEST_EFFICIENCY: f64 = 0.05;

/// The speed lines of a fit, its extrapolated ones included, without the far end of choke where nothing is compressed.
///
/// # Errors
/// [`MapError`] if the remaining lines are not a map that a model can run on.
pub fn table_of_fit(fitted: &FittedMap, reference: ReferenceState) -> Result<TabulatedMap, MapError> {
    let compresses =
        |node: &&FittedNode| node.pressure_ratio > 1.0 && (LOWEST_EFFICIENCY..=1.0).contains(&node.eta);
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
