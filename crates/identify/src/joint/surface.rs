//! A smooth efficiency surface over corrected speed and flow, linear in its coefficients.
//!
//! Coordinates are scaled to the points: u is the speed, v the flow over a power of the speed that the points themselves
//! give, so that equal valve openings have about equal v. At each speed the surface is a cubic in v at most; whatever it
//! cannot follow remains each point's own deviation.

use mapper_core::ReferenceState;
use mapper_physics::efficiency_shape::EfficiencyShape;

/// Powers of u and v of each term, lowest first, with the standard deviation that its coefficient is given beforehand:
/// maps bend, but the higher the order the less (efficiency varies by some 0.3 over a map, |u|, |v| <= 1).
const TERMS: [(i32, i32, f64); TERM_COUNT] = [
    (0, 0, 1.0),
    (1, 0, 0.3),
    (0, 1, 0.3),
    (2, 0, 0.2),
    (1, 1, 0.2),
    (0, 2, 0.2),
    (1, 2, 0.1),
    (2, 1, 0.1),
    (3, 0, 0.1),
    (0, 3, 0.05),
    (2, 2, 0.05),
];
/// Number of coefficients.
pub(crate) const TERM_COUNT: usize = 11;

/// Where on the map the surface lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceScale {
    pub(crate) reference: ReferenceState,
    speed_middle_rpm: f64,
    speed_half_range_rpm: f64,
    flow_exponent: f64,
    middle: f64,
    half_range: f64,
}

/// Corrected speed (rpm) and corrected flow (kg/s).
pub(crate) type Place = (f64, f64);

impl SurfaceScale {
    /// Scales to the places of the points; `None` for none, or places that are not positive.
    pub(crate) fn of(places: &[Place], reference: ReferenceState) -> Option<Self> {
        let usable = |x: f64| x.is_finite() && x > 0.0;
        if places.is_empty() || !places.iter().all(|(speed, flow)| usable(*speed) && usable(*flow)) {
            return None;
        }
        let (speed_middle_rpm, speed_half_range_rpm) =
            middle_and_half_range(places.iter().map(|place| place.0));
        let flow_exponent = exponent(places);
        let reduced =
            places.iter().map(|(speed, flow)| flow / (speed / speed_middle_rpm).powf(flow_exponent));
        let (middle, half_range) = middle_and_half_range(reduced);
        Some(SurfaceScale {
            reference,
            speed_middle_rpm,
            speed_half_range_rpm,
            flow_exponent,
            middle,
            half_range,
        })
    }

    /// Speed and flow scaled to the points, -1 to 1.
    pub(crate) fn coordinates(&self, (speed_rpm, flow_kg_s): Place) -> (f64, f64) {
        let u = (speed_rpm - self.speed_middle_rpm) / self.speed_half_range_rpm;
        let reduced = flow_kg_s / (speed_rpm / self.speed_middle_rpm).max(1e-3).powf(self.flow_exponent);
        (u, (reduced - self.middle) / self.half_range)
    }

    /// Square of the middle speed over the speed, less 1.
    pub(crate) fn slowness(&self, (speed_rpm, _): Place) -> f64 {
        (self.speed_middle_rpm / speed_rpm).powi(2) - 1.0
    }

    /// The terms at a place.
    pub(crate) fn terms(&self, place: Place) -> [f64; TERM_COUNT] {
        let (u, v) = self.coordinates(place);
        TERMS.map(|(i, j, _)| u.powi(i) * v.powi(j))
    }

    /// Standard deviations of the coefficients beforehand.
    pub(crate) fn prior_sigmas() -> [f64; TERM_COUNT] {
        TERMS.map(|(_, _, sigma)| sigma)
    }
}

/// Middle and half of the range; a range of a tenth of the middle at least, so that a single point has one.
fn middle_and_half_range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let middle = 0.5 * (low + high);
    (middle, (0.5 * (high - low)).max(0.05 * middle))
}

/// Slope of ln flow over ln speed, 1 where the points do not give one.
fn exponent(places: &[Place]) -> f64 {
    let n = places.len() as f64;
    let (mut x, mut y) = (0.0, 0.0);
    for (speed, flow) in places {
        x += speed.ln() / n;
        y += flow.ln() / n;
    }
    let (mut xx, mut xy) = (0.0, 0.0);
    for (speed, flow) in places {
        xx += (speed.ln() - x).powi(2);
        xy += (speed.ln() - x) * (flow.ln() - y);
    }
    if xx > 1e-4 * n { (xy / xx).clamp(0.5, 2.0) } else { 1.0 }
}

/// The surface with its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct EfficiencySurface {
    pub(crate) scale: SurfaceScale,
    pub(crate) coefficients: [f64; TERM_COUNT],
}

impl EfficiencyShape for EfficiencySurface {
    fn efficiency(&self, speed_corrected_rpm: f64, flow_corrected_kg_s: f64) -> f64 {
        dot(&self.scale.terms((speed_corrected_rpm, flow_corrected_kg_s)), &self.coefficients)
    }
}

pub(crate) fn dot(a: &[f64; TERM_COUNT], b: &[f64; TERM_COUNT]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
