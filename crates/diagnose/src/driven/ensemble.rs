//! Samples a density by an ensemble of walkers that take their steps from each other.
//!
//! The stretch move of Goodman and Weare (Comm. App. Math. Comp. Sci. 5, 65-80 (2010)), in halves that move in parallel as in
//! Foreman-Mackey et al. (PASP 125, 306 (2013)). It needs no derivatives or tuning and is insensitive to parameter correlations.

use mapper_numerics::parallel;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Number of walkers; even, and several times the number of parameters.
const WALKERS: usize = 64;
/// Number of moves for burn-in and for sampling.
const MOVES: (usize, usize) = (1000, 600);
/// Thinning: moves between kept samples.
const KEEP_EVERY: usize = 20;
/// Distance of the log density below the median at which a walker is stuck: that of 14 normal numbers scatters by 2.6.
const STUCK: f64 = 40.0;
/// Stretch parameter `a`.
const STRETCH: f64 = 2.0;

/// Draws from a density given by its logarithm over standard normal numbers. The same seed gives the same draws.
pub(crate) fn draws<const N: usize>(
    log_density: impl Fn(&[f64; N]) -> f64 + Sync,
    seed: u64,
) -> Vec<[f64; N]> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut walkers: Vec<([f64; N], f64)> = (0..WALKERS)
        .map(|_| {
            // Closer to the middle than the prior: its tails agree with no log.
            let place: [f64; N] = std::array::from_fn(|_| {
                let z: f64 = StandardNormal.sample(&mut random);
                0.5 * z
            });
            (place, log_density(&place))
        })
        .collect();
    let mut kept = Vec::new();
    let half = WALKERS / 2;
    for step in 0..MOVES.0 + MOVES.1 {
        if step == MOVES.0 / 3 || step == 2 * MOVES.0 / 3 {
            move_stuck(&mut walkers);
        }
        for first in [0, half] {
            let others = half - first;
            let proposals: Vec<(usize, [f64; N], f64, f64)> = (first..first + half)
                .map(|walker| {
                    let partner = walkers[others + random.random_range(0..half)].0;
                    let u: f64 = random.random();
                    // Density 1/sqrt(z) between 1/a and a.
                    let z = ((STRETCH - 1.0) * u + 1.0).powi(2) / STRETCH;
                    let here = walkers[walker].0;
                    let to = std::array::from_fn(|i| partner[i] + z * (here[i] - partner[i]));
                    (walker, to, (N as f64 - 1.0) * z.ln(), random.random::<f64>().ln())
                })
                .collect();
            let densities = parallel::map(&proposals, |(_, to, _, _)| log_density(to));
            for ((walker, to, ln_stretch, ln_accept), density) in proposals.into_iter().zip(densities) {
                if density.is_finite() && ln_accept < ln_stretch + density - walkers[walker].1 {
                    walkers[walker] = (to, density);
                }
            }
        }
        if step >= MOVES.0 && (step - MOVES.0).is_multiple_of(KEEP_EVERY) {
            kept.extend(walkers.iter().map(|(place, _)| *place));
        }
    }
    kept
}

/// Moves walkers that are stuck at a negligible local maximum to the positions of others. Later moves separate them again.
fn move_stuck<const N: usize>(walkers: &mut [([f64; N], f64)]) {
    let mut densities: Vec<f64> = walkers.iter().map(|(_, density)| *density).collect();
    densities.sort_by(f64::total_cmp);
    let floor = densities[densities.len() / 2] - STUCK;
    let good: Vec<_> = walkers.iter().copied().filter(|(_, density)| *density >= floor).collect();
    let stuck = walkers.iter_mut().filter(|(_, density)| *density < floor);
    for (walker, place) in stuck.zip(good.into_iter().cycle()) {
        *walker = place;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_numerics::statistics::mean;

    /// Two correlated normal numbers, and a third with its own level and width.
    #[test]
    fn draws_have_the_moments_of_the_density() {
        let rho: f64 = 0.9;
        let log_density = |x: &[f64; 3]| {
            let [a, b, c] = *x;
            -0.5 * (a * a - 2.0 * rho * a * b + b * b) / (1.0 - rho * rho) - 0.5 * ((c - 0.7) / 0.2).powi(2)
        };
        let draws = draws(log_density, 3);
        let average = |f: &dyn Fn(&[f64; 3]) -> f64| mean(draws.iter().map(f)).unwrap();
        // 2000 autocorrelated draws, some 500 of them independent: at least four standard errors.
        assert!(average(&|x| x[0]).abs() < 0.18);
        assert!((average(&|x| x[0] * x[1]) - rho).abs() < 0.25);
        assert!((average(&|x| x[2]) - 0.7).abs() < 0.04);
        assert!((average(&|x| (x[2] - 0.7).powi(2)).sqrt() / 0.2 - 1.0).abs() < 0.15);
    }
}
