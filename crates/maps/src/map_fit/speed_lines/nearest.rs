//! Finds the place on a line nearest to a point, with distances in the line's units.

use crate::map_fit::speed_lines::line_shape::{ANGLE_RANGE_RAD, LineShape, PhysicalPlace};

/// Units of distance of a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scales {
    pub flow_kg_s: f64,
    pub ratio: f64,
}

/// Nearest place to a point (foot of the perpendicular), with the line's direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot {
    pub angle_rad: f64,
    pub place: PhysicalPlace,
    /// Derivatives by angle of scaled flow, scaled pressure ratio, efficiency.
    pub slope: [f64; 3],
    /// Distance with sign, in scales: positive outside the line.
    pub distance: f64,
}

/// Maximum step along the line, rad.
const MAX_STEP_RAD: f64 = 0.12;
/// Half step of the difference quotients by angle, rad.
const DIFFERENCE_STEP_RAD: f64 = 1e-5;

/// Finds the nearest place, from `guess_rad` if it is given, else on the whole line.
pub(crate) fn nearest(
    shape: &LineShape,
    speed_ratio: f64,
    (flow_kg_s, pressure_ratio): (f64, f64),
    scales: Scales,
    guess_rad: Option<f64>,
) -> Foot {
    let offset = |angle: f64| {
        let place = shape.physical(angle, speed_ratio);
        (
            (flow_kg_s - place.flow_kg_s) / scales.flow_kg_s,
            (pressure_ratio - place.pressure_ratio) / scales.ratio,
        )
    };
    let squared = |angle: f64| {
        let (x, y) = offset(angle);
        x * x + y * y
    };
    let (start, low, high) = match guess_rad {
        Some(guess) => (guess, guess - MAX_STEP_RAD, guess + MAX_STEP_RAD),
        None => search_grid(&squared),
    };
    // Gauss-Newton in one variable; a step that does not reduce the distance is halved.
    let mut foot = foot_at(shape, speed_ratio, start, offset, scales);
    let mut min = squared(start);
    for _ in 0..8 {
        let (x, y) = offset(foot.angle_rad);
        let [sx, sy, _] = foot.slope;
        let length = sx * sx + sy * sy;
        if length.is_nan() || length <= 1e-12 {
            break;
        }
        let mut step = (foot.angle_rad + (x * sx + y * sy) / length).clamp(low, high) - foot.angle_rad;
        let mut value = squared(foot.angle_rad + step);
        while value >= min && step.abs() > 1e-8 {
            step *= 0.5;
            value = squared(foot.angle_rad + step);
        }
        if value >= min {
            break;
        }
        min = value;
        foot = foot_at(shape, speed_ratio, foot.angle_rad + step, offset, scales);
        if step.abs() < 1e-7 {
            break;
        }
    }
    foot
}

/// The best angle of ever finer grids over the whole line, with its neighbours on the last grid.
fn search_grid(squared: &impl Fn(f64) -> f64) -> (f64, f64, f64) {
    let (mut low, mut high) = ANGLE_RANGE_RAD;
    let mut best = low;
    // The first grid distinguishes the flat from the steep part.
    for mesh in [48, 10] {
        let step = (high - low) / f64::from(mesh);
        let mut min = f64::INFINITY;
        for i in 0..=mesh {
            let angle = low + step * f64::from(i);
            let value = squared(angle);
            if value < min {
                (min, best) = (value, angle);
            }
        }
        (low, high) = (best - step, best + step);
    }
    (best, low, high)
}

fn foot_at(
    shape: &LineShape,
    speed_ratio: f64,
    angle_rad: f64,
    offset: impl Fn(f64) -> (f64, f64),
    scales: Scales,
) -> Foot {
    let place = shape.physical(angle_rad, speed_ratio);
    let (before, after) = (
        shape.physical(angle_rad - DIFFERENCE_STEP_RAD, speed_ratio),
        shape.physical(angle_rad + DIFFERENCE_STEP_RAD, speed_ratio),
    );
    let slope = [
        (after.flow_kg_s - before.flow_kg_s) / scales.flow_kg_s / (2.0 * DIFFERENCE_STEP_RAD),
        (after.pressure_ratio - before.pressure_ratio) / scales.ratio / (2.0 * DIFFERENCE_STEP_RAD),
        (after.eta - before.eta) / (2.0 * DIFFERENCE_STEP_RAD),
    ];
    let (x, y) = offset(angle_rad);
    let (nx, ny) = normal(&slope);
    Foot { angle_rad, place, slope, distance: x * nx + y * ny }
}

/// Unit vector across the line, outwards (towards more flow and pressure ratio).
pub(crate) fn normal(slope: &[f64; 3]) -> (f64, f64) {
    let length = slope[0].hypot(slope[1]).max(1e-300);
    (slope[1] / length, -slope[0] / length)
}
