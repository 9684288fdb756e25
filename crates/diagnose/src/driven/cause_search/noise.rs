//! White sensor noise plus correlated model error: whitens residuals, and draws the model error.
//!
//! The model error is a first-order process observed through white noise; the Kalman filter's innovations divided by their spread are
//! independent with unit variance. The gains depend only on times and spreads, so they are computed once and used for residuals and slopes.

/// Filter gains for one channel.
#[derive(Debug, Clone)]
pub(crate) struct Whitening {
    /// For each row: decay of the state since the previous row, and, if the row is used, gain and inverse spread of the innovation.
    rows: Vec<(f64, Option<(f64, f64)>)>,
    /// Sum of the log spreads of the innovations.
    pub(crate) ln_spreads: f64,
}

impl Whitening {
    /// For rows at `t_s`, of which `used` count; standard deviations of the white and the correlated noise, and its correlation time, s.
    pub(crate) fn new(t_s: &[f64], used: &[bool], white: f64, correlated: f64, correlation_s: f64) -> Self {
        let (white, correlated) = (white.max(1e-6).powi(2), correlated.powi(2));
        let mut variance = correlated;
        let mut ln_spreads = 0.0;
        let mut before_s: Option<f64> = None;
        let rows = t_s
            .iter()
            .zip(used)
            .map(|(t_s, used)| {
                let keep = before_s.map_or(0.0, |before_s| (-(t_s - before_s) / correlation_s).exp());
                before_s = Some(*t_s);
                variance = keep * keep * variance + (1.0 - keep * keep) * correlated;
                if !used {
                    return (keep, None);
                }
                let spread = variance + white;
                let gain = variance / spread;
                variance *= 1.0 - gain;
                ln_spreads += 0.5 * spread.ln();
                (keep, Some((gain, 1.0 / spread.sqrt())))
            })
            .collect();
        Whitening { rows, ln_spreads }
    }

    /// Whitens a column in place: unused rows become 0.
    pub(crate) fn whiten(&self, column: &mut [f64]) {
        let mut state = 0.0;
        for (value, (keep, row)) in column.iter_mut().zip(&self.rows) {
            state *= keep;
            *value = match row {
                Some((gain, over_spread)) => {
                    let innovation = *value - state;
                    state += gain * innovation;
                    innovation * over_spread
                }
                None => 0.0,
            };
        }
    }
}

/// First-order noise along the rows of a log.
pub(crate) struct CorrelatedNoise {
    sigma: f64,
    correlation_s: f64,
    /// Time, s, and value of the previous row.
    last: Option<(f64, f64)>,
}

impl CorrelatedNoise {
    pub(crate) fn new(sigma: f64, correlation_s: f64) -> Self {
        CorrelatedNoise { sigma, correlation_s, last: None }
    }

    /// The noise at the next row, from a standard normal number.
    pub(crate) fn next(&mut self, t_s: f64, z: f64) -> f64 {
        let (keep, before) =
            self.last.map_or((0.0, 0.0), |(at_s, noise)| ((-(t_s - at_s) / self.correlation_s).exp(), noise));
        let noise = keep * before + self.sigma * (1.0 - keep * keep).sqrt() * z;
        self.last = Some((t_s, noise));
        noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Compared with the dense covariance `smooth^2 exp(-|dt|/alike) + white^2`: the same quadratic form and determinant.
    #[test]
    fn it_is_the_dense_covariance() {
        let t_s = [0.0, 0.1, 0.35, 0.4, 2.0, 2.1, 7.0];
        let counts = [true, true, false, true, true, false, true];
        let (white, smooth, alike_s) = (0.2, 0.7, 1.5);
        let column = [0.3, -0.2, 9.0, 0.5, 1.1, 9.0, -0.4];
        let seen: Vec<usize> = (0..t_s.len()).filter(|i| counts[*i]).collect();
        let covariance = DMatrix::from_fn(seen.len(), seen.len(), |i, j| {
            let apart: f64 = t_s[seen[i]] - t_s[seen[j]];
            smooth * smooth * (-apart.abs() / alike_s).exp() + if i == j { white * white } else { 0.0 }
        });
        let values = DMatrix::from_fn(seen.len(), 1, |i, _| column[seen[i]]);
        let inverse = covariance.clone().try_inverse().unwrap();
        let expected = (values.transpose() * inverse * &values)[(0, 0)];
        let whitening = Whitening::new(&t_s, &counts, white, smooth, alike_s);
        let mut white_column = column;
        whitening.whiten(&mut white_column);
        let squares: f64 = white_column.iter().map(|w| w * w).sum();
        assert!((squares / expected - 1.0).abs() < 1e-12, "{squares} {expected}");
        assert!((whitening.ln_spreads - 0.5 * covariance.determinant().ln()).abs() < 1e-12);
    }
}
