//! The nominal rig, and the places of its sensors.

use crate::faults::end_readings::{At, Readings};
use crate::joint::step_model::parameters::middle_and_half_range;
use mapper_core::{Channel, ModelTolerances, ReferenceState};
use mapper_numerics::ROUNDING;
use mapper_numerics::polyline::NearestOnPolyline;
use mapper_numerics::root::bisect;
use mapper_numerics::statistics::median;
use mapper_physics::compressor_map::closed_form_map::CompressorCharacteristic;
use mapper_physics::laws::compression::isentropic_rise_ratio;
use mapper_physics::simulation::model::Model;
use std::collections::BTreeMap;

/// Minimum length of a segment of a speed line, in the line's largest flow and PR - 1. Bound: excludes division by zero, far below 1/200.
const MIN_LENGTH: f64 = 1e-9;

/// The declared rig of a campaign with its tolerances.
#[derive(Debug, Clone, Copy)]
pub struct NominalRig<'a> {
    /// Map, valve and geometry.
    pub model: &'a Model,
    /// One-sigma tolerances.
    pub tolerances: &'a ModelTolerances,
    /// Declared conditions of the rig by channel, SI; empty if they are not compared.
    pub conditions: &'a BTreeMap<Channel, f64>,
}

/// Range about the measured speed in which the map's speed is searched. Bound: beyond it no reading of a speed is in the same unit.
const SPEEDS: (f64, f64) = (0.4, 2.5);
/// Number of positions on a speed line among which the nearest is searched. Bound: their distance is below the roughness of a map.
const PLACES: usize = 200;
/// Extension beyond the surge point, share of the line's PR - 1. Bound: a rig may reach further than its map.
const BEYOND_SURGE: f64 = 0.03;

/// Corrected speed at which a map has a corrected flow at a pressure ratio, rpm; `None` if there is none near the measured one.
pub(crate) fn map_speed_rpm(
    map: &dyn CompressorCharacteristic,
    flow_kg_s: f64,
    pressure_ratio: f64,
    measured_rpm: f64,
) -> Option<f64> {
    let missing_kg_s = |rpm: f64| map.evaluate(rpm, pressure_ratio).flow_corrected_kg_s - flow_kg_s;
    let (low, high) = (SPEEDS.0 * measured_rpm, SPEEDS.1 * measured_rpm);
    (low > 0.0 && missing_kg_s(low) < 0.0 && missing_kg_s(high) > 0.0).then_some(())?;
    Some(bisect(low, high, ROUNDING * measured_rpm, |rpm| missing_kg_s(rpm) < 0.0).0)
}

impl NominalRig<'_> {
    /// Physical speed at which the map has a point's flow and pressure ratio, rpm; `None` if there is none near the measured speed.
    pub(crate) fn speed_rpm(&self, readings: &Readings) -> Option<f64> {
        let map = self.model.map.as_ref();
        let reference = map.reference();
        let flow_kg_s =
            reference.corrected_flow_kg_s(readings.dry_flow_kg_s(), readings.t1_k(), readings.p1_pa());
        let ratio = readings.p2_pa() / readings.p1_pa();
        let measured_rpm = reference.corrected_speed_rpm(readings.speed_rpm(), readings.t1_k());
        let corrected_rpm = map_speed_rpm(map, flow_kg_s, ratio, measured_rpm)?;
        Some(reference.physical_speed_rpm(corrected_rpm, readings.t1_k()))
    }

    /// Efficiency of the map at the nearest position of the speed line. Also its slope along the line, per unit of the line's largest flow and
    /// largest PR - 1. The distance uses flow and pressure ratio together: flow resolves the position near choke, pressure ratio near surge.
    pub(crate) fn efficiency(&self, readings: &Readings) -> Option<(f64, f64)> {
        let map = self.model.map.as_ref();
        let reference = map.reference();
        let corrected_rpm = reference.corrected_speed_rpm(readings.speed_rpm(), readings.t1_k());
        let flow_kg_s =
            reference.corrected_flow_kg_s(readings.dry_flow_kg_s(), readings.t1_k(), readings.p1_pa());
        let (_, top) = map.surge_point(corrected_rpm);
        let largest_kg_s = map.choke_flow_corrected_kg_s(corrected_rpm);
        (top > 1.0 && largest_kg_s > 0.0).then_some(())?;
        let places: Vec<((f64, f64), f64)> = (0..=PLACES)
            .map(|k| {
                let share = (1.0 + BEYOND_SURGE) * k as f64 / PLACES as f64;
                let place = map.evaluate(corrected_rpm, 1.0 + (top - 1.0) * share);
                ((place.flow_corrected_kg_s / largest_kg_s, share), place.efficiency)
            })
            .collect();
        let line: Vec<(f64, f64)> = places.iter().map(|(at, _)| *at).collect();
        let here = (flow_kg_s / largest_kg_s, (readings.p2_pa() / readings.p1_pa() - 1.0) / (top - 1.0));
        let NearestOnPolyline { segment, share_ratio, .. } = NearestOnPolyline::of(&line, here)?;
        let (((ax, ay), a), ((bx, by), b)) = (places[segment], places[segment + 1]);
        Some((a + share_ratio * (b - a), (b - a) / (bx - ax).hypot(by - ay).max(MIN_LENGTH)))
    }
}

// Positions of points on the map, in coordinates in which maps are smooth.
// A speed line is steep near choke and flat near surge, so neither flow nor head orders its points well. The angle in the plane of flow and
// head coefficient orders them at both ends. The efficiencies of a public measured map of 93 points (TurboTools) are a smooth function of it
// to 0.3 points, and of the flow to 1.

/// Scales of the coordinates, taken from the points of a recording.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Places {
    reference: ReferenceState,
    /// Middle and half of the range of corrected speeds, rpm.
    speed_rpm: (f64, f64),
    /// The same of the angles.
    angle: (f64, f64),
    /// Medians of flow and head coefficient.
    middle: (f64, f64),
}

impl Places {
    /// `None` without points, or if a coefficient is not positive.
    pub(crate) fn of(readings: &[Readings], reference: ReferenceState) -> Option<Self> {
        readings.iter().all(is_on_a_map).then_some(())?;
        let middle = (
            median(readings.iter().map(|readings| coefficients(readings).0))?,
            median(readings.iter().map(|readings| coefficients(readings).1))?,
        );
        let mut places = Places { reference, speed_rpm: (0.0, 1.0), angle: (0.0, 1.0), middle };
        places.speed_rpm =
            middle_and_half_range(readings.iter().map(|readings| places.corrected_rpm(readings)));
        places.angle = middle_and_half_range(readings.iter().map(|readings| places.polar(readings).1));
        Some(places)
    }

    fn corrected_rpm(&self, readings: &Readings) -> f64 {
        self.reference.corrected_speed_rpm(readings.speed_rpm(), readings.t1_k())
    }

    /// ln of the distance from the origin of scaled flow and head coefficient, and the angle, rad.
    fn polar(&self, readings: &Readings) -> (f64, f64) {
        let (flow, head) = coefficients(readings);
        let (flow, head) = (flow / self.middle.0, head / self.middle.1);
        (flow.hypot(head).ln(), flow.atan2(head))
    }

    /// ln of the distance from the origin: a smooth function of the position.
    pub(crate) fn ln_distance(&self, readings: &Readings) -> f64 {
        self.polar(readings).0
    }

    /// The position, scaled to the points.
    pub(crate) fn at(&self, readings: &Readings) -> At {
        let corrected_rpm = self.corrected_rpm(readings);
        At {
            speed: (corrected_rpm - self.speed_rpm.0) / self.speed_rpm.1,
            angle: (self.polar(readings).1 - self.angle.0) / self.angle.1,
            slowness: (self.speed_rpm.0 / corrected_rpm).powi(2) - 1.0,
        }
    }
}

/// Whether the coefficients of a point are valid.
pub(crate) fn is_on_a_map(readings: &Readings) -> bool {
    let (flow, head) = coefficients(readings);
    flow > 0.0 && head > 0.0 && (flow + head).is_finite()
}

/// Flow over speed, corrected to the inlet's density, and isentropic temperature rise over speed squared: the dimensionless groups of
/// compressors without their constants.
fn coefficients(readings: &Readings) -> (f64, f64) {
    let (t1_k, speed_rpm) = (readings.t1_k(), readings.speed_rpm());
    let rise_k = t1_k * isentropic_rise_ratio(readings.p2_pa() / readings.p1_pa(), t1_k, readings.air);
    (readings.flow_kg_s() * t1_k / (readings.p1_pa() * speed_rpm), rise_k / (speed_rpm * speed_rpm))
}
