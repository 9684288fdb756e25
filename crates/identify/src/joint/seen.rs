//! What a fit saw of its refinements: which of them are at work, with what probability, and what each is then.

use mapper_numerics::root::bisect;
use mapper_numerics::statistics::{BoundedNormal, NORMAL_975};
use nalgebra::{DMatrix, DVector};

/// Share of a mixture that may lie beyond the interval on either side. With 1 % an alpha_A of 0.05 that hardly
/// shows is contained more often, and on all other machines the intervals of h are twice as wide as its errors.
const BEYOND: f64 = 0.025;
/// Standard deviations within which a tail is looked for.
const FAR_SIGMAS: f64 = 8.0;

/// What a fit saw of its active refinements, each as a distance from what is declared.
pub(crate) struct Seen {
    /// Values.
    pub(crate) found: DVector<f64>,
    /// Standard deviations beforehand.
    pub(crate) sigmas: Vec<f64>,
    /// Covariance after.
    pub(crate) spread: DMatrix<f64>,
    /// What small faults of the model can pass for; counts where it is asked whether something is at work.
    pub(crate) floors: Vec<f64>,
    /// Of the one that is bounded.
    pub(crate) bounds: Option<Bounds>,
    /// Probability beforehand that one is as declared.
    pub(crate) declared_holds: f64,
}

/// Bounds of one refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) place: usize,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// What one refinement may be: with these probabilities so distributed, else as declared.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mixture(Vec<(f64, BoundedNormal)>);

impl Seen {
    /// For each what it may be. Each set of those that are at work has a distribution of its own: what balances another is
    /// larger where the other is as declared.
    pub(crate) fn mixtures(&self) -> Vec<Mixture> {
        let count = self.found.len();
        let sets: Vec<Vec<usize>> =
            (0..1usize << count).map(|off| (0..count).filter(|i| off >> i & 1 == 1).collect()).collect();
        let logs: Vec<f64> =
            sets.iter().map(|declared| self.log_probability(declared).unwrap_or(f64::NEG_INFINITY)).collect();
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = logs.iter().map(|log| (log - best).exp()).sum();
        (0..count)
            .map(|place| {
                let with = sets.iter().zip(&logs).filter(|(declared, _)| !declared.contains(&place));
                Mixture(
                    with.filter_map(|(declared, log)| {
                        Some(((log - best).exp() / total, self.known(&self.spread, declared, place)?))
                    })
                    .collect(),
                )
            })
            .collect()
    }

    /// Logarithm of the probability that those at these places are as declared and the others at work, but for a constant.
    fn log_probability(&self, declared: &[usize]) -> Option<f64> {
        let mut spread = self.spread.clone();
        for (place, floor) in self.floors.iter().enumerate() {
            spread[(place, place)] += floor * floor;
        }
        let factors = part(&spread, declared, declared).cholesky()?;
        let distance = self.distance(declared);
        let determinant: f64 = factors.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        let before: f64 = declared.iter().map(|i| self.sigmas[*i].ln()).sum();
        let odds = declared.len() as f64 * (self.declared_holds / (1.0 - self.declared_holds)).ln();
        let unbounded = odds + before - determinant - 0.5 * distance.dot(&factors.solve(&distance));
        // How much lies between the bounds: where it is as declared, of what was known beforehand; where it is at work, of what
        // is known after.
        let inside = match self.bounds {
            None => return Some(unbounded),
            Some(Bounds { place, low, high }) if declared.contains(&place) => {
                BoundedNormal { mean: 0.0, sigma: self.sigmas[place], low, high }
            }
            Some(Bounds { place, .. }) => self.known(&spread, declared, place)?,
        };
        Some(unbounded + inside.mass().ln())
    }

    /// What is known of one, others being as declared.
    fn known(&self, spread: &DMatrix<f64>, declared: &[usize], place: usize) -> Option<BoundedNormal> {
        let factors = part(spread, declared, declared).cholesky()?;
        let across = part(spread, declared, &[place]).column(0).into_owned();
        let answer = factors.solve(&across);
        let bounds = self.bounds.filter(|bounds| bounds.place == place);
        let variance = spread[(place, place)] - across.dot(&answer);
        (variance > 0.0).then(|| BoundedNormal {
            mean: self.found[place] - answer.dot(&self.distance(declared)),
            sigma: variance.sqrt(),
            low: bounds.map_or(f64::NEG_INFINITY, |bounds| bounds.low),
            high: bounds.map_or(f64::INFINITY, |bounds| bounds.high),
        })
    }

    fn distance(&self, places: &[usize]) -> DVector<f64> {
        DVector::from_iterator(places.len(), places.iter().map(|i| self.found[*i]))
    }
}

fn part(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |a, b| matrix[(rows[a], columns[b])])
}

impl Mixture {
    /// Probability to be at work.
    pub(crate) fn weight(&self) -> f64 {
        self.0.iter().map(|(weight, _)| weight).sum()
    }

    /// Variance beyond that of a fit that has drawn it to `drawn` and knows it with a variance of `left`: all of the mixture's,
    /// and enough that the 95 % interval leaves no more than [`BEYOND`] of the mixture beyond it, on any side of what is declared.
    pub(crate) fn variance_beyond(&self, drawn: f64, left: f64) -> f64 {
        let plain = (1.0 - self.weight()).max(0.0) * drawn * drawn
            + self.0.iter().map(|(weight, part)| weight * (part.quantile(0.5) - drawn).powi(2)).sum::<f64>();
        let reach = |sign: f64| self.reach(sign).map_or(0.0, |reach| reach - sign * drawn);
        let reach = reach(1.0).max(reach(-1.0)).max(0.0) / NORMAL_975;
        plain.max(reach * reach - left)
    }

    /// Distance from what is declared, upwards (1) or downwards (-1), beyond which [`BEYOND`] of the mixture lies; `None` where less
    /// does on that side.
    fn reach(&self, sign: f64) -> Option<f64> {
        let beyond = |distance: f64| -> f64 {
            self.0.iter().map(|(weight, part)| weight * part.share_beyond(sign * distance, sign > 0.0)).sum()
        };
        let far = |(_, part): &(f64, BoundedNormal)| (sign * part.mean).max(0.0) + FAR_SIGMAS * part.sigma;
        let far = self.0.iter().map(far).fold(0.0, f64::max);
        (beyond(0.0) > BEYOND).then(|| bisect(0.0, far, 1e-6 * far, |distance| beyond(distance) > BEYOND).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(found: &[f64], spread: DMatrix<f64>, bounds: Option<Bounds>) -> Vec<f64> {
        let seen = Seen {
            found: DVector::from_row_slice(found),
            sigmas: vec![0.3; found.len()],
            spread,
            floors: vec![0.0; found.len()],
            bounds,
            declared_holds: 0.67,
        };
        seen.mixtures().iter().map(Mixture::weight).collect()
    }

    fn diagonal(errors: &[f64]) -> DMatrix<f64> {
        DMatrix::from_diagonal(&DVector::from_iterator(errors.len(), errors.iter().map(|e| e * e)))
    }

    /// The interval about the drawn value leaves 2.5 % of the mixture beyond either end, by counting (numbers at equal ranks).
    #[test]
    fn the_interval_reaches_as_far_as_the_mixture() {
        let anywhere = (f64::NEG_INFINITY, f64::INFINITY);
        let far = (0.05, 0.1, 0.01, anywhere);
        for parts in [
            vec![(0.1, 0.05, 0.02, anywhere)],
            vec![(0.9, 0.08, 0.03, anywhere)],
            vec![(0.3, 0.05, 0.03, (0.0, 1.0))],
            vec![(0.3, -0.02, 0.03, (0.0, 1.0))],
            vec![(0.3, -0.15, 0.03, (-0.1, 0.9))],
            vec![far, (0.1, 0.02, 0.05, anywhere)],
            vec![far, (0.1, -0.1, 0.05, anywhere)],
        ] {
            let mixture = Mixture(
                parts
                    .iter()
                    .map(|&(weight, mean, sigma, (low, high))| {
                        (weight, BoundedNormal { mean, sigma, low, high })
                    })
                    .collect(),
            );
            let drawn: f64 = parts.iter().map(|(weight, mean, ..)| weight * mean).sum();
            let left = 1e-5;
            let reach = NORMAL_975 * (left + mixture.variance_beyond(drawn, left)).sqrt();
            let ranks = 10_000;
            for side in [-1.0, 1.0] {
                let beyond: f64 = mixture
                    .0
                    .iter()
                    .map(|(weight, part)| {
                        let ranks = (1..ranks).map(|rank| part.quantile(f64::from(rank) / f64::from(ranks)));
                        weight * ranks.filter(|one| side * (one - drawn) > reach).count() as f64
                    })
                    .sum::<f64>()
                    / f64::from(ranks);
                assert!(beyond < BEYOND + 1e-3, "{mixture:?}: {beyond}");
            }
        }
    }

    #[test]
    fn a_clear_finding_is_at_work_and_none_is_not() {
        assert!(weights(&[0.2], diagonal(&[0.02]), None)[0] > 0.999);
        // Half its error: twice as likely not to be there beforehand, and then 13 times as dense as before.
        assert!(weights(&[0.01], diagonal(&[0.02]), None)[0] < 0.05);
    }

    /// Against the ratio of both likelihoods, integrated over the half of the normal distribution that is left (scipy:
    /// `a = quad(lambda x: norm.pdf(found, x, 0.03) * norm.pdf(x, 0, 0.3) * 2.0017, 0, 1)[0]`, `b = norm.pdf(found, 0, 0.03)`,
    /// `0.33 * a / (0.33 * a + 0.67 * b)`; found is then shrunk to the posterior's mean by `0.3**2 / (0.3**2 + 0.03**2)`, and 0.03
    /// to its standard deviation by the root of that).
    #[test]
    fn a_share_below_nothing_is_chance() {
        let shrink = 0.09 / (0.09 + 0.0009);
        for (found, expected) in SCIPY {
            let spread = diagonal(&[0.03 * f64::sqrt(shrink)]);
            let bounds = Bounds { place: 0, low: 0.0, high: 1.0 };
            let weight = weights(&[found * shrink], spread, Some(bounds))[0];
            assert!((weight / expected - 1.0).abs() < 1e-3, "{found}: {weight}");
        }
    }

    const SCIPY: [(f64, f64); 5] =
        [(-0.06, 0.01628304), (-0.02, 0.03006377), (0.0, 0.04675785), (0.05, 0.26964142), (0.1, 0.96001156)];

    /// Two that stand for each other, each two of its errors off, are less than either of them for certain.
    #[test]
    fn what_only_balances_another_is_not_at_work() {
        let errors = [0.02f64, 0.02];
        let mut spread = diagonal(&errors);
        spread[(0, 1)] = 0.95 * errors[0] * errors[1];
        spread[(1, 0)] = spread[(0, 1)];
        let together = weights(&[0.045, 0.045], spread.clone(), None);
        assert!(together.iter().all(|weight| *weight < 0.3), "{together:?}");
    }

    /// Where either of two would do, each alone is larger than both together say: by hand, the regression of one on the other.
    #[test]
    fn one_alone_is_what_it_has_to_be_without_the_other() {
        let mut spread = diagonal(&[0.05, 0.05]);
        spread[(0, 1)] = 0.9 * 0.05 * 0.05;
        spread[(1, 0)] = spread[(0, 1)];
        let seen = Seen {
            found: DVector::from_row_slice(&[0.03, -0.06]),
            sigmas: vec![0.3; 2],
            spread,
            floors: vec![0.0; 2],
            bounds: None,
            declared_holds: 0.67,
        };
        let alone = seen.known(&seen.spread, &[1], 0).unwrap();
        assert!((alone.mean - (0.03 + 0.9 * 0.06)).abs() < 1e-12);
        assert!((alone.sigma - 0.05 * f64::sqrt(1.0 - 0.81)).abs() < 1e-12);
    }
}
