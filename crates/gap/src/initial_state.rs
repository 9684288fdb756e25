//! Whether a machine rested when a recording began, and what it starts from where it did not.

use mapper_core::Channel;
use mapper_observe::mean::mean_reading;
use mapper_observe::table::Table;
use mapper_physics::model::Model;

/// Metal this much heavier keeps its temperature while all else comes to rest.
const HEAVY_RATIO: f64 = 1e9;

/// The model with metal that keeps its temperature.
pub(crate) fn with_metal_held(model: &Model) -> Model {
    let mut heavy = model.clone();
    heavy.params.compressor.housing_mass_kg *= HEAVY_RATIO;
    heavy.params.turbine.housing_mass_kg *= HEAVY_RATIO;
    heavy
}

/// Time over which the metal is watched at the start, s, and the rate above which it does not rest, K/s: some hundred times what
/// noise makes of it, and a tenth of what a machine does that was cold minutes ago.
const WATCH_S: f64 = 30.0;
const RESTLESS_K_S: f64 = 0.05;

/// Whether the metal's temperatures stand still when a recording's first step begins.
pub(crate) fn rested(table: &Table, start_s: f64) -> bool {
    [Channel::Tc, Channel::Tt].into_iter().all(|channel| {
        let Some(column) = table.column(channel) else { return true };
        let middle = |from_s: f64| {
            let range = table.range(from_s, from_s + 0.3 * WATCH_S);
            mean_reading(&column[range].iter().copied().filter(|v| v.is_finite()).collect::<Vec<_>>())
        };
        let (Some(first), Some(last)) = (middle(start_s), middle(start_s + 0.7 * WATCH_S)) else {
            return true;
        };
        (last - first).abs() < RESTLESS_K_S * 0.7 * WATCH_S
    })
}
