//! The fast variation of a channel at one opening, without its slow drift.

/// Length of the segments that are detrended by a straight line, s. Drift is not due to surge, and slow sampling may fold fast
/// oscillations to low frequencies.
const SEGMENT_S: f64 = 5.0;
const MIN_SAMPLES: usize = 10;
/// Maximum lag of the autocorrelation, in samples; smaller than a segment.
const MAX_LAG_SAMPLES: usize = 6;
const MIN_SEGMENTS: usize = 1;

/// A variance with its degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// Variance, square of the channel's unit.
    pub variance: f64,
    /// Number of independent degrees of freedom with the same accuracy.
    pub degrees_of_freedom: f64,
}

impl Variation {
    /// The variation of samples; `None` if there are too few.
    pub fn of(t_s: &[f64], values: &[f64]) -> Option<Self> {
        let first_s = *t_s.first()?;
        let mut segments: Vec<Vec<f64>> = Vec::new();
        let mut from = 0;
        while from < t_s.len() {
            let segment = ((t_s[from] - first_s) / SEGMENT_S).floor();
            let count =
                t_s[from..].partition_point(|t| ((t - first_s) / SEGMENT_S).floor() <= segment).max(1);
            let to = from + count;
            if count >= MIN_SAMPLES {
                segments.push(detrend(&t_s[from..to], &values[from..to]));
            }
            from = to;
        }
        if segments.len() < MIN_SEGMENTS {
            return None;
        }
        let samples = segments.iter().map(Vec::len).sum::<usize>() as f64;
        let freedom = samples - 2.0 * segments.len() as f64;
        let lagged = |lag: usize| -> f64 {
            segments.iter().flat_map(|segment| segment.iter().zip(&segment[lag..]).map(|(a, b)| a * b)).sum()
        };
        let square = lagged(0);
        // Bartlett: correlated samples add less information about the variance. Chance alone makes the square of a
        // correlation 1/n.
        let memory: f64 =
            (1..=MAX_LAG_SAMPLES).map(|lag| ((lagged(lag) / square).powi(2) - 1.0 / samples).max(0.0)).sum();
        (square > 0.0).then_some(Variation {
            variance: square / freedom,
            degrees_of_freedom: freedom / (1.0 + 2.0 * memory),
        })
    }
}

/// Residual of the samples about their regression line.
fn detrend(t_s: &[f64], values: &[f64]) -> Vec<f64> {
    let count = t_s.len() as f64;
    let middle_s = t_s.iter().sum::<f64>() / count;
    let level = values.iter().sum::<f64>() / count;
    let (mut across, mut along) = (0.0, 0.0);
    for (t, value) in t_s.iter().zip(values) {
        across += (t - middle_s) * (value - level);
        along += (t - middle_s).powi(2);
    }
    let slope = if along > 0.0 { across / along } else { 0.0 };
    t_s.iter().zip(values).map(|(t, value)| value - level - slope * (t - middle_s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn a_drift_of_the_mean_does_not_change_the_fast_variance() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 0.5).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let values: Vec<f64> = t_s.iter().map(|t| 100.0 + 0.05 * t + normal.sample(&mut random)).collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // 3840 degrees of freedom determine a variance to 2.3 %.
        assert!((found.variance / 0.25 - 1.0).abs() < 0.08, "{found:?}");
        assert!((3500.0..=3840.0).contains(&found.degrees_of_freedom), "{found:?}");
        assert_eq!(Variation::of(&t_s[..9], &values[..9]), None);
    }

    #[test]
    fn correlated_samples_have_fewer_degrees_of_freedom() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let mut now = 0.0;
        let values: Vec<f64> = t_s
            .iter()
            .map(|_| {
                now = -0.6 * now + 0.8 * normal.sample(&mut random);
                now
            })
            .collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // Bartlett's formula: 1 + 2 sum 0.36^k = 2.12.
        assert!((found.degrees_of_freedom / (3840.0 / 2.12) - 1.0).abs() < 0.15, "{found:?}");
    }
}
