//! Hypotheses, and how an effect changes in time.
//!
//! A balance is a vector of residuals `r` that are zero except for errors: `r = C x + e`, with `e ~ N(0, S)` and one column of `C` for
//! each parameter `x`. Some parameters always differ from zero, within their declared uncertainty (`x ~ N(0, sigma^2)`). The others are
//! hypotheses: each is exactly zero unless it is a member of the explanation, and then `x ~ N(0, sigma^2)` as well. Hypotheses that are
//! forms of one cause (a drift with different onsets) make a family, and at most one hypothesis of a family is a member.
//!
//! The evidence of a set has a closed form (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, sect. 2.7), so that
//! neither sampling nor fitting is needed. The evidence of a family is the sum over its hypotheses, each with its share of the prior.
//!
//! The rate of false alarms in fault-free recordings is at most the sum of all priors (Markov's inequality: without a fault a Bayes factor
//! has mean 1). The actual rate is far lower: an alarm takes about 4.5 standard errors, which 30 hypotheses reach in one of 5,000 recordings.

use mapper_numerics::ROUNDING;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::collections::BTreeMap;

/// Size of a cause that is certainly detected, in its prior standard deviations. Bound: the upper end of a bisection only.
const CERTAIN_SIGMAS: f64 = 1e6;

/// Maximum number of members of an explanation, and of single causes from which the search starts. Bound: the effort of the search; rigs
/// with more than three causes at once are not expected.
pub const MAX_MEMBERS: usize = 4;

/// Errors of a balance over the declared ones, where a cause acts that is none of the hypotheses. Bound: below two, declared errors are as
/// probable; above the last, every size is as improbable.
const ERROR_RATIOS: [f64; 9] = [2.0, 2.8, 4.0, 5.7, 8.0, 11.0, 16.0, 23.0, 32.0];
/// Resolution of such a ratio, relative. Bound: the distance of two of them, as the standard deviation of a rectangular distribution.
const RATIO_RESOLUTION: f64 = 0.1;

/// Residuals and their sensitivities to the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Balance {
    /// Residuals, one for each row.
    pub residual: DVector<f64>,
    /// Covariance of the residuals if all parameters are zero, rows x rows, positive definite.
    pub covariance: DMatrix<f64>,
    /// Sensitivities of the residuals to the parameters, rows x parameters.
    pub columns: DMatrix<f64>,
}

/// Gaussian likelihood of the parameters from all balances: its precision, and its precision times its mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Likelihood {
    precision: DMatrix<f64>,
    precision_mean: DVector<f64>,
    /// Square of the residuals in their standard errors.
    square: f64,
    rows: usize,
    /// ln of the factor by which larger errors than declared reduce the density of the residuals.
    ln_width: f64,
}

/// A parameter that is zero unless it is a member of the explanation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis {
    /// Its family; at most one hypothesis of a family is a member.
    pub family: usize,
    /// Prior standard deviation if it is a member.
    pub sigma: f64,
    /// ln of the prior probability that it is a member.
    pub ln_prior: f64,
    /// Whether the parameter is never negative.
    pub at_least_zero: bool,
}

/// Priors of the parameters, in the order of the balances' columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Priors {
    /// Standard deviations of the parameters that always differ from zero: the first columns.
    pub always: Vec<f64>,
    /// Hypotheses: the other columns.
    pub hypotheses: Vec<Hypothesis>,
}

impl Priors {
    /// Equally probable hypotheses, each a family of its own. On average `expected` of them (above 0, at most 1) are members.
    pub fn even(always: Vec<f64>, sigmas: &[f64], expected: f64) -> Priors {
        let ln_prior = (expected / sigmas.len() as f64).ln();
        let hypothesis = |(family, sigma): (usize, &f64)| Hypothesis {
            family,
            sigma: *sigma,
            ln_prior,
            at_least_zero: false,
        };
        Priors { always, hypotheses: sigmas.iter().enumerate().map(hypothesis).collect() }
    }
}

/// A hypothesis that belongs to the explanation.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Position among the hypotheses: the most probable one of its family.
    pub index: usize,
    /// Its size: mean and standard deviation, given the other members.
    pub value: f64,
    /// One standard deviation of `value`.
    pub sigma: f64,
    /// ln of the odds of its family against no hypothesis in its place.
    pub ln_odds: f64,
    /// Families that could replace it, most probable first, with their probability relative to that of its own family (at most about 1).
    pub alternatives: Vec<(usize, f64)>,
}

/// A hypothesis as the only member of the explanation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Single {
    /// Position among the hypotheses.
    pub index: usize,
    /// Its odds against no hypothesis.
    pub odds: f64,
    /// Its size: mean.
    pub value: f64,
    /// One standard deviation of `value`.
    pub sigma: f64,
}

/// The most probable explanation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Explanation {
    /// Empty if no hypothesis is needed.
    pub members: Vec<Member>,
    /// ln of its odds against the empty explanation.
    pub ln_odds: f64,
    /// ln of the odds of each family as the only member; families that contradict the residuals are missing.
    pub alone: BTreeMap<usize, f64>,
}

/// An explanation in which one balance has larger errors than declared, by a cause that is none of the hypotheses.
#[derive(Debug, Clone, PartialEq)]
pub struct Unmodelled {
    /// Position of the balance.
    pub balance: usize,
    /// Its errors over the declared ones: mean and standard deviation.
    pub error_ratio: (f64, f64),
    /// ln of the odds of this explanation against the best one without.
    pub ln_odds: f64,
    /// The other members.
    pub explanation: Explanation,
}

impl Likelihood {
    /// An uninformative likelihood of `parameters` parameters: no balance has been added.
    pub fn new(parameters: usize) -> Self {
        Likelihood::of(DMatrix::zeros(parameters, parameters), DVector::zeros(parameters))
    }

    /// A likelihood of hypotheses alone, from `C' S^-1 C` and `C' S^-1 r`; `S` includes the parameters that always differ from zero.
    pub fn of(precision: DMatrix<f64>, precision_mean: DVector<f64>) -> Self {
        Likelihood { precision, precision_mean, square: 0.0, rows: 0, ln_width: 0.0 }
    }

    /// Adds a balance with independent errors. `None` if its covariance is not positive definite, a number is not finite or shapes differ.
    pub fn add(&mut self, balance: &Balance) -> Option<()> {
        let Balance { residual, covariance, columns } = balance;
        let rows = residual.len();
        if covariance.shape() != (rows, rows) || columns.shape() != (rows, self.precision_mean.len()) {
            return None;
        }
        let numbers = residual.iter().chain(covariance.iter()).chain(columns.iter());
        if !numbers.clone().all(|number| number.is_finite()) {
            return None;
        }
        let lower = covariance.clone().cholesky()?.unpack();
        let columns = lower.solve_lower_triangular(columns)?;
        let residual = lower.solve_lower_triangular(residual)?;
        self.precision += columns.tr_mul(&columns);
        self.precision_mean += columns.tr_mul(&residual);
        (self.square, self.rows) = (self.square + residual.norm_squared(), self.rows + rows);
        Some(())
    }

    /// The likelihood of all these balances together, that of one of them with errors larger by a factor; `None` without any.
    pub fn together<'a>(
        balances: impl IntoIterator<Item = &'a Likelihood>,
        larger: Option<(usize, f64)>,
    ) -> Option<Likelihood> {
        let mut sum: Option<Likelihood> = None;
        for (index, balance) in balances.into_iter().enumerate() {
            let ratio = larger.filter(|(of, _)| *of == index).map_or(1.0, |(_, ratio)| ratio);
            let weight = (ratio * ratio).recip();
            let sum = sum.get_or_insert_with(|| Likelihood::new(balance.precision_mean.len()));
            sum.precision += weight * &balance.precision;
            sum.precision_mean += weight * &balance.precision_mean;
            sum.square += weight * balance.square;
            sum.ln_width += balance.rows as f64 * ratio.ln();
            sum.rows += balance.rows;
        }
        sum
    }

    /// ln of the density of the residuals without any hypothesis, up to a constant.
    fn ln_density(&self, always: &[f64]) -> Option<f64> {
        let first = always.len();
        let scale = DMatrix::from_diagonal(&DVector::from_column_slice(always));
        let own = &scale * self.precision.view((0, 0), (first, first)) * &scale;
        let factor = (DMatrix::identity(first, first) + own).cholesky()?;
        let mean = &scale * self.precision_mean.rows(0, first);
        let ln_root_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(0.5 * (mean.dot(&factor.solve(&mean)) - self.square) - ln_root_determinant - self.ln_width)
    }

    /// The most probable explanation in which one of `balances` has larger errors than declared, by a cause that is none of the hypotheses
    /// and as probable as `ln_prior` before; `known` is the best explanation without.
    pub fn explain_unmodelled(
        balances: &[&Likelihood],
        priors: &Priors,
        known: &Explanation,
        ln_prior: f64,
    ) -> Option<Unmodelled> {
        let ln_each = ln_prior - ((balances.len() * ERROR_RATIOS.len()) as f64).ln();
        let mut best: Option<(f64, usize, Vec<f64>)> = None;
        for index in 0..balances.len() {
            let mut ln_totals = Vec::new();
            for ratio in ERROR_RATIOS {
                let with = Likelihood::together(balances.iter().copied(), Some((index, ratio)))?;
                let marginal = with.marginalise(&priors.always)?;
                let singles =
                    SetSearch { likelihood: &marginal, hypotheses: &priors.hypotheses }.extensions(&[]);
                let single = singles.values().map(|single| single.ln_total).fold(0.0, f64::max);
                ln_totals.push(with.ln_density(&priors.always)? + single);
            }
            let ln_total = ln_totals.iter().copied().fold(f64::NEG_INFINITY, ln_sum);
            if best.as_ref().is_none_or(|best| ln_total > best.0) {
                best = Some((ln_total, index, ln_totals));
            }
        }
        let (ln_total, balance, ln_totals) = best?;
        let weights: Vec<f64> = ln_totals.iter().map(|ln| (ln - ln_total).exp()).collect();
        let moment = |of: &dyn Fn(f64) -> f64| {
            weights.iter().zip(ERROR_RATIOS).map(|(weight, ratio)| weight * of(ratio)).sum::<f64>()
        };
        let mean = moment(&|ratio| ratio);
        let largest = (0..weights.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b]))?;
        let with = Likelihood::together(balances.iter().copied(), Some((balance, ERROR_RATIOS[largest])))?;
        let explanation = with.explain(priors)?;
        let more = with.ln_density(&priors.always)? + explanation.ln_odds - ln_totals[largest];
        let without =
            Likelihood::together(balances.iter().copied(), None)?.ln_density(&priors.always)? + known.ln_odds;
        Some(Unmodelled {
            balance,
            error_ratio: (
                mean,
                moment(&|ratio| (ratio - mean).powi(2)).sqrt().hypot(RATIO_RESOLUTION * mean),
            ),
            ln_odds: ln_total + more + ln_each - without,
            explanation,
        })
    }

    /// Marginal likelihood of the hypotheses: integrates over the first parameters, which have standard deviations `always`.
    fn marginalise(&self, always: &[f64]) -> Option<Likelihood> {
        if always.is_empty() {
            return Some(self.clone());
        }
        let (first, count) = (always.len(), self.precision_mean.len());
        let scale = DMatrix::from_diagonal(&DVector::from_column_slice(always));
        let own = self.precision.view((0, 0), (first, first));
        let shared = &scale * self.precision.view((0, first), (first, count - first));
        let precision_mean = &scale * self.precision_mean.rows(0, first);
        let factor = (DMatrix::identity(first, first) + &scale * own * &scale).cholesky()?;
        let rest = self.precision.view((first, first), (count - first, count - first));
        Some(Likelihood::of(
            rest - shared.tr_mul(&factor.solve(&shared)),
            self.precision_mean.rows(first, count - first) - shared.tr_mul(&factor.solve(&precision_mean)),
        ))
    }

    /// The Cholesky factor of the scaled posterior precision `1 + D H D` of some parameters, and their scaled precision_mean.
    fn posterior(&self, free: &[(usize, f64)]) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
        let count = free.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            let ((a, of_a), (b, of_b)) = (free[i], free[j]);
            of_a * of_b * self.precision[(a, b)] + f64::from(u8::from(i == j))
        });
        let precision_mean =
            DVector::from_iterator(count, free.iter().map(|(a, sigma)| sigma * self.precision_mean[*a]));
        Some((matrix.cholesky()?, precision_mean))
    }

    /// Standard error with which the balances determine the size of each hypothesis by itself; infinite if they do not.
    pub fn standard_errors(&self, priors: &Priors) -> Option<Vec<f64>> {
        let information = self.marginalise(&priors.always)?.precision.diagonal();
        Some(information.iter().map(|information| information.max(0.0).sqrt().recip()).collect())
    }

    /// Every hypothesis as the only member of the explanation; `None` if the covariance of the declared parameters is singular.
    pub fn singles(&self, priors: &Priors) -> Option<Vec<Single>> {
        let Likelihood { precision, precision_mean, .. } = self.marginalise(&priors.always)?;
        let single = |(index, hypothesis): (usize, &Hypothesis)| {
            let precision_mean = precision_mean[index];
            let scaled = 1.0 + hypothesis.sigma.powi(2) * precision[(index, index)];
            let value = hypothesis.sigma.powi(2) * precision_mean / scaled;
            let possible = !(hypothesis.at_least_zero && value < 0.0);
            let odds = (0.5 * value * precision_mean - 0.5 * scaled.ln() + hypothesis.ln_prior).exp();
            possible.then(|| Single { index, odds, value, sigma: hypothesis.sigma / scaled.sqrt() })
        };
        Some(priors.hypotheses.iter().enumerate().filter_map(single).collect())
    }

    /// Smallest detectable size: its expected residuals make its family as probable as no hypothesis at all; infinite if none does.
    pub fn smallest_seen(&self, priors: &Priors, index: usize) -> Option<f64> {
        let marginal = self.marginalise(&priors.always)?;
        let family = priors.hypotheses[index].family;
        let ln_odds = |size: f64| {
            let of_family = priors.hypotheses.iter().enumerate().filter(|(_, other)| other.family == family);
            let each = of_family.map(|(other, Hypothesis { sigma, ln_prior, .. })| {
                let scaled = 1.0 + sigma * sigma * marginal.precision[(other, other)];
                let precision_mean = sigma * size * marginal.precision[(other, index)];
                0.5 * precision_mean * precision_mean / scaled - 0.5 * scaled.ln() + ln_prior
            });
            each.fold(f64::NEG_INFINITY, ln_sum)
        };
        // The odds grow with the size: bisection between zero and a multiple that is certainly detected.
        let (mut low, mut high) = (0.0, CERTAIN_SIGMAS * priors.hypotheses[index].sigma);
        if ln_odds(high) < 0.0 {
            return Some(f64::INFINITY);
        }
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if ln_odds(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(high)
    }

    /// The most probable set of hypotheses, found by adding, swapping and removing members until nothing is more probable.
    pub fn explain(&self, priors: &Priors) -> Option<Explanation> {
        let likelihood = self.marginalise(&priors.always)?;
        let search = SetSearch { likelihood: &likelihood, hypotheses: &priors.hypotheses };
        // Start from the empty set and from each of the most probable families: if one cause nearly equals the sum of two others, no
        // single swap leads from one explanation to the other.
        let mut starts: Vec<Extension> =
            search.extensions(&[]).into_values().filter(|extension| extension.ln_total > 0.0).collect();
        starts.sort_by(|a, b| b.ln_total.total_cmp(&a.ln_total));
        let starts = starts.iter().take(MAX_MEMBERS).map(|extension| vec![extension.index]);
        let ends = starts.chain([Vec::new()]).map(|start| search.climb(start));
        let best = ends.max_by(|a, b| search.ln_odds(a).total_cmp(&search.ln_odds(b)))?;
        search.explanation(&best)
    }
}

/// A family that may join the explanation.
#[derive(Debug, Clone, Copy)]
struct Extension {
    /// Its most probable hypothesis.
    index: usize,
    /// ln of the odds of the set with this hypothesis.
    ln_odds: f64,
    /// ln of the odds of the set with the whole family.
    ln_total: f64,
}

struct SetSearch<'a> {
    /// Of the hypotheses alone.
    likelihood: &'a Likelihood,
    hypotheses: &'a [Hypothesis],
}

impl SetSearch<'_> {
    fn free(&self, members: &[usize]) -> Vec<(usize, f64)> {
        members.iter().map(|index| (*index, self.hypotheses[*index].sigma)).collect()
    }

    /// ln of the probability of a set over that of the empty one.
    fn ln_odds(&self, members: &[usize]) -> f64 {
        let Some((factor, precision_mean)) = self.likelihood.posterior(&self.free(members)) else {
            return f64::NEG_INFINITY;
        };
        let scaled = factor.solve(&precision_mean);
        let below = |(index, value): (&usize, &f64)| self.hypotheses[*index].at_least_zero && *value < 0.0;
        if members.iter().zip(scaled.iter()).any(below) {
            return f64::NEG_INFINITY;
        }
        let ln_root_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        let ln_prior: f64 = members.iter().map(|index| self.hypotheses[*index].ln_prior).sum();
        0.5 * precision_mean.dot(&scaled) - ln_root_determinant + ln_prior
    }

    /// Every family without a member in `rest`, with its odds if it is added.
    fn extensions(&self, rest: &[usize]) -> BTreeMap<usize, Extension> {
        let mut extensions: BTreeMap<usize, Extension> = BTreeMap::new();
        let mut set = rest.to_vec();
        for (index, hypothesis) in self.hypotheses.iter().enumerate() {
            if rest.iter().any(|member| self.hypotheses[*member].family == hypothesis.family) {
                continue;
            }
            set.push(index);
            let ln_odds = self.ln_odds(&set);
            set.pop();
            if ln_odds == f64::NEG_INFINITY {
                continue;
            }
            let extension = Extension { index, ln_odds, ln_total: ln_odds };
            let join = |known: &mut Extension| {
                let ln_total = ln_sum(known.ln_total, ln_odds);
                *known = Extension { ln_total, ..if ln_odds > known.ln_odds { extension } else { *known } };
            };
            extensions.entry(hypothesis.family).and_modify(join).or_insert(extension);
        }
        extensions
    }

    /// Changes one member at a time until no change makes the set more probable.
    fn climb(&self, mut members: Vec<usize>) -> Vec<usize> {
        // Each member is added, replaced and removed once. With single-hypothesis families the search ends by itself: each change improves it.
        for _ in 0..MAX_MEMBERS * MAX_MEMBERS {
            let Some(better) = self.better(&members) else { break };
            members = better;
        }
        members
    }

    /// The set with the largest gain from adding, removing or replacing one member; `None` if no change gains.
    fn better(&self, members: &[usize]) -> Option<Vec<usize>> {
        let places = (members.len() + 1).min(MAX_MEMBERS);
        let mut best: (f64, Option<Vec<usize>>) = (ROUNDING, None);
        let mut try_set = |gain: f64, set: Vec<usize>| {
            if gain > best.0 {
                best = (gain, Some(set));
            }
        };
        for place in 0..places {
            let rest = without(members, place);
            let extensions = self.extensions(&rest);
            let removed = self.ln_odds(&rest);
            let family = members.get(place).map(|index| self.hypotheses[*index].family);
            let now =
                family.map_or(removed, |family| extensions.get(&family).map_or(removed, |own| own.ln_total));
            try_set(removed - now, rest.clone());
            for (other, extension) in &extensions {
                let set: Vec<usize> = rest.iter().copied().chain([extension.index]).collect();
                // The best hypothesis of the same family may change if the other members have changed.
                let own = Some(*other) == family;
                let gain =
                    if own { extension.ln_odds - self.ln_odds(members) } else { extension.ln_total - now };
                try_set(gain, set);
            }
        }
        best.1
    }

    fn explanation(&self, members: &[usize]) -> Option<Explanation> {
        let free = self.free(members);
        let (factor, precision_mean) = self.likelihood.posterior(&free)?;
        let (solved, inverse) = (factor.solve(&precision_mean), factor.inverse());
        let member = |(place, index): (usize, &usize)| {
            let rest = without(members, place);
            let mut extensions = self.extensions(&rest);
            let own = extensions.remove(&self.hypotheses[*index].family)?;
            let mut alternatives: Vec<(usize, f64)> = extensions
                .into_iter()
                .map(|(family, extension)| (family, (extension.ln_total - own.ln_total).exp()))
                .collect();
            alternatives.sort_by(|a, b| b.1.total_cmp(&a.1));
            let sigma = free[place].1;
            Some(Member {
                index: *index,
                value: sigma * solved[place],
                sigma: sigma * inverse[(place, place)].max(0.0).sqrt(),
                ln_odds: own.ln_total - self.ln_odds(&rest),
                alternatives,
            })
        };
        let members_found: Option<Vec<Member>> = members.iter().enumerate().map(member).collect();
        let alone = self
            .extensions(&[])
            .into_iter()
            .map(|(family, extension)| (family, extension.ln_total))
            .collect();
        Some(Explanation { members: members_found?, ln_odds: self.ln_odds(members), alone })
    }
}

fn ln_sum(a: f64, b: f64) -> f64 {
    let (large, small) = (a.max(b), a.min(b));
    if small == f64::NEG_INFINITY { large } else { large + (small - large).exp().ln_1p() }
}

fn without(members: &[usize], place: usize) -> Vec<usize> {
    members.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, member)| *member).collect()
}

/// Onset and shape of a cause along the positions of a recording: times, or numbers of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeHistory {
    /// Position of its onset; minus infinity if it acts throughout.
    pub onset: f64,
    /// Its shape from there on.
    pub shape: Shape,
}

/// Shape of a cause from its onset on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// At full size.
    Step,
    /// Grows by its full size in each of these lengths.
    Ramp(f64),
    /// At full size, then decays with this constant.
    Decay(f64),
}

impl TimeHistory {
    /// Acts throughout.
    pub const THROUGHOUT: TimeHistory = TimeHistory { onset: f64::NEG_INFINITY, shape: Shape::Step };

    /// Value at a position, as a share of the full size.
    pub fn at(self, position: f64) -> f64 {
        let since = position - self.onset;
        match self.shape {
            Shape::Step => f64::from(u8::from(position >= self.onset)),
            Shape::Ramp(length) => since.max(0.0) / length,
            Shape::Decay(constant) => {
                if since >= 0.0 {
                    (-since / constant).exp()
                } else {
                    0.0
                }
            }
        }
    }

    /// Mean value between two positions; the value at the first one if the second one is not after it.
    pub fn mean(self, start: f64, end: f64) -> f64 {
        let length = end - start;
        if length <= 0.0 {
            return self.at(start);
        }
        let acting = (end - self.onset).clamp(0.0, length);
        match self.shape {
            Shape::Step => acting / length,
            Shape::Ramp(full) if acting < length => 0.5 * acting * acting / length / full,
            Shape::Ramp(_) => self.at(0.5 * (start + end)),
            Shape::Decay(constant) => (self.at(end - acting) - self.at(end)) * constant / length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn columns(rows: usize, parameters: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, parameters, |i, j| ((i + 1) as f64 * (j as f64 + 1.3)).sin())
    }

    /// ln of a zero-mean normal density.
    fn ln_density(r: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let factor = covariance.clone().cholesky().unwrap();
        -0.5 * r.dot(&factor.solve(r)) - factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    }

    proptest! {
        /// Against the density of the residuals with the parameters' covariance written out.
        #[test]
        fn evidence_is_that_of_the_whole_density(
            residual in proptest::collection::vec(-3.0..3.0_f64, 6),
            sigmas in proptest::collection::vec(0.1..3.0_f64, 3),
        ) {
            let residual = DVector::from_vec(residual);
            let alike = DMatrix::from_fn(6, 6, |i, j| (-((i as f64 - j as f64) / 2.0).powi(2)).exp());
            let covariance = alike + DMatrix::identity(6, 6);
            let columns = columns(6, 3);
            let mut likelihood = Likelihood::new(3);
            let balance = Balance { residual, covariance, columns };
            likelihood.add(&balance).unwrap();
            let scaled = &balance.columns * DMatrix::from_diagonal(&DVector::from_vec(sigmas.clone()));
            let whole = &balance.covariance + &scaled * scaled.transpose();
            let expected =
                ln_density(&balance.residual, &whole) - ln_density(&balance.residual, &balance.covariance);
            // Prior odds of 1: the ln of the odds is that of the evidence.
            let all = Priors::even(Vec::new(), &sigmas, 3.0);
            let search = SetSearch { likelihood: &likelihood, hypotheses: &all.hypotheses };
            prop_assert!((search.ln_odds(&[0, 1, 2]) - expected).abs() < 1e-9);
            // Generalised least squares of the last parameter with the others in the covariance.
            let priors = Priors::even(sigmas[..2].to_vec(), &[1.0], 0.1);
            let first = balance.columns.columns(0, 2) * DMatrix::from_diagonal(&DVector::from_row_slice(&sigmas[..2]));
            let factor = (&balance.covariance + &first * first.transpose()).cholesky().unwrap();
            let last = balance.columns.column(2).into_owned();
            let error = last.dot(&factor.solve(&last)).sqrt().recip();
            prop_assert!((likelihood.standard_errors(&priors).unwrap()[0] / error - 1.0).abs() < 1e-9);
        }
    }

    /// Draws without a fault alarm in less than one of a hundred; a fault of eight standard errors is found and sized.
    #[test]
    fn sound_draws_are_quiet_and_a_fault_is_named() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_pcg::Pcg64::seed_from_u64(7);
        let columns = columns(30, 9);
        let priors = Priors::even(vec![0.3; 2], &[2.0; 7], 0.1);
        let (mut alarms, mut named) = (0, 0);
        let draws = 2000;
        for _ in 0..draws {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let declared = DVector::from_fn(2, |_, _| 0.3 * normal());
            let fault_free = DVector::from_fn(30, |_, _| normal()) + columns.columns(0, 2) * declared;
            let explain = |residual: DVector<f64>| {
                let covariance = DMatrix::identity(30, 30);
                let mut likelihood = Likelihood::new(9);
                likelihood.add(&Balance { residual, covariance, columns: columns.clone() }).unwrap();
                likelihood.explain(&priors).unwrap()
            };
            alarms += usize::from(!explain(fault_free.clone()).members.is_empty());
            let size = 8.0 / columns.column(4).norm();
            let found = explain(fault_free + size * columns.column(4)).members;
            let right =
                |member: &Member| member.index == 2 && (member.value - size).abs() < 4.0 * member.sigma;
            named += usize::from(found.len() == 1 && found.iter().all(right));
        }
        assert!(alarms <= draws / 100, "{alarms} alarms in {draws} fault-free draws");
        // Two of the columns are nearly one, so that a few draws name the other.
        assert!(named > draws * 9 / 10, "{named} of {draws} named");
    }

    /// All sets of at most two of eight hypotheses in six families, against the search: never worse where the best has two members at most.
    #[test]
    fn no_set_of_two_is_better_than_what_is_found() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_pcg::Pcg64::seed_from_u64(11);
        let columns = columns(12, 8);
        let mut priors = Priors::even(Vec::new(), &[2.0; 8], 0.5);
        // Two families of two; one parameter is never negative.
        priors.hypotheses[1].family = 0;
        priors.hypotheses[3].family = 2;
        priors.hypotheses[5].at_least_zero = true;
        for _ in 0..300 {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let (a, b) = (1.5 * normal(), 1.5 * normal());
            let residual =
                DVector::from_fn(12, |row, _| normal() + a * columns[(row, 2)] + b * columns[(row, 5)]);
            let mut likelihood = Likelihood::new(8);
            let covariance = DMatrix::identity(12, 12);
            likelihood.add(&Balance { residual, covariance, columns: columns.clone() }).unwrap();
            let search = SetSearch { likelihood: &likelihood, hypotheses: &priors.hypotheses };
            let family = |index: usize| priors.hypotheses[index].family;
            let singles = (0..8).map(|one| vec![one]);
            let pairs = (0..8).flat_map(|one| (one + 1..8).map(move |other| vec![one, other]));
            let sets = singles.chain(pairs.filter(|set| family(set[0]) != family(set[1])));
            let best = sets.map(|set| search.ln_odds(&set)).fold(0.0, f64::max);
            let found = likelihood.explain(&priors).unwrap();
            // A family of two can be more probable than a single hypothesis that is the most probable by itself: by ln 2 a family at most.
            assert!(found.ln_odds > best - 2.0 * 2.0_f64.ln(), "{} below {best}", found.ln_odds);
            assert!(found.members.iter().all(|member| member.index != 5 || member.value >= 0.0));
        }
    }

    /// Two balances that a fault explains, and two of which one has five times its errors: the fault alone is the answer, or that balance.
    #[test]
    fn errors_of_unknown_cause_are_told_from_a_hypothesis() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_pcg::Pcg64::seed_from_u64(5);
        let all = columns(30, 6);
        let priors = Priors::even(vec![0.3; 2], &[2.0; 4], 0.1);
        let parts = 200;
        let [mut wrong, mut missed] = [0, 0];
        for part in 0..parts {
            let is_fault = part % 2 == 0;
            let fault = if is_fault { 8.0 / all.column(3).norm() } else { 0.0 };
            let likelihood = |ratio: f64, rng: &mut rand_pcg::Pcg64| {
                let noise = DVector::from_fn(30, |_, _| {
                    let normal: f64 = StandardNormal.sample(rng);
                    ratio * normal
                });
                let residual = noise + fault * all.column(3);
                let covariance = DMatrix::identity(30, 30);
                let mut likelihood = Likelihood::new(6);
                likelihood.add(&Balance { residual, covariance, columns: all.clone() }).unwrap();
                likelihood
            };
            let each = [likelihood(1.0, &mut rng), likelihood(if is_fault { 1.0 } else { 5.0 }, &mut rng)];
            let known = Likelihood::together(&each, None).unwrap().explain(&priors).unwrap();
            let each: Vec<&Likelihood> = each.iter().collect();
            let none = Likelihood::explain_unmodelled(&each, &priors, &known, (0.1_f64 / 4.0).ln()).unwrap();
            let (ratio, sigma) = none.error_ratio;
            if is_fault {
                wrong += usize::from(none.ln_odds > 0.0);
            } else {
                let is_right = none.ln_odds > 0.0 && none.balance == 1 && none.explanation.members.is_empty();
                missed += usize::from(!is_right || (ratio - 5.0).abs() > 4.0 * sigma);
            }
        }
        assert_eq!((wrong, missed), (0, 0), "of {parts}");
        // Without always-present parameters the density is that of a scaled normal distribution.
        let balance = Likelihood { square: 40.0, rows: 30, ..Likelihood::new(1) };
        let scaled = Likelihood::together([&balance], Some((0, 2.0))).unwrap();
        let density = scaled.ln_density(&[]).unwrap() - balance.ln_density(&[]).unwrap();
        assert!((density - (15.0 - 30.0 * 2.0_f64.ln())).abs() < 1e-12, "{density}");
    }

    #[test]
    fn a_balance_without_a_density_is_not_added() {
        let singular = Balance {
            residual: DVector::zeros(2),
            covariance: DMatrix::from_element(2, 2, 1.0),
            columns: DMatrix::zeros(2, 1),
        };
        let mut likelihood = Likelihood::new(1);
        assert_eq!(likelihood.add(&singular), None);
        assert_eq!(likelihood, Likelihood::new(1));
    }

    /// One reading of 3 with a standard error of 1 for a size of 2: by hand 0.8 of the reading, and the ratio of two normal densities.
    #[test]
    fn a_single_hypothesis_is_a_text_book_case() {
        let mut likelihood = Likelihood::new(1);
        let balance = Balance {
            residual: DVector::from_element(1, 3.0),
            covariance: DMatrix::from_element(1, 1, 1.0),
            columns: DMatrix::from_element(1, 1, 1.0),
        };
        likelihood.add(&balance).unwrap();
        let singles = likelihood.singles(&Priors::even(Vec::new(), &[2.0], 0.1)).unwrap();
        assert_eq!(singles.len(), 1, "{singles:?}");
        let single = &singles[0];
        let density = |variance: f64| (-4.5 / variance).exp() / variance.sqrt();
        assert!((single.value - 2.4).abs() < 1e-12 && (single.sigma - 0.8_f64.sqrt()).abs() < 1e-12);
        assert!((single.odds / (0.1 * density(5.0) / density(1.0)) - 1.0).abs() < 1e-12);
    }
}

#[cfg(test)]
mod time_history_tests {
    use super::*;

    #[test]
    fn means_are_the_integrals() {
        for shape in [Shape::Step, Shape::Ramp(3600.0), Shape::Decay(30.0)] {
            for onset in [0.0, 130.0, 150.0, 300.0] {
                let history = TimeHistory { onset, shape };
                let parts = 10_000;
                let sum: f64 = (0..parts)
                    .map(|part| history.at(100.0 + 100.0 * (f64::from(part) + 0.5) / f64::from(parts)))
                    .sum();
                // The step falls within one of the 10 000 parts.
                assert!((history.mean(100.0, 200.0) - sum / f64::from(parts)).abs() < 1e-4, "{history:?}");
            }
        }
    }

    #[test]
    fn what_acts_throughout_has_full_size_everywhere() {
        let history = TimeHistory::THROUGHOUT;
        assert_eq!([history.at(-1e9), history.at(0.0), history.mean(0.0, 9.0)], [1.0; 3]);
    }
}
