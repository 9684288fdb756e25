//! Whether the machine had settled when the recording began, and its initial state otherwise.

use mapper_core::Channel;
use mapper_numerics::ROUNDING;
use mapper_observe::averages::mean_reading::mean_reading;
use mapper_observe::averages::time_table::Table;
use mapper_physics::simulation::model::Model;

/// The model with its metal so heavy that its temperatures hold while everything else settles.
pub(crate) fn with_metal_held(model: &Model) -> Model {
    let mut heavy = model.clone();
    heavy.params.compressor.housing_mass_kg /= ROUNDING;
    heavy.params.turbine.housing_mass_kg /= ROUNDING;
    heavy
}

/// Time in which everything but the housings settles from an unknown state, s: several times the lag of a sheathed probe, the slowest part.
pub(crate) const SETTLING_S: f64 = 30.0;
/// Rate above which the initial metal temperatures are not settled, K/s: some hundred times noise, and a tenth of that of a machine started
/// cold minutes ago.
const RESTLESS_K_S: f64 = 0.05;

/// Whether the metal temperatures are steady when the first step of a recording begins.
pub(crate) fn rested(table: &Table, start_s: f64) -> bool {
    [Channel::Tc, Channel::Tt].into_iter().all(|channel| {
        let Some(column) = table.column(channel) else { return true };
        let middle = |from_s: f64| {
            let range = table.range(from_s, from_s + 0.3 * SETTLING_S);
            mean_reading(&column[range].iter().copied().filter(|v| v.is_finite()).collect::<Vec<_>>())
        };
        let (Some(first), Some(last)) = (middle(start_s), middle(start_s + 0.7 * SETTLING_S)) else {
            return true;
        };
        (last - first).abs() < RESTLESS_K_S * 0.7 * SETTLING_S
    })
}
