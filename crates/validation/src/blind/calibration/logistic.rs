//! A logistic regression of unmodelled causes.

use mapper_diagnose::gap::logistic_features;
use mapper_numerics::minimise::minimise;

/// Maximum number of iterations of coordinate descent; about fifty are needed.
const ROUNDS: usize = 300;
/// Prior mean of the offset: the share of unmodelled causes, 15 %, before anything is known.
const PRIOR_OFFSET: f64 = -1.7;
/// Prior mean of the slopes.
const PRIOR_SLOPE: f64 = 1.0;
/// Precision of both: about ten cases outweigh the prior.
const PRIOR_PRECISION: f64 = 0.25;
/// Minimum slopes: a larger misfit never contradicts an unmodelled cause. The slope of the smooth misfit is at least half of that from noise
/// for any cases: a failed search with the right cause leaves a residual of thousands of sigmas, and a few such cases would otherwise make
/// a gross misfit meaningless.
const MIN_SLOPES: [f64; 2] = [0.5, 0.0];

/// A case.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub features: [f64; 2],
    pub outside: bool,
    /// Weight of the case.
    pub weight: f64,
}

/// Offset and slopes of the logistic that separates outside causes from the others. `None` if one of the classes is empty.
pub(crate) fn logistic(rows: &[Row]) -> Option<[f64; 3]> {
    if rows.iter().all(|row| row.outside) || rows.iter().all(|row| !row.outside) {
        return None;
    }
    let rows: Vec<(Row, [f64; 2])> = rows.iter().map(|row| (*row, logistic_features(row.features))).collect();
    let loss = |weights: &[f64; 3]| -> f64 {
        let means = [PRIOR_OFFSET, PRIOR_SLOPE, PRIOR_SLOPE];
        let penalty: f64 =
            weights.iter().zip(means).map(|(w, mean)| 0.5 * PRIOR_PRECISION * (w - mean).powi(2)).sum();
        let miss = |(row, terms): &(Row, [f64; 2])| {
            let x = argument(weights, terms);
            row.weight * if row.outside { (-x).exp().ln_1p() } else { x.exp().ln_1p() }
        };
        penalty + rows.iter().map(miss).sum::<f64>()
    };
    let mut weights = [PRIOR_OFFSET, PRIOR_SLOPE, PRIOR_SLOPE];
    // Coordinate descent within bounds converges because the loss is convex.
    for _ in 0..ROUNDS {
        let last = weights;
        for place in 0..weights.len() {
            let (low, high) = if place == 0 { (-30.0, 30.0) } else { (MIN_SLOPES[place - 1], 10.0) };
            weights[place] = minimise(low, high, 1e-9, |value| {
                let mut tried = weights;
                tried[place] = value;
                loss(&tried)
            })
            .at;
        }
        let moved = weights.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if moved < 1e-5 {
            break;
        }
    }
    Some(weights)
}

/// Argument of the logistic for features that [`logistic_features`] has limited.
fn argument(weights: &[f64; 3], features: &[f64; 2]) -> f64 {
    // Beyond 500 an exponential is infinite.
    let x = weights[0] + weights[1..].iter().zip(features).map(|(w, f)| w * f).sum::<f64>();
    x.clamp(-500.0, 500.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(features: [f64; 2], outside: bool) -> Row {
        Row { features, outside, weight: 1.0 }
    }

    /// Two classes that only the second feature separates, 2 and 20; the others carry no information.
    #[test]
    fn the_boundary_lies_between_the_classes() {
        let rows: Vec<Row> =
            (0..80).map(|i| row([-1.0, if i % 2 == 0 { 2.0 } else { 20.0 }], i % 2 == 1)).collect();
        let weights = logistic(&rows).unwrap();
        // Eighty cases against a weak prior: each class on its side with odds of e^2 at least.
        let at = |features| argument(&weights, &logistic_features(features));
        assert!(at([-1.0, 2.0]) < -2.0 && at([-1.0, 20.0]) > 2.0);
        assert!(logistic(&[row([1.0; 2], true)]).is_none());
    }

    /// Failed searches do not remove the effect of a gross misfit.
    #[test]
    fn a_gross_misfit_stays_evidence_of_an_outside_cause() {
        let rows: Vec<Row> =
            (0..80).map(|i| row([if i % 8 == 0 { 1e4 } else { 0.0 }, 0.0], i % 8 == 1)).collect();
        let weights = logistic(&rows).unwrap();
        assert!(argument(&weights, &logistic_features([20.0, 0.0])) > 10.0, "{weights:?}");
    }
}
