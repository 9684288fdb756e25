//! Finds the place on a line nearest to a point, with distances in the line's units.

use crate::map_fit::speed_lines::line_shape::{
    ANGLE_PRECISION_RAD, ANGLE_RANGE_RAD, LineShape, PhysicalPlace,
};

/// Minimum square of a slope by angle. Bound: excludes division by zero at corners.
pub(crate) const MIN_SQUARE_SLOPE: f64 = 1e-12;
/// Shortest step that is tried, rad. Bound: a tenth of the precision.
const MIN_STEP_RAD: f64 = 1e-8;

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

/// Maximum step along the line, rad. Bound: the direction of a line changes little over it.
const MAX_STEP_RAD: f64 = 0.12;
/// Half step of the difference quotients by angle, rad. Bound: between rounding and curvature.
pub(crate) const DIFFERENCE_STEP_RAD: f64 = 1e-5;

/// Finds the nearest place, from `guess_rad` if it is given, else on the whole line.
pub(crate) fn nearest(
    shape: &LineShape,
    speed_ratio: f64,
    (flow_kg_s, pressure_ratio): (f64, f64),
    scales: Scales,
    guess_rad: Option<f64>,
) -> Foot {
    let at = |angle: f64| {
        let place = shape.physical(angle, speed_ratio);
        let offset = (
            (flow_kg_s - place.flow_kg_s) / scales.flow_kg_s,
            (pressure_ratio - place.pressure_ratio) / scales.ratio,
        );
        Trial { place, offset, square: offset.0 * offset.0 + offset.1 * offset.1 }
    };
    let (start, low, high) = match guess_rad {
        Some(guess) => (guess, guess - MAX_STEP_RAD, guess + MAX_STEP_RAD),
        None => search_grid(&|angle| at(angle).square),
    };
    // Gauss-Newton in one variable; a step that does not reduce the distance is halved.
    let mut best = at(start);
    let mut foot = foot_at(shape, speed_ratio, start, &best, scales);
    for _ in 0..8 {
        let (x, y) = best.offset;
        let [sx, sy, _] = foot.slope;
        let length = sx * sx + sy * sy;
        if length.is_nan() || length <= MIN_SQUARE_SLOPE {
            break;
        }
        let mut step = (foot.angle_rad + (x * sx + y * sy) / length).clamp(low, high) - foot.angle_rad;
        let mut trial = at(foot.angle_rad + step);
        while trial.square >= best.square && step.abs() > MIN_STEP_RAD {
            step *= 0.5;
            trial = at(foot.angle_rad + step);
        }
        if trial.square >= best.square {
            break;
        }
        best = trial;
        foot = foot_at(shape, speed_ratio, foot.angle_rad + step, &best, scales);
        if step.abs() < ANGLE_PRECISION_RAD {
            break;
        }
    }
    foot
}

/// A place on the line, with the point's offset from it in scales and the square of their distance.
struct Trial {
    place: PhysicalPlace,
    offset: (f64, f64),
    square: f64,
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
    &Trial { place, offset: (x, y), .. }: &Trial,
    scales: Scales,
) -> Foot {
    let (before, after) = (
        shape.physical(angle_rad - DIFFERENCE_STEP_RAD, speed_ratio),
        shape.physical(angle_rad + DIFFERENCE_STEP_RAD, speed_ratio),
    );
    let slope = [
        (after.flow_kg_s - before.flow_kg_s) / scales.flow_kg_s / (2.0 * DIFFERENCE_STEP_RAD),
        (after.pressure_ratio - before.pressure_ratio) / scales.ratio / (2.0 * DIFFERENCE_STEP_RAD),
        (after.eta - before.eta) / (2.0 * DIFFERENCE_STEP_RAD),
    ];
    let (nx, ny) = normal(&slope);
    Foot { angle_rad, place, slope, distance: x * nx + y * ny }
}

/// Unit vector across the line, outwards (towards more flow and pressure ratio).
pub(crate) fn normal(slope: &[f64; 3]) -> (f64, f64) {
    let length = slope[0].hypot(slope[1]).max(f64::MIN_POSITIVE);
    (slope[1] / length, -slope[0] / length)
}
