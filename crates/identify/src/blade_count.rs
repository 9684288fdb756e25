//! Finds a speed sensor that is set to another number of blades than its wheel has: all speeds are then off by one ratio of small numbers.

use crate::faults::nominal_rig::map_speed_rpm;
use mapper_core::{IdentifiedPoint, ReferenceState};
use mapper_numerics::statistics::{MIN_VALUES, median, quantile};
use mapper_physics::compressor_map::closed_form_map::CompressorCharacteristic;

/// Numbers of blades, splitters counted. Bound: wheels of turbochargers.
const BLADES: std::ops::RangeInclusive<usize> = 4..=16;
/// Largest deviation of a ratio of speeds from one of numbers of blades. Bound: half the distance of neighbouring ratios, 8/9 and 9/10.
const SAME_RATIO: f64 = 0.005;
/// Largest spread of the ratios of a map between these quantiles. Bound: twice the tolerance of a map's flow, and the error of a flow meter.
const MAX_SPREAD_RATIO: f64 = 0.02;
/// Quantiles of that spread. Bound: a tenth of the points at each end may be wrong.
const CENTRAL: [f64; 2] = [0.1, 0.9];
/// Deviation of a measured speed from that of the grid. Bound: what a controller holds.
const HELD_RATIO: f64 = 0.01;
/// Share of points on the grid from which the grid is met, and below half of which it is not. Bound: by chance a fifth of the points is.
const ON_GRID_SHARE: f64 = 0.8;

/// A number of blades that explains all speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BladeCount {
    /// Blades of the wheel, at this scale of the readings.
    pub blades: usize,
    /// Blades to which the sensor is set.
    pub set: usize,
}

impl BladeCount {
    /// Reading over speed.
    pub fn ratio(&self) -> f64 {
        self.blades as f64 / self.set as f64
    }

    /// All that differ by one blade.
    fn all() -> impl Iterator<Item = BladeCount> {
        BLADES.flat_map(|set| [set - 1, set + 1].map(|blades| BladeCount { blades, set }))
    }
}

/// `reference`: of the points' corrected values. The number of blades by which all speeds meet the declared map, or the speeds of the grid, rpm; `None` if they do so as they are.
pub fn blade_count(
    points: &[IdentifiedPoint],
    reference: ReferenceState,
    grid_rpm: &[f64],
    map: Option<&dyn CompressorCharacteristic>,
) -> Option<BladeCount> {
    map.and_then(|map| by_map(points, reference, map)).or_else(|| by_grid(points, grid_rpm))
}

fn by_map(
    points: &[IdentifiedPoint],
    own: ReferenceState,
    map: &dyn CompressorCharacteristic,
) -> Option<BladeCount> {
    let ratio = |point: &IdentifiedPoint| {
        let of_map = map.reference();
        let speed_rpm = point.speed_corrected_rpm * own.speed_factor_to(of_map);
        let flow_kg_s = point.flow_corrected_kg_s * own.flow_factor_to(of_map);
        Some(speed_rpm / map_speed_rpm(map, flow_kg_s, point.pressure_ratio, speed_rpm)?)
    };
    let ratios: Vec<f64> = points.iter().filter_map(ratio).collect();
    let [low, high] = CENTRAL.map(|share| quantile(&ratios, share));
    let spread = high? - low?;
    let middle = median(&ratios)?;
    let off = |count: &BladeCount| (middle / count.ratio() - 1.0).abs();
    let known = ratios.len() >= MIN_VALUES && spread < MAX_SPREAD_RATIO;
    BladeCount::all()
        .filter(|count| known && off(count) < SAME_RATIO)
        .min_by(|a, b| off(a).total_cmp(&off(b)))
}

fn by_grid(points: &[IdentifiedPoint], grid_rpm: &[f64]) -> Option<BladeCount> {
    let on_grid = |ratio: f64| {
        let meets = |point: &&IdentifiedPoint| {
            grid_rpm.iter().any(|rpm| (point.speed_rpm / (ratio * rpm) - 1.0).abs() < HELD_RATIO)
        };
        points.iter().filter(meets).count() as f64 / points.len() as f64
    };
    let is_met = points.len() < MIN_VALUES || on_grid(1.0) > 0.5 * ON_GRID_SHARE;
    let best = BladeCount::all().max_by(|a, b| on_grid(a.ratio()).total_cmp(&on_grid(b.ratio())))?;
    (!is_met && on_grid(best.ratio()) > ON_GRID_SHARE).then_some(best)
}
