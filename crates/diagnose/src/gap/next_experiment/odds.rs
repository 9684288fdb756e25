//! Expected outcome of an experiment, given how strongly it separates the causes.
//!
//! In the linear model, the log odds of the true cause `k` over `j` grow by a normal quantity of mean `d^2/2` and variance `d^2`. The
//! causes are points with mutual distances `d`; a reading is the true cause's point with unit noise. Bayes' rule on draws of such readings
//! gives the result, without running the model.

use mapper_inference::mixture::normal_points;
use nalgebra::{DMatrix, SymmetricEigen};

/// Expected outcome of an experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Odds {
    /// Probability that the true cause reaches the requested share of the open causes' probability.
    pub settles: f64,
    /// Expected share of the true cause afterwards.
    pub share: f64,
    /// Expected reduction of the entropy of the open causes, bit, >= 0.
    pub entropy_drop_bit: f64,
}

/// Forecast for causes of `probabilities` (any sum above 0), `separation` in squared sigmas (row: true, column: rival; the smaller direction of
/// a pair counts). `temperature` divides log evidence, as in the diagnosis; `settled` is the requested share.
pub(crate) fn odds(probabilities: &[f64], separation: &[Vec<f64>], temperature: f64, settled: f64) -> Odds {
    let total: f64 = probabilities.iter().sum();
    let p: Vec<f64> = probabilities.iter().map(|p| p / total.max(f64::MIN_POSITIVE)).collect();
    let places = places(separation);
    let noise = normal_points(places.len());
    let (mut settles, mut share, mut left_bit) = (0.0, 0.0, 0.0);
    // Equal numbers of draws per cause, weighted, so that small probabilities are sampled too.
    for (truth, of_truth) in p.iter().enumerate() {
        let weight = of_truth / noise.len() as f64;
        for noise in &noise {
            let reading: Vec<f64> = places[truth].iter().zip(noise).map(|(x, noise)| x + noise).collect();
            let after = after(&p, &places, &reading, temperature);
            settles += if after[truth] >= settled { weight } else { 0.0 };
            share += weight * after[truth];
            left_bit += weight * entropy_bit(&after);
        }
    }
    // Rounding may push the sums slightly above 1.
    let (settles, share) = (settles.min(1.0), share.min(1.0));
    Odds { settles, share, entropy_drop_bit: (entropy_bit(&p) - left_bit).max(0.0) }
}

/// Posterior probabilities after a reading.
fn after(p: &[f64], places: &[Vec<f64>], reading: &[f64], temperature: f64) -> Vec<f64> {
    let d2 = |place: &Vec<f64>| place.iter().zip(reading).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let d2: Vec<f64> = places.iter().map(d2).collect();
    let nearest = d2.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> =
        p.iter().zip(&d2).map(|(p, d2)| p * (-0.5 * (d2 - nearest) / temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / total.max(f64::MIN_POSITIVE)).collect()
}

/// Entropy of probabilities, scaled to a sum of 1, bit.
pub(crate) fn entropy_bit(probabilities: &[f64]) -> f64 {
    let total: f64 = probabilities.iter().sum();
    let shares = probabilities.iter().map(|p| p / total.max(f64::MIN_POSITIVE));
    -shares.filter(|p| *p > 0.0).map(|p| p * p.log2()).sum::<f64>()
}

/// Points with the given squared distances (Torgerson 1952); the non-Euclidean part of the distances is dropped.
fn places(separation: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = separation.len();
    let d2 = DMatrix::from_fn(n, n, |i, j| if i == j { 0.0 } else { separation[i][j].min(separation[j][i]) });
    // Scalar products of the points relative to the first.
    let products = DMatrix::from_fn(n, n, |i, j| 0.5 * (d2[(0, i)] + d2[(0, j)] - d2[(i, j)]));
    let eigen = SymmetricEigen::new(products);
    (0..n)
        .map(|i| (0..n).map(|k| eigen.eigenvectors[(i, k)] * eigen.eigenvalues[k].max(0.0).sqrt()).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLED: f64 = 0.95;

    fn even(n: usize, d2: f64) -> Vec<Vec<f64>> {
        (0..n).map(|k| (0..n).map(|j| if k == j { 0.0 } else { d2 }).collect()).collect()
    }

    /// Normal distribution function, by Simpson's rule.
    fn below(x: f64) -> f64 {
        let (a, n) = (-9.0, 2000);
        let h = (x.clamp(-9.0, 9.0) - a) / f64::from(n);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let weight = |i: i32| if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
        (0..=n).map(|i| weight(i) * density(a + h * f64::from(i))).sum::<f64>() * h / 3.0
    }

    #[test]
    fn what_shows_nothing_settles_nothing_and_what_shows_all_settles_all() {
        let p = [0.6, 0.3, 0.1];
        let nothing = odds(&p, &even(3, 0.0), 1.0, SETTLED);
        // Without information the true cause keeps its own probability: sum of p^2.
        assert!((nothing.share - 0.46).abs() < 1e-12 && nothing.settles == 0.0);
        assert!(nothing.entropy_drop_bit < 1e-12);
        let all = odds(&p, &even(3, 200.0), 1.0, SETTLED);
        assert!(all.settles > 1.0 - 1e-9 && (all.entropy_drop_bit - entropy_bit(&p)).abs() < 1e-6);
        // Measured in bits, a question can be resolved partially.
        let some = odds(&p, &even(3, 4.0), 1.0, SETTLED);
        assert!(some.settles > 0.0 && some.settles < all.settles && some.share > 0.46);
    }

    /// Two causes: `P = sum p_k Phi((d^2/2 + logit p_k - logit 0.95) / d)`, and the mean log odds by Simpson's rule.
    #[test]
    fn draws_agree_with_the_closed_form_of_two_causes() {
        let logit = |p: f64| (p / (1.0 - p)).ln();
        for (p, d2) in [(0.5, 9.0), (0.8, 2.0), (0.3, 25.0), (0.9, 0.3)] {
            let d = f64::sqrt(d2);
            let settles: f64 =
                [p, 1.0 - p].iter().map(|p| p * below((0.5 * d2 + logit(*p) - logit(SETTLED)) / d)).sum();
            let drawn = odds(&[p, 1.0 - p], &even(2, d2), 1.0, SETTLED);
            // Halton's points miss a step by a few of 128.
            assert!((drawn.settles - settles).abs() < 0.03, "{p} {d2}: {} {settles}", drawn.settles);
            // Remaining entropy, integrated over the log odds.
            let left: f64 = [p, 1.0 - p]
                .iter()
                .map(|p| {
                    let h = 0.01;
                    (-800..=800)
                        .map(|i| {
                            let z = h * f64::from(i);
                            let after = 1.0 / (1.0 + (-(logit(*p) + 0.5 * d2 + d * z)).exp());
                            let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
                            p * h * density * entropy_bit(&[after, 1.0 - after])
                        })
                        .sum::<f64>()
                })
                .sum();
            let drop = entropy_bit(&[p, 1.0 - p]) - left;
            assert!((drawn.entropy_drop_bit - drop).abs() < 0.02, "{p} {d2}: {drawn:?} {drop}");
        }
    }

    /// The experiment separates one of three causes from the other two, but not these two from each other.
    #[test]
    fn a_pair_that_looks_alike_stays_open() {
        let separation = vec![vec![0.0, 0.0, 400.0], vec![0.0, 0.0, 400.0], vec![400.0, 400.0, 0.0]];
        let odds = odds(&[0.4, 0.4, 0.2], &separation, 1.0, SETTLED);
        assert!((odds.settles - 0.2).abs() < 1e-9, "{odds:?}");
        // One bit remains in four of five cases.
        assert!((odds.entropy_drop_bit - (entropy_bit(&[0.4, 0.4, 0.2]) - 0.8)).abs() < 1e-6);
    }
}
