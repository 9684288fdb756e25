//! Positions of points on the map, in coordinates in which maps are smooth.
//!
//! A speed line is steep near choke and flat near surge, so neither flow nor head orders its points well. The angle in the plane of flow and
//! head coefficient orders them at both ends. The efficiencies of a public measured map of 93 points (TurboTools) are a smooth function of it
//! to 0.3 points, and of the flow to 1.

use crate::faults::end_readings::Readings;
use crate::faults::smooth::At;
use crate::joint::step_model::surface::middle_and_half_range;
use mapper_core::ReferenceState;
use mapper_numerics::statistics::median;
use mapper_physics::laws::compression::isentropic_rise_ratio;

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
