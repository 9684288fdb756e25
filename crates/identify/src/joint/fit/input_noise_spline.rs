//! The sum of squares that noise in the model's inputs adds, as a function of the probe's lag: a natural cubic spline over the squares of
//! diameters. `input_noise.rs` computes its values.

/// Expected sum of squares as a function of the square of the diameter.
#[derive(Debug, Clone, Default)]
pub(crate) struct InputNoiseSpline {
    /// Knots, with the values and the second derivatives of the spline.
    squares_mm2: Vec<f64>,
    sums: Vec<f64>,
    curvatures: Vec<f64>,
    /// Variance of the slope between knots over the noise sequences.
    slope_variances: Vec<f64>,
}

impl InputNoiseSpline {
    /// Builds the spline from the sums of each noise sequence at increasing squares of diameters, mm2.
    pub(crate) fn new(squares_mm2: Vec<f64>, draws: &[Vec<f64>]) -> Self {
        let count = (draws.len() as f64).max(1.0);
        let sums: Vec<f64> =
            (0..squares_mm2.len()).map(|i| draws.iter().map(|draw| draw[i]).sum::<f64>() / count).collect();
        let slope_variances = (1..squares_mm2.len())
            .map(|i| {
                let width = squares_mm2[i] - squares_mm2[i - 1];
                let mean = (sums[i] - sums[i - 1]) / width;
                let off = |draw: &Vec<f64>| ((draw[i] - draw[i - 1]) / width - mean).powi(2);
                draws.iter().map(off).sum::<f64>() / (count - 1.0).max(1.0) * (1.0 + 1.0 / count)
            })
            .collect();
        let n = squares_mm2.len();
        let mut curvatures = vec![0.0; n];
        let mut carried = vec![0.0; n];
        for i in 1..n.saturating_sub(1) {
            let (before, after) = (squares_mm2[i] - squares_mm2[i - 1], squares_mm2[i + 1] - squares_mm2[i]);
            let share = before / (before + after);
            let p = share * curvatures[i - 1] + 2.0;
            curvatures[i] = (share - 1.0) / p;
            let bend = (sums[i + 1] - sums[i]) / after - (sums[i] - sums[i - 1]) / before;
            carried[i] = (6.0 * bend / (before + after) - share * carried[i - 1]) / p;
        }
        for i in (0..n.saturating_sub(1)).rev() {
            curvatures[i] = curvatures[i] * curvatures[i + 1] + carried[i];
        }
        InputNoiseSpline { squares_mm2, sums, curvatures, slope_variances }
    }

    /// Variance of half the slope: the effect of the recording's own noise on the probe, in addition to least squares.
    pub(crate) fn half_slope_variance(&self, square_mm2: f64) -> f64 {
        let after = self.squares_mm2.partition_point(|knot| *knot <= square_mm2);
        let segment = after.saturating_sub(1).min(self.slope_variances.len().saturating_sub(1));
        0.25 * self.slope_variances.get(segment).copied().unwrap_or(0.0)
    }

    /// Value and slope at the square of a diameter, mm2.
    pub(crate) fn at(&self, square_mm2: f64) -> (f64, f64) {
        let (Some(first), Some(last)) = (self.squares_mm2.first(), self.squares_mm2.last()) else {
            return (0.0, 0.0);
        };
        let x = square_mm2.clamp(*first, *last);
        let i = self.squares_mm2.partition_point(|knot| *knot <= x).clamp(1, self.squares_mm2.len() - 1);
        let width = self.squares_mm2[i] - self.squares_mm2[i - 1];
        let (a, b) = ((self.squares_mm2[i] - x) / width, (x - self.squares_mm2[i - 1]) / width);
        let (low, high) = (self.curvatures[i - 1], self.curvatures[i]);
        let value = a * self.sums[i - 1]
            + b * self.sums[i]
            + ((a * a * a - a) * low + (b * b * b - b) * high) * width * width / 6.0;
        let slope = (self.sums[i] - self.sums[i - 1]) / width
            + ((3.0 * b * b - 1.0) * high - (3.0 * a * a - 1.0) * low) * width / 6.0;
        if square_mm2 > *last { (value, 0.0) } else { (value, slope) }
    }
}
