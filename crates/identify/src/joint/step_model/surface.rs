//! A smooth efficiency surface over corrected speed and flow, linear in its coefficients.
//!
//! Coordinates are scaled to the points: u is the speed, v the flow divided by a power of the speed fitted to the points, so that equal valve
//! openings have about equal v. At each speed the surface is at most a cubic in v; the remainder is each point's own deviation. Over speed it
//! is a cubic plus a term for small Reynolds numbers and leakage at low speed. A cubic alone lies above the slowest line and below the next
//! one, and biases the points.

use mapper_numerics::statistics::range;

/// Minimum speed, ratio to the middle one. Bound: keeps the reduced flow of a machine at rest finite.
const MIN_SPEED_RATIO: f64 = 1e-3;
/// Minimum range of the points, ratio to its middle. Bound: a single point has a range too.
const MIN_RANGE_RATIO: f64 = 0.1;
/// Minimum variance of ln speed for a slope over it. Bound: speeds within 1 % do not determine one.
const MIN_LN_SPEED_VARIANCE: f64 = 1e-4;

/// Powers of u and v of each term but the last, lowest first, with the prior standard deviation of its coefficient. Judgement: maps bend,
/// but less at higher order (efficiency varies by some 0.3 over a map, |u|, |v| <= 1).
const POWERS: [(i32, i32, f64); TERM_COUNT - 1] = [
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
/// Additional loss of efficiency at small Reynolds numbers and by leakage, fraction: one standard deviation of the last term, which
/// multiplies [`SurfaceScale::slowness`]. Source: published maps fall by 2 to 10 points from their peak to a third of full speed, where
/// it is about 3.
pub(crate) const SLOW_LOSS: f64 = 1e-2;
/// Number of coefficients. Source: the terms of [`POWERS`] and the loss at low speed.
pub(crate) const TERM_COUNT: usize = 12;

/// Position and scale of the surface on the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceScale {
    speed_middle_rpm: f64,
    speed_half_range_rpm: f64,
    flow_exponent: f64,
    middle: f64,
    half_range: f64,
}

/// Corrected speed (rpm) and corrected flow (kg/s).
pub(crate) type Place = (f64, f64);

impl SurfaceScale {
    /// Scales for the positions of the points; `None` for no points, or positions that are not positive.
    pub(crate) fn of(places: &[Place]) -> Option<Self> {
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
        Some(SurfaceScale { speed_middle_rpm, speed_half_range_rpm, flow_exponent, middle, half_range })
    }

    /// Speed and flow scaled to the points, -1 to 1.
    pub(crate) fn coordinates(&self, (speed_rpm, flow_kg_s): Place) -> (f64, f64) {
        let u = (speed_rpm - self.speed_middle_rpm) / self.speed_half_range_rpm;
        let reduced =
            flow_kg_s / (speed_rpm / self.speed_middle_rpm).max(MIN_SPEED_RATIO).powf(self.flow_exponent);
        (u, (reduced - self.middle) / self.half_range)
    }

    /// Square of the ratio of middle speed to speed, minus 1.
    pub(crate) fn slowness(&self, (speed_rpm, _): Place) -> f64 {
        (self.speed_middle_rpm / speed_rpm).powi(2) - 1.0
    }

    /// The terms at a position.
    pub(crate) fn terms(&self, place: Place) -> [f64; TERM_COUNT] {
        let (u, v) = self.coordinates(place);
        with_last(POWERS.map(|(i, j, _)| u.powi(i) * v.powi(j)), self.slowness(place))
    }

    /// Slope of the terms by the relative change of the flow.
    pub(crate) fn by_ln_flow(&self, place: Place) -> [f64; TERM_COUNT] {
        let (u, v) = self.coordinates(place);
        let by_ln_flow = v + self.middle / self.half_range;
        let slope = |(i, j, _): (i32, i32, f64)| {
            if j == 0 { 0.0 } else { u.powi(i) * f64::from(j) * v.powi(j - 1) * by_ln_flow }
        };
        with_last(POWERS.map(slope), 0.0)
    }

    /// Prior standard deviations of the coefficients.
    pub(crate) fn prior_sigmas() -> [f64; TERM_COUNT] {
        with_last(POWERS.map(|(_, _, sigma)| sigma), SLOW_LOSS)
    }
}

/// Middle and half of the range. The range is at least a tenth of the middle, so that a single point has one.
pub(crate) fn middle_and_half_range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = range(values);
    let middle = 0.5 * (low + high);
    (middle, (0.5 * (high - low)).max(0.5 * MIN_RANGE_RATIO * middle))
}

/// Slope of ln flow over ln speed; 1 if the points do not determine one.
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
    if xx > MIN_LN_SPEED_VARIANCE * n { (xy / xx).clamp(0.5, 2.0) } else { 1.0 }
}

fn with_last(first: [f64; TERM_COUNT - 1], last: f64) -> [f64; TERM_COUNT] {
    std::array::from_fn(|k| first.get(k).copied().unwrap_or(last))
}

pub(crate) fn dot(a: &[f64; TERM_COUNT], b: &[f64; TERM_COUNT]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    #[test]
    fn the_slope_by_the_flow_is_a_derivative() {
        let places = [(50e3, 0.02), (80e3, 0.05), (120e3, 0.06), (155e3, 0.11)];
        let scale = SurfaceScale::of(&places).unwrap();
        let step = 1e-6;
        for (speed_rpm, flow_kg_s) in places {
            let at = |by: f64| scale.terms((speed_rpm, flow_kg_s * (1.0 + by)));
            let (low, high, slope) = (at(-step), at(step), scale.by_ln_flow((speed_rpm, flow_kg_s)));
            for k in 0..TERM_COUNT {
                let expected = (high[k] - low[k]) / (2.0 * step);
                assert!(
                    (slope[k] - expected).abs() < 1e-6 * (1.0 + expected.abs()),
                    "{k}: {} {expected}",
                    slope[k]
                );
            }
        }
    }

    /// Published maps fall by 2 to 10 points towards a third of full speed, about as one over the speed squared. With half a point per step,
    /// as in short steps, the surface follows a fall of 6 to within 0.12 points; a cubic alone is off by 0.18 at the second line.
    #[test]
    fn a_loss_at_low_speed_is_followed() {
        const OWN: f64 = 5e-3;
        let speeds_krpm = [50.0, 65.0, 80.0, 95.0, 110.0, 125.0, 140.0, 155.0_f64];
        let places: Vec<Place> = speeds_krpm
            .iter()
            .flat_map(|n| [0.6, 0.7, 0.8, 0.9, 1.0, 1.1].map(|v| (n * 1e3, 1e-3 * n * v)))
            .collect();
        let scale = SurfaceScale::of(&places).unwrap();
        let loss = |speed_rpm: f64| 0.06 * ((50e3 / speed_rpm).powi(2) - (50.0_f64 / 155.0).powi(2));
        let priors = SurfaceScale::prior_sigmas();
        let mut normal =
            SMatrix::<f64, TERM_COUNT, TERM_COUNT>::from_diagonal(&SVector::from(priors.map(|s| s.powi(-2))));
        let mut right = SVector::<f64, TERM_COUNT>::zeros();
        for place in &places {
            let terms = SVector::from(scale.terms(*place));
            normal += terms * terms.transpose() / (OWN * OWN);
            right -= terms * loss(place.0) / (OWN * OWN);
        }
        let coefficients = normal.cholesky().unwrap().solve(&right).into();
        for (speed_rpm, flow_kg_s) in places {
            let off = dot(&scale.terms((speed_rpm, flow_kg_s)), &coefficients) + loss(speed_rpm);
            assert!(off.abs() < 1.2e-3, "{speed_rpm} rpm, {flow_kg_s} kg/s: {off}");
        }
    }
}
