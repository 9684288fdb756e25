//! The nearest point of a polyline.

/// The nearest point of a polyline to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestOnPolyline {
    /// Index of the segment, which is that of its first vertex.
    pub segment: usize,
    /// Position within the segment, 0 at its start and 1 at its end, ratio.
    pub share_ratio: f64,
    /// Distance between the two points, in the unit of the coordinates.
    pub distance: f64,
    /// Whether the given point lies beyond the first or last vertex, which is then the nearest point.
    pub beyond_end: bool,
}

impl NearestOnPolyline {
    /// The point of the polyline through `vertices` that is nearest to `point`, the first one of several. `None` for fewer than two
    /// vertices or NaN coordinates.
    pub fn of(vertices: &[(f64, f64)], point: (f64, f64)) -> Option<Self> {
        /// Distance beyond an end, in its segment's length, that is no distance. Bound: rounding error.
        const TOLERANCE: f64 = 1e-6;
        /// Minimum square of a segment's length. Bound: excludes division by zero for vertices that coincide.
        const MIN_SQUARE: f64 = 1e-30;
        let last = vertices.len().checked_sub(2)?;
        let nearest_in = |(segment, pair): (usize, &[(f64, f64)])| {
            let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
            let (dx, dy) = (bx - ax, by - ay);
            let share = ((point.0 - ax) * dx + (point.1 - ay) * dy) / (dx * dx + dy * dy).max(MIN_SQUARE);
            let share_ratio = share.clamp(0.0, 1.0);
            let distance = (point.0 - ax - share_ratio * dx).hypot(point.1 - ay - share_ratio * dy);
            let beyond_end =
                (segment == 0 && share < -TOLERANCE) || (segment == last && share > 1.0 + TOLERANCE);
            NearestOnPolyline { segment, share_ratio, distance, beyond_end }
        };
        let places = vertices.windows(2).enumerate().map(nearest_in).filter(|place| !place.distance.is_nan());
        places.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the nearest of a million places counted along the line.
    #[test]
    fn it_is_the_nearest_of_all_places() {
        let line = [(0.0, 0.0), (1.0, 0.5), (1.5, 2.0), (0.5, 2.5)];
        for point in [(0.3, 0.9), (2.0, 1.0), (-1.0, -1.0), (0.2, 3.0), (1.0, 0.5)] {
            let found = NearestOnPolyline::of(&line, point).unwrap();
            let counted = (0..3_000_000)
                .map(|k| {
                    let (segment, share) = (k / 1_000_000, f64::from(k % 1_000_000) / 999_999.0);
                    let (a, b) = (line[segment as usize], line[segment as usize + 1]);
                    (a.0 + share * (b.0 - a.0) - point.0).hypot(a.1 + share * (b.1 - a.1) - point.1)
                })
                .fold(f64::INFINITY, f64::min);
            assert!((found.distance - counted).abs() < 1e-6, "{point:?}: {found:?} and {counted}");
        }
        assert!(NearestOnPolyline::of(&line, (-1.0, -1.0)).unwrap().beyond_end);
        assert!(!NearestOnPolyline::of(&line, (1.2, 0.4)).unwrap().beyond_end);
        assert_eq!(NearestOnPolyline::of(&line[..1], (0.0, 0.0)), None);
        assert_eq!(NearestOnPolyline::of(&line, (f64::NAN, 0.0)), None);
    }
}
