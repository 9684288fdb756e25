//! Monotone cubic interpolation: it stays between neighbouring values.
//!
//! Source: F. N. Fritsch, J. Butland, "A method for constructing local monotone piecewise cubic interpolants",
//! SIAM J. Sci. Stat. Comput. 5 (1984) 300-304; the harmonic mean of neighbouring slopes, one-sided ends.

/// An interpolant through points with strictly rising abscissae.
pub(crate) struct Monotone<'a> {
    x: &'a [f64],
    y: &'a [f64],
    slopes: Vec<f64>,
}

impl<'a> Monotone<'a> {
    /// `None` for fewer than two points, or if `x` does not rise strictly or is not as long as `y`.
    pub(crate) fn new(x: &'a [f64], y: &'a [f64]) -> Option<Self> {
        if x.len() < 2 || x.len() != y.len() || !x.windows(2).all(|w| w[1] > w[0]) {
            return None;
        }
        let secants: Vec<f64> = (1..x.len()).map(|i| (y[i] - y[i - 1]) / (x[i] - x[i - 1])).collect();
        let n = x.len();
        let slopes = (0..n)
            .map(|i| match i {
                0 => end_slope(x, &secants, 0, 1),
                i if i == n - 1 => end_slope(x, &secants, n - 2, n.saturating_sub(3)),
                _ => inner_slope(x[i] - x[i - 1], x[i + 1] - x[i], secants[i - 1], secants[i]),
            })
            .collect();
        Some(Monotone { x, y, slopes })
    }

    /// Value at `at`; `None` outside the points.
    pub(crate) fn at(&self, at: f64) -> Option<f64> {
        let last = self.x.len() - 1;
        if !(at >= self.x[0] && at <= self.x[last]) {
            return None;
        }
        let i = self.x.partition_point(|x| *x <= at).clamp(1, last) - 1;
        let width = self.x[i + 1] - self.x[i];
        let t = (at - self.x[i]) / width;
        let (a, b) = (self.y[i], self.y[i + 1]);
        let (da, db) = (self.slopes[i] * width, self.slopes[i + 1] * width);
        let (t2, t3) = (t * t, t * t * t);
        Some(
            (2.0 * t3 - 3.0 * t2 + 1.0) * a
                + (t3 - 2.0 * t2 + t) * da
                + (3.0 * t2 - 2.0 * t3) * b
                + (t3 - t2) * db,
        )
    }
}

fn inner_slope(before: f64, after: f64, left: f64, right: f64) -> f64 {
    if left * right <= 0.0 {
        return 0.0;
    }
    let (w1, w2) = (2.0 * after + before, after + 2.0 * before);
    (w1 + w2) / (w1 / left + w2 / right)
}

/// Three-point slope at an end, limited so that the end stays monotone.
fn end_slope(x: &[f64], secants: &[f64], near: usize, far: usize) -> f64 {
    if secants.len() < 2 {
        return secants[near];
    }
    let width = |i: usize| x[i + 1] - x[i];
    let (h0, h1, d0, d1) = (width(near), width(far), secants[near], secants[far]);
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    if slope * d0 <= 0.0 {
        0.0
    } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_straight_line_is_met_exactly() {
        let (x, y) = ([0.0, 1.0, 4.0, 5.0], [1.0, 3.0, 9.0, 11.0]);
        let curve = Monotone::new(&x, &y).unwrap();
        for at in [0.0, 0.3, 2.0, 4.9, 5.0] {
            assert!((curve.at(at).unwrap() - (1.0 + 2.0 * at)).abs() < 1e-12);
        }
        assert_eq!(curve.at(5.1), None);
        assert_eq!(curve.at(f64::NAN), None);
        assert!(Monotone::new(&[0.0, 0.0], &[1.0, 2.0]).is_none());
    }

    proptest! {
        #[test]
        fn it_meets_the_points_and_stays_between_neighbours(steps in proptest::collection::vec((0.01..2.0f64, -1.0..1.0f64), 2..9), t in 0.0..1.0f64) {
            let mut at = 0.0;
            let (x, y): (Vec<f64>, Vec<f64>) = steps.iter().map(|(dx, y)| { at += dx; (at, *y) }).unzip();
            let curve = Monotone::new(&x, &y).unwrap();
            for i in 0..x.len() {
                prop_assert!((curve.at(x[i]).unwrap() - y[i]).abs() < 1e-12);
            }
            for i in 1..x.len() {
                let value = curve.at((x[i - 1] + t * (x[i] - x[i - 1])).min(x[i])).unwrap();
                let (low, high) = (y[i - 1].min(y[i]), y[i - 1].max(y[i]));
                prop_assert!(value >= low - 1e-9 && value <= high + 1e-9);
            }
        }
    }
}
