//! A logistic regression with three features, that a few cases move a little.

use mapper_gap::calibration::squash;
use mapper_numerics::minimise::minimise;

/// Rounds of coordinate descent at most; it needs some twenty.
const ROUNDS: usize = 100;
/// Precision of the prior on slopes, which stands at those of before.
const PRIOR: f64 = 1.0;

/// Offset and slopes of the logistic that tells the rows marked `true` from the others, as far as they say otherwise than
/// `before`. Slopes are not negative: more misfit never speaks against an outside cause. The last slope, of the gain of one
/// more effect, stays: the largest of two dozen gains scatters too widely for the number of cases that anybody runs. `None`
/// where one of the classes is empty.
pub(crate) fn logistic(rows: &[([f64; 3], bool)], before: [f64; 4]) -> Option<[f64; 4]> {
    if rows.iter().all(|(_, class)| *class) || rows.iter().all(|(_, class)| !*class) {
        return None;
    }
    let loss = |weights: &[f64; 4]| -> f64 {
        let away = |place: usize| 0.5 * PRIOR * (weights[place] - before[place]).powi(2);
        let miss = |(features, class): &([f64; 3], bool)| {
            let x = argument(weights, features);
            if *class { (-x).exp().ln_1p() } else { x.exp().ln_1p() }
        };
        away(1) + away(2) + rows.iter().map(miss).sum::<f64>()
    };
    let mut weights = before;
    // Coordinate by coordinate, each between its bounds: the loss is convex.
    for _ in 0..ROUNDS {
        let last = weights;
        for place in 0..3 {
            let (low, high) = if place == 0 { (-30.0, 30.0) } else { (0.0, 10.0) };
            weights[place] = minimise(low, high, 1e-9, |value| {
                let mut tried = weights;
                tried[place] = value;
                loss(&tried)
            })
            .at;
        }
        let moved = weights.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
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
        let rows: Vec<([f64; 3], bool)> = (0..80)
            .map(|i| ([if i % 2 == 0 { 2.0 } else { 6.0 }, f64::from(i / 2 % 3), 1.0], i % 2 == 1))
            .collect();
        let weights = logistic(&rows, [0.0, 0.5, 0.0, 0.0]).unwrap();
        // Eighty cases against a prior of one: each class on its side with odds of e^2 at least.
        assert!(argument(&weights, &[2.0, 1.0, 1.0]) < -2.0 && argument(&weights, &[6.0, 1.0, 1.0]) > 2.0);
        assert!(logistic(&[([1.0; 3], true)], [0.0; 4]).is_none());
    }
}
