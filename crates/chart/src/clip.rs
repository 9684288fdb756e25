//! Clips lines and areas to a rectangle, so that the picture does not depend on the viewer.

/// An axis-parallel rectangle, px: left, top, right, bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub(crate) fn contains(&self, (x, y): (f64, f64)) -> bool {
        // Rounding to hundredths of a pixel.
        let slack = 0.005;
        x >= self.left - slack && x <= self.right + slack && y >= self.top - slack && y <= self.bottom + slack
    }

    pub(crate) fn overlaps(&self, other: &Rect) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    pub(crate) fn width(&self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }
}

/// Whether a segment touches the rectangle.
pub(crate) fn touches(a: (f64, f64), b: (f64, f64), rect: &Rect) -> bool {
    segment(a, b, rect).is_some()
}

/// The part of a segment inside the rectangle (Liang-Barsky).
fn segment(a: (f64, f64), b: (f64, f64), rect: &Rect) -> Option<((f64, f64), (f64, f64))> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (p, q) in
        [(-dx, a.0 - rect.left), (dx, rect.right - a.0), (-dy, a.1 - rect.top), (dy, rect.bottom - a.1)]
    {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            enter = enter.max(q / p);
        } else {
            leave = leave.min(q / p);
        }
    }
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    (enter <= leave)
        .then(|| (if enter > 0.0 { at(enter) } else { a }, if leave < 1.0 { at(leave) } else { b }))
}

/// The pieces of a polyline inside the rectangle; a point that is not finite splits it.
pub(crate) fn polyline(points: &[(f64, f64)], rect: &Rect) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let finite = pair.iter().all(|p| p.0.is_finite() && p.1.is_finite());
        match finite.then(|| segment(pair[0], pair[1], rect)).flatten() {
            Some((from, to)) => {
                match pieces.last_mut() {
                    Some(piece) if joined && from == pair[0] => piece.push(to),
                    _ => pieces.push(vec![from, to]),
                }
                joined = to == pair[1];
            }
            None => joined = false,
        }
    }
    pieces
}

/// The part of a polygon inside the rectangle (Sutherland-Hodgman); points that are not finite are skipped.
pub(crate) fn polygon(points: &[(f64, f64)], rect: &Rect) -> Vec<(f64, f64)> {
    let mut shape: Vec<(f64, f64)> =
        points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    // Signed distance to each side, positive inside.
    let sides: [&dyn Fn((f64, f64)) -> f64; 4] =
        [&|p| p.0 - rect.left, &|p| rect.right - p.0, &|p| p.1 - rect.top, &|p| rect.bottom - p.1];
    for distance in sides {
        let mut out = Vec::with_capacity(shape.len() + 2);
        for (i, p) in shape.iter().enumerate() {
            let previous = shape[(i + shape.len() - 1) % shape.len()];
            let (here, before) = (distance(*p), distance(previous));
            if (here >= 0.0) != (before >= 0.0) {
                let t = before / (before - here);
                out.push((previous.0 + t * (p.0 - previous.0), previous.1 + t * (p.1 - previous.1)));
            }
            if here >= 0.0 {
                out.push(*p);
            }
        }
        shape = out;
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RECT: Rect = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 5.0 };

    #[test]
    fn a_line_that_leaves_and_returns_is_two_pieces() {
        let pieces = polyline(&[(1.0, 1.0), (1.0, 9.0), (9.0, 9.0), (9.0, 1.0)], &RECT);
        assert_eq!(pieces, [vec![(1.0, 1.0), (1.0, 5.0)], vec![(9.0, 5.0), (9.0, 1.0)]]);
        let broken = polyline(&[(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (3.0, 1.0), (4.0, 1.0)], &RECT);
        assert_eq!(broken.len(), 2);
    }

    proptest! {
        #[test]
        fn what_is_left_is_inside(points in proptest::collection::vec((-30.0..30.0f64, -30.0..30.0f64), 0..12)) {
            for p in polyline(&points, &RECT).into_iter().flatten().chain(polygon(&points, &RECT)) {
                prop_assert!(RECT.contains(p), "{p:?}");
            }
        }
    }
}
