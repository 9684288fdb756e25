//! How much a channel varies at one opening: fast, with the slow part taken out.

use mapper_numerics::statistics::mean;

/// Length of the pieces in which a straight line is taken out, s: drift and slow noise are none of surge's.
const PIECE_S: f64 = 2.0;
/// Fewest samples of a piece that counts.
const LEAST_SAMPLES: usize = 8;
/// Fewest pieces.
const LEAST_PIECES: usize = 3;

/// A variance with how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// Variance over the square of the mean.
    pub variance_ratio: f64,
    /// Degrees of freedom of independent samples that would know it as well.
    pub degrees_of_freedom: f64,
}

impl Variation {
    /// The variation of samples; `None` where they are too few.
    pub fn of(t_s: &[f64], values: &[f64]) -> Option<Self> {
        let level = mean(values).filter(|level| *level > 0.0)?;
        let first_s = *t_s.first()?;
        let mut pieces: Vec<(f64, f64)> = Vec::new();
        let mut from = 0;
        while from < t_s.len() {
            let piece = ((t_s[from] - first_s) / PIECE_S).floor();
            let count = t_s[from..].partition_point(|t| ((t - first_s) / PIECE_S).floor() <= piece).max(1);
            let to = from + count;
            if count >= LEAST_SAMPLES {
                let freedom = (count - 2) as f64;
                pieces.push((about_a_line(&t_s[from..to], &values[from..to]) / freedom, freedom));
            }
            from = to;
        }
        if pieces.len() < LEAST_PIECES {
            return None;
        }
        let freedom: f64 = pieces.iter().map(|piece| piece.1).sum();
        let variance = pieces.iter().map(|piece| piece.0 * piece.1).sum::<f64>() / freedom;
        // An oscillation that dies away slowly varies from piece to piece by more than independent samples do.
        let scatter = pieces.iter().map(|piece| (piece.0 - variance).powi(2)).sum::<f64>()
            / (pieces.len() - 1) as f64
            / (variance * variance);
        let independent = 2.0 * pieces.len() as f64 / freedom;
        let inflation_ratio = (scatter / independent).max(1.0);
        (variance > 0.0).then_some(Variation {
            variance_ratio: variance / (level * level),
            degrees_of_freedom: freedom / inflation_ratio,
        })
    }
}

/// Sum of squares about the straight line through the samples.
fn about_a_line(t_s: &[f64], values: &[f64]) -> f64 {
    let count = t_s.len() as f64;
    let middle_s = t_s.iter().sum::<f64>() / count;
    let level = values.iter().sum::<f64>() / count;
    let (mut square, mut slope, mut along) = (0.0, 0.0, 0.0);
    for (t, value) in t_s.iter().zip(values) {
        let (t, value) = (t - middle_s, value - level);
        square += value * value;
        slope += t * value;
        along += t * t;
    }
    if along > 0.0 { (square - slope * slope / along).max(0.0) } else { square }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn the_fast_variance_is_found_whatever_the_mean_does() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 0.5).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let values: Vec<f64> = t_s.iter().map(|t| 100.0 + 0.05 * t + normal.sample(&mut random)).collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // Mean 110; 3600 degrees of freedom know a variance to 2.4 %.
        assert!((found.variance_ratio / (0.25 / 110.0f64.powi(2)) - 1.0).abs() < 0.08, "{found:?}");
        assert!((2500.0..=3600.0).contains(&found.degrees_of_freedom), "{found:?}");
        assert_eq!(Variation::of(&t_s[..50], &values[..50]), None);
    }

    #[test]
    fn what_comes_in_bursts_is_known_less_well() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let t_s: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.1).collect();
        let burst = |t: f64| if (t / 8.0).fract() < 0.25 { 2.0 } else { 0.2 };
        let values: Vec<f64> = t_s.iter().map(|t| 50.0 + burst(*t) * normal.sample(&mut random)).collect();
        assert!(Variation::of(&t_s, &values).unwrap().degrees_of_freedom < 100.0);
    }
}
