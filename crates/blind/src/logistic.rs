//! A logistic regression with three features and a mild prior.

use mapper_gap::calibration::squash;

/// Iterations of Newton's method at most; it needs some ten.
const ITERATIONS: usize = 100;
/// Precision of the prior on slopes: keeps them finite where the classes do not overlap.
const PRIOR: f64 = 0.5;

/// Offset and slopes of the logistic that tells the rows marked `true` from the others, slopes not negative: more misfit
/// never speaks against an outside cause. Both classes weigh alike. `None` where one of them is empty.
pub(crate) fn logistic(rows: &[([f64; 3], bool)]) -> Option<[f64; 4]> {
    let count = |class: bool| rows.iter().filter(|(_, of)| *of == class).count() as f64;
    let (yes, no) = (count(true), count(false));
    if yes == 0.0 || no == 0.0 {
        return None;
    }
    let half = 0.5 * (yes + no);
    let mut weights = [0.0; 4];
    let loss = |weights: &[f64; 4]| -> f64 {
        let prior = 0.5 * PRIOR * weights[1..].iter().map(|w| w * w).sum::<f64>();
        prior
            + rows
                .iter()
                .map(|(features, class)| {
                    let x = argument(weights, features);
                    let weight = half / if *class { yes } else { no };
                    weight * if *class { (-x).exp().ln_1p() } else { x.exp().ln_1p() }
                })
                .sum::<f64>()
    };
    // Coordinate by coordinate, each by ternary search: four unknowns, a convex loss, and bounds.
    for _ in 0..ITERATIONS {
        let before = weights;
        for place in 0..4 {
            let (mut low, mut high) = if place == 0 { (-30.0, 30.0) } else { (0.0, 10.0) };
            for _ in 0..80 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                let mut at = |value: f64| {
                    weights[place] = value;
                    loss(&weights)
                };
                if at(a) < at(b) { high = b } else { low = a }
            }
            weights[place] = 0.5 * (low + high);
        }
        let moved = weights.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if moved < 1e-6 {
            break;
        }
    }
    Some(weights)
}

fn argument(weights: &[f64; 4], features: &[f64; 3]) -> f64 {
    // Beyond 500 an exponential is infinite.
    let x = weights[0] + weights[1..].iter().zip(features).map(|(w, f)| w * squash(*f)).sum::<f64>();
    x.clamp(-500.0, 500.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two classes told apart by the first feature alone, half way between 2 and 6; the others say nothing.
    #[test]
    fn the_boundary_lies_between_the_classes() {
        let rows: Vec<([f64; 3], bool)> = (0..40)
            .map(|i| ([if i % 2 == 0 { 2.0 } else { 6.0 }, f64::from(i / 2 % 3), 1.0], i % 2 == 1))
            .collect();
        let weights = logistic(&rows).unwrap();
        assert!(argument(&weights, &[2.0, 1.0, 1.0]) < -2.0 && argument(&weights, &[6.0, 1.0, 1.0]) > 2.0);
        assert!(weights[2] < 0.1, "{weights:?}");
        assert!(logistic(&[([1.0; 3], true)]).is_none());
    }
}
