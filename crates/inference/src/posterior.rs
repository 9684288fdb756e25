//! The posterior of hypotheses and the intervals that follow from it.
//!
//! - How probable is a set of causes? Its evidence times its prior, over the sum of all sets and of no cause. A temperature, from
//!   calibration, divides differences of the logarithms.
//! - Which sets count as one cause? A set counts as one of its parts if the part is more probable. The other members are then too weak to
//!   show. A source whose sets are not reduced beforehand requires a margin of evidence for the other members.
//! - Is a cause named? Yes, if its ln of odds against no cause exceeds a threshold.
//! - Which causes do the data not distinguish? Those with odds of at least [`EXCLUDED_ODDS`] against the most probable one: the odds at
//!   which an interval excludes a value.
//! - Is it an unmodelled cause? The source states this probability: calibrated on the residual of the best fit, or from the
//!   evidence of a larger model error. All modelled explanations share the rest.

use mapper_numerics::statistics::{EXCLUDE_SIGMAS, range};

/// Odds against the most probable cause below which a cause is excluded: those at which an interval excludes a value.
pub const EXCLUDED_ODDS: f64 = 1.0 - COVERAGE;

/// Constants of the rules.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Minimum ln of the odds against no cause for a cause to be named.
    pub threshold: f64,
    /// Divisor of differences of the logarithms.
    pub temperature: f64,
    /// Share of the recordings with modelled causes in which these are not among the sets.
    pub unlisted: f64,
    /// ln of the odds by which a set must exceed its part to be a cause of its own; 0 if the members of a set have been tested before.
    pub part_margin: f64,
}

/// A set of causes that explains the data.
#[derive(Debug, Clone, PartialEq)]
pub struct CauseSet {
    /// Its causes, without their onsets.
    pub members: Vec<usize>,
    /// ln of its evidence times its prior, up to a constant that all sets and no cause share.
    pub ln_weight: f64,
}

/// A cause with its probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RankedCause {
    /// Position of its set.
    pub set: usize,
    /// Probability, with that of the sets that count as this cause.
    pub probability: f64,
}

/// Probabilities of all explanations; they add up to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct CauseProbabilities {
    /// Of no cause.
    pub none: f64,
    /// Causes, most probable first.
    pub causes: Vec<RankedCause>,
    /// Of modelled causes that are not among the sets.
    pub unlisted: f64,
    /// Of an unmodelled cause.
    pub unmodelled: f64,
    /// Whether a cause is named.
    pub named: bool,
    /// Number of the first causes that the data do not distinguish; 0 if none is named.
    pub alike: usize,
}

impl CauseProbabilities {
    /// Probability of one cause, whatever the others: that of all `sets` with it.
    pub fn of_member(&self, sets: &[CauseSet], member: usize) -> f64 {
        let with = |cause: &&RankedCause| sets[cause.set].members.contains(&member);
        self.causes.iter().filter(with).map(|cause| cause.probability).sum()
    }
}

impl Rules {
    /// Difference of ln of the weights below which the data do not distinguish causes.
    pub fn ln_resolution(&self) -> f64 {
        -EXCLUDED_ODDS.ln() * self.temperature
    }

    /// Probabilities of `sets`, most probable first. `none`: ln of the weight of no cause; `unmodelled`: probability of an unmodelled cause.
    pub fn cause_probabilities(&self, none: f64, sets: &[CauseSet], unmodelled: f64) -> CauseProbabilities {
        let ln_weights = std::iter::once(none).chain(sets.iter().map(|set| set.ln_weight));
        let shares = shares(&ln_weights.collect::<Vec<_>>(), self.temperature);
        // A sum of shares may exceed 1 by rounding.
        let modelled = (1.0 - unmodelled).max(0.0);
        let none_probability = modelled * shares[0];
        let listed = modelled * (1.0 - self.unlisted);
        let mut causes: Vec<RankedCause> = Vec::new();
        let mut best: Vec<f64> = Vec::new();
        for (set, share) in shares[1..].iter().enumerate() {
            let cause = self.counts_as(sets, set);
            let probability = listed * share;
            match causes.iter_mut().find(|known| known.set == cause) {
                Some(known) => known.probability += probability,
                None => {
                    causes.push(RankedCause { set: cause, probability });
                    best.push(sets[set].ln_weight);
                }
            }
        }
        let named = best.first().is_some_and(|best| best - none > self.threshold);
        let is_alike = |ln_weight: &&f64| named && best[0] - **ln_weight < self.ln_resolution();
        CauseProbabilities {
            none: none_probability,
            unlisted: self.unlisted * (modelled - none_probability),
            unmodelled,
            named,
            alike: best.iter().take_while(is_alike).count(),
            causes,
        }
    }

    /// The set as which a set counts: the most probable of its parts that is more probable or lacks less than the margin.
    fn counts_as(&self, sets: &[CauseSet], set: usize) -> usize {
        let whole = &sets[set];
        let counts = |part: &usize| {
            let CauseSet { members, ln_weight } = &sets[*part];
            let is_smaller = members.len() < whole.members.len();
            *part != set
                && (*part < set || is_smaller && whole.ln_weight - ln_weight < self.part_margin)
                && members.iter().all(|member| whole.members.contains(member))
        };
        (0..sets.len()).find(counts).map_or(set, |part| self.counts_as(sets, part))
    }
}

/// Shares of explanations with these logarithms of their weights, divided by a temperature.
pub fn shares(ln_weights: &[f64], temperature: f64) -> Vec<f64> {
    let highest = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = ln_weights.iter().map(|ln| ((ln - highest) / temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / total).collect()
}

/// Probability of ln of the odds.
pub fn probability(ln_odds: f64) -> f64 {
    1.0 / (1.0 + (-ln_odds).exp())
}

/// Cells of the density for one standard deviation. Bound: the error of the interval is then below 0.01 standard deviations.
const CELLS_PER_SIGMA: f64 = 16.0;
/// Maximum number of cells between the lowest and the highest centre. Bound: the effort if the centres are far apart.
const MAX_CELLS: f64 = 4096.0;

/// Coverage of all reported intervals. Source: the usual coverage of measurement uncertainty (GUM, JCGM 100, 6.3).
pub const COVERAGE: f64 = 0.95;

/// Whether data tell more of a parameter than its prior: precisions add up, so the width (or error) falls below the root of a half.
pub fn is_identified(after: f64, before: f64) -> bool {
    2.0 * after * after < before * before
}

/// Shortest interval with `coverage` of normals about `centres` (weight, value), each of `sigma`. `None` without centres or finite numbers.
pub fn shortest(centres: &[(f64, f64)], sigma: f64, coverage: f64) -> Option<(f64, f64)> {
    let (low, high) = range(centres.iter().map(|(_, x)| *x));
    if !(low.is_finite() && high.is_finite() && sigma.is_finite()) {
        return None;
    }
    let width = (sigma / CELLS_PER_SIGMA).max((high - low) / MAX_CELLS);
    if width <= 0.0 {
        return Some((low, low));
    }
    let reach = (EXCLUDE_SIGMAS * sigma / width).ceil() as usize;
    let cells = ((high - low) / width).ceil() as usize + 2 + 2 * reach;
    let mut weights = vec![0.0; cells];
    for (weight, x) in centres {
        // Shared between the cells on either side, so that the mean stays.
        let at = (x - low) / width;
        let cell = at.floor();
        let share = at - cell;
        let cell = reach + cell as usize;
        weights[cell] += weight * (1.0 - share);
        weights[cell + 1] += weight * share;
    }
    let kernel: Vec<f64> = (0..=reach)
        .map(|k| if sigma > 0.0 { (-0.5 * (k as f64 * width / sigma).powi(2)).exp() } else { 1.0 })
        .collect();
    let mut density = vec![0.0; cells];
    for (cell, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        for (k, value) in kernel.iter().enumerate() {
            density[cell.saturating_sub(k)] += weight * value;
            if k > 0 {
                density[(cell + k).min(cells - 1)] += weight * value;
            }
        }
    }
    let total: f64 = density.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    // Share below the upper edge of each cell.
    let mut below = Vec::with_capacity(cells + 1);
    let mut sum = 0.0;
    below.push(0.0);
    for value in &density {
        sum += value / total;
        below.push(sum);
    }
    let edge = |position: f64| low + (position - reach as f64 - 0.5) * width;
    let quantile = |share: f64| {
        let upper = below.partition_point(|below| *below < share).clamp(1, cells);
        let (before, after) = (below[upper - 1], below[upper]);
        let within = if after > before { ((share - before) / (after - before)).clamp(0.0, 1.0) } else { 0.0 };
        edge((upper - 1) as f64 + within)
    };
    let beyond = 1.0 - coverage;
    (0..cells)
        .map(|cell| below[cell])
        .take_while(|share| *share <= beyond)
        .chain([0.5 * beyond])
        .map(|share| (quantile(share), quantile(share + coverage)))
        .min_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: Rules = Rules { threshold: 3.0, temperature: 1.0, unlisted: 0.05, part_margin: 0.0 };

    fn sets(of: &[(&[usize], f64)]) -> Vec<CauseSet> {
        of.iter()
            .map(|(members, ln_weight)| CauseSet { members: members.to_vec(), ln_weight: *ln_weight })
            .collect()
    }

    #[test]
    fn probabilities_add_up_to_one_and_follow_the_odds() {
        let found = RULES.cause_probabilities(0.0, &sets(&[(&[4], 5.0), (&[2], 4.0), (&[4, 7], 3.0)]), 0.2);
        let sum: f64 = found.causes.iter().map(|cause| cause.probability).sum();
        assert!((sum + found.none + found.unlisted + found.unmodelled - 1.0).abs() < 1e-12);
        // Odds 1 : e^4 of no cause against the second, which has 95 % of its share.
        assert!((found.causes[1].probability / found.none / 0.95 - f64::exp(4.0)).abs() < 1e-9);
        // The pair with a weak second member counts as its first one.
        let first = (f64::exp(5.0) + f64::exp(3.0)) / f64::exp(4.0);
        assert_eq!(found.causes.iter().map(|cause| cause.set).collect::<Vec<_>>(), [0, 1]);
        assert!((found.causes[0].probability / found.causes[1].probability - first).abs() < 1e-9);
    }

    #[test]
    fn causes_are_alike_up_to_odds_of_one_to_twenty() {
        let alike = |behind: f64| {
            RULES.cause_probabilities(0.0, &sets(&[(&[0], 9.0), (&[1], 9.0 - behind)]), 0.0).alike
        };
        assert_eq!((alike(19f64.ln()), alike(21f64.ln())), (2, 1));
        let warmer = Rules { temperature: 2.0, ..RULES };
        assert_eq!(warmer.cause_probabilities(0.0, &sets(&[(&[0], 9.0), (&[1], 5.0)]), 0.0).alike, 2);
        let weak = RULES.cause_probabilities(0.0, &sets(&[(&[0], 2.9)]), 0.0);
        assert!(!weak.named && weak.alike == 0);
    }

    /// A second member within the margin is not named; with more evidence it is.
    #[test]
    fn a_member_needs_its_margin_of_evidence() {
        let strict = Rules { part_margin: 3.0, ..RULES };
        let first = |pair: f64| {
            let sets = sets(&[(&[4, 7], pair), (&[2], 9.5), (&[4], 9.0)]);
            strict.cause_probabilities(0.0, &sets, 0.0).causes[0].set
        };
        assert_eq!((first(11.0), first(13.0)), (2, 0));
    }
}

#[cfg(test)]
mod interval_tests {
    use super::*;

    /// One normal distribution: 1.96 standard deviations on either side of its mean.
    #[test]
    fn one_centre_gives_the_normal_interval() {
        for (centre, sigma) in [(0.0, 1.0), (0.64, 2e-3), (-300.0, 40.0)] {
            let (low, high) = shortest(&[(1.0, centre)], sigma, 0.95).unwrap();
            for (bound, expected) in [(low, centre - 1.959964 * sigma), (high, centre + 1.959964 * sigma)] {
                // The interval of a symmetric density is flat in its place: a hundredth of a standard deviation is not seen.
                assert!((bound - expected).abs() < 0.03 * sigma, "{centre} {sigma}: {bound} {expected}");
            }
        }
    }

    /// A mixture of two by counting its draws (equal ranks of each part).
    #[test]
    fn a_mixture_is_what_its_draws_say() {
        use mapper_numerics::statistics::normal_quantile;
        let (centres, sigma) = ([(0.7, 0.0), (0.3, 3.0)], 0.5);
        let ranks = 20_000;
        let mut draws: Vec<(f64, f64)> = Vec::new();
        for (weight, centre) in centres {
            for rank in 0..ranks {
                let share = (f64::from(rank) + 0.5) / f64::from(ranks);
                draws.push((centre + sigma * normal_quantile(share).unwrap(), weight / f64::from(ranks)));
            }
        }
        draws.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (low, high) = shortest(&centres, sigma, 0.95).unwrap();
        let inside: f64 =
            draws.iter().filter(|(x, _)| (low..=high).contains(x)).map(|(_, weight)| weight).sum();
        assert!((inside - 0.95).abs() < 2e-3, "{inside}");
        let mut best = f64::INFINITY;
        let (mut end, mut sum) = (0, 0.0);
        for start in 0..draws.len() {
            while end < draws.len() && sum < 0.95 {
                sum += draws[end].1;
                end += 1;
            }
            if sum < 0.95 {
                break;
            }
            best = best.min(draws[end - 1].0 - draws[start].0);
            sum -= draws[start].1;
        }
        assert!((high - low - best).abs() < 0.02 * sigma, "{} {best}", high - low);
    }

    #[test]
    fn without_noise_and_without_centres() {
        assert_eq!(shortest(&[(1.0, 0.5)], 0.0, 0.95), Some((0.5, 0.5)));
        assert_eq!(shortest(&[], 1.0, 0.95), None);
        assert_eq!(shortest(&[(1.0, f64::NAN)], 1.0, 0.95), None);
    }
}
