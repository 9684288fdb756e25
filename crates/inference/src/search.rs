//! The search for the most probable set of causes if each set needs a fit of a nonlinear model.
//!
//! Fits are costly; linearisation about a fit predicts cheaply what one more cause would add. The search therefore predicts every set that
//! differs from the best one by one more cause, or by another cause in the place of a member, and fits the most promising sets. It ends if
//! none of them is more probable. [`crate::hypotheses`] does the same for a linear model.

use mapper_numerics::parallel;
use std::collections::{BTreeMap, BTreeSet};

/// Candidate causes, and the model whose fits decide between sets of them.
pub trait Causes: Sync {
    /// The best fit of a set of causes.
    type Fit: Clone + Send + Sync;
    /// Start of a fit.
    type Start: Clone + Send + Sync;

    /// The causes of a fit, ascending.
    fn members(&self, fit: &Self::Fit) -> Vec<usize>;

    /// The family of a cause: at most one cause of a family is a member, for example drifts with different onsets.
    fn family(&self, cause: usize) -> usize;

    /// ln of the probability of a fit, up to a constant that all fits share.
    fn ln_odds(&self, fit: &Self::Fit) -> f64;

    /// Predicted gain of each further cause, from a linearisation about a fit.
    fn extensions(&self, base: &Self::Fit) -> Vec<Extension<Self::Start>>;

    /// Start for the fit of the same set except for one cause.
    fn without(&self, fit: &Self::Fit, cause: usize) -> Self::Start;

    /// Fits from a start; `None` if the model has no result or if one of the causes has no effect.
    fn fit(&self, start: &Self::Start) -> Option<Self::Fit>;

    /// Whether the search should add a cause to `to`, which it reached from `from`.
    fn should_extend(&self, from: &Self::Fit, to: &Self::Fit) -> bool;
}

/// A cause that may be added to a fit.
#[derive(Debug, Clone)]
pub struct Extension<Start> {
    /// The cause.
    pub cause: usize,
    /// Predicted growth of ln of the odds.
    pub ln_gain: f64,
    /// Start of the fit.
    pub start: Start,
}

/// Limits of a search.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Maximum number of members of a set.
    pub members: usize,
    /// Single causes from which the search starts.
    pub starts: usize,
    /// Maximum number of sets fitted in each round.
    pub fits: usize,
    /// A set is fitted if its predicted ln of odds is at most this far below that of the best fit: linear predictions are not exact.
    pub slack: f64,
}

/// The best known fit of each set of causes.
#[derive(Debug, Clone)]
pub struct Known<Fit>(BTreeMap<Vec<usize>, Fit>);

impl<Fit> Default for Known<Fit> {
    fn default() -> Self {
        Known(BTreeMap::new())
    }
}

impl<Fit: Clone + Send + Sync> Known<Fit> {
    /// Stores a fit, unless one of the same causes is more probable.
    pub fn keep<C: Causes<Fit = Fit>>(&mut self, causes: &C, fit: Fit) {
        let members = causes.members(&fit);
        let better = |known: &Fit| causes.ln_odds(known) >= causes.ln_odds(&fit);
        if !self.0.get(&members).is_some_and(better) {
            self.0.insert(members, fit);
        }
    }

    /// The fit of these causes, ascending.
    pub fn get(&self, members: &[usize]) -> Option<&Fit> {
        self.0.get(members)
    }

    /// All fits with causes, most probable first.
    pub fn ranked<C: Causes<Fit = Fit>>(&self, causes: &C) -> Vec<Fit> {
        let mut fits: Vec<Fit> =
            self.0.iter().filter(|(members, _)| !members.is_empty()).map(|(_, fit)| fit.clone()).collect();
        fits.sort_by(|a, b| causes.ln_odds(b).total_cmp(&causes.ln_odds(a)));
        fits
    }

    /// Fits from all starts in parallel, and keeps the results.
    pub fn fit_all<C: Causes<Fit = Fit>>(&mut self, causes: &C, starts: &[C::Start]) {
        for fit in parallel::map(starts, |start| causes.fit(start)).into_iter().flatten() {
            self.keep(causes, fit);
        }
    }
}

/// Maximum number of sets of the same families that are fitted in one round. Bound: predictions for neighbouring onsets are similar.
const MAX_FITS_PER_FAMILY: usize = 2;

/// Searches sets of several causes; `known` has the fit without causes and those of all single causes.
pub fn extend<C: Causes>(causes: &C, known: &mut Known<C::Fit>, limits: Limits) {
    let null = known.get(&[]).map_or(f64::NEG_INFINITY, |null| causes.ln_odds(null));
    // A single cause that is far less probable than none is not part of a probable pair.
    let is_plausible = |fit: &C::Fit| causes.ln_odds(fit) > null - limits.slack;
    let ranked = known.ranked(causes).into_iter();
    let singles: Vec<C::Fit> = ranked.filter(is_plausible).take(limits.starts).collect();
    let mut reduced = BTreeMap::new();
    for single in &singles {
        climb_beyond(causes, known, single, limits, BTreeSet::from([Vec::new()]), &mut reduced);
    }
}

/// Changes one cause at a time, from `start` until no change makes the set more probable. `known` gets every fit.
pub fn climb<C: Causes>(causes: &C, known: &mut Known<C::Fit>, start: &C::Fit, limits: Limits) {
    climb_beyond(causes, known, start, limits, BTreeSet::new(), &mut BTreeMap::new());
}

/// As [`climb`]; supersets by one of those in `extended` are known. `reduced`: sets with fitted subsets, and the ln of odds of that fit.
fn climb_beyond<C: Causes>(
    causes: &C,
    known: &mut Known<C::Fit>,
    start: &C::Fit,
    limits: Limits,
    mut extended: BTreeSet<Vec<usize>>,
    reduced: &mut BTreeMap<Vec<usize>, u64>,
) {
    let mut best = start.clone();
    let mut may_grow = true;
    // Candidate sets that are not fitted yet, with their predicted ln of odds and their starts.
    let mut candidates: BTreeMap<Vec<usize>, (f64, C::Start)> = BTreeMap::new();
    loop {
        let members = causes.members(&best);
        // Refit each set without one cause, from this fit: otherwise a set may look useful because its subsets were fitted badly.
        let removable = if members.len() > 1 { members.as_slice() } else { &[] };
        let from = causes.ln_odds(&best).to_bits();
        if reduced.insert(members.clone(), from) != Some(from) {
            let without = removable.iter().map(|cause| causes.without(&best, *cause));
            known.fit_all(causes, &without.collect::<Vec<_>>());
        }
        let subsets = members.iter().map(|cause| without(&members, *cause));
        let full_set = (may_grow && members.len() < limits.members).then(|| members.clone());
        let bases: Vec<Vec<usize>> =
            subsets.chain(full_set).filter(|base| extended.insert(base.clone())).collect();
        for base_members in bases {
            let Some(base) = known.get(&base_members) else { continue };
            for Extension { cause, ln_gain, start } in causes.extensions(base) {
                let mut set = base_members.clone();
                set.push(cause);
                set.sort_unstable();
                let predicted = causes.ln_odds(base) + ln_gain;
                if candidates.get(&set).is_none_or(|(other, _)| *other < predicted) {
                    candidates.insert(set, (predicted, start));
                }
            }
        }
        candidates.retain(|set, _| known.get(set).is_none());
        let highest = known.ranked(causes).first().map_or(f64::NEG_INFINITY, |first| causes.ln_odds(first));
        let starts = select_starts(causes, &candidates, limits, highest.max(causes.ln_odds(&best)));
        known.fit_all(causes, &starts);
        let next = known.ranked(causes).into_iter().next();
        let Some(next) = next.filter(|next| causes.ln_odds(next) > causes.ln_odds(&best)) else { return };
        may_grow = causes.should_extend(&best, &next);
        best = next;
    }
}

/// The starts of the most probable candidates, given the ln of odds of the best fit.
fn select_starts<C: Causes>(
    causes: &C,
    candidates: &BTreeMap<Vec<usize>, (f64, C::Start)>,
    limits: Limits,
    best: f64,
) -> Vec<C::Start> {
    let within_slack = candidates.iter().filter(|(_, (predicted, _))| *predicted > best - limits.slack);
    let mut selected: Vec<_> = within_slack.collect();
    selected.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    let mut counts: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    selected.retain(|(set, _)| {
        let mut families: Vec<usize> = set.iter().map(|cause| causes.family(*cause)).collect();
        families.sort_unstable();
        let count = counts.entry(families).or_default();
        *count += 1;
        *count <= MAX_FITS_PER_FAMILY
    });
    selected.into_iter().take(limits.fits).map(|(_, (_, start))| start.clone()).collect()
}

fn without(members: &[usize], cause: usize) -> Vec<usize> {
    members.iter().copied().filter(|other| *other != cause).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Causes that change a reading by `exp` of a line, so that a straight line from a fit is not exact; each costs as much as its prior says.
    struct Bent {
        columns: DMatrix<f64>,
        reading: DVector<f64>,
    }

    #[derive(Clone)]
    struct Fit {
        sizes: Vec<(usize, f64)>,
        misfit: f64,
    }

    const LN_PRIOR: f64 = -4.0;

    impl Bent {
        fn left(&self, sizes: &[(usize, f64)]) -> DVector<f64> {
            let line: DVector<f64> =
                sizes.iter().fold(DVector::zeros(self.reading.len()), |sum, (cause, size)| {
                    sum + *size * self.columns.column(*cause)
                });
            &self.reading - line.map(f64::exp)
        }

        /// Gauss-Newton to the end.
        fn fitted(&self, mut sizes: Vec<(usize, f64)>) -> Fit {
            for _ in 0..50 {
                let left = self.left(&sizes);
                let predicted = &self.reading - &left;
                let slopes = DMatrix::from_fn(left.len(), sizes.len(), |row, place| {
                    self.columns[(row, sizes[place].0)] * predicted[row]
                });
                let matrix: DMatrix<f64> =
                    slopes.tr_mul(&slopes) + 1e-9 * DMatrix::identity(sizes.len(), sizes.len());
                let step = matrix.cholesky().unwrap().solve(&slopes.tr_mul(&left));
                sizes.iter_mut().zip(step.iter()).for_each(|((_, size), by)| *size += by.clamp(-0.3, 0.3));
            }
            sizes.sort_by_key(|(cause, _)| *cause);
            Fit { misfit: self.left(&sizes).norm_squared(), sizes }
        }

        fn of(&self, causes: &[usize]) -> Fit {
            self.fitted(causes.iter().map(|cause| (*cause, 0.0)).collect())
        }
    }

    impl Causes for Bent {
        type Fit = Fit;
        type Start = Vec<(usize, f64)>;

        fn members(&self, fit: &Fit) -> Vec<usize> {
            fit.sizes.iter().map(|(cause, _)| *cause).collect()
        }

        /// Causes 6 and 7 are forms of one.
        fn family(&self, cause: usize) -> usize {
            cause.min(6)
        }

        fn ln_odds(&self, fit: &Fit) -> f64 {
            -0.5 * fit.misfit + LN_PRIOR * fit.sizes.len() as f64
        }

        fn extensions(&self, base: &Fit) -> Vec<Extension<Self::Start>> {
            let left = self.left(&base.sizes);
            let used: Vec<usize> = self.members(base).iter().map(|cause| self.family(*cause)).collect();
            let free = (0..self.columns.ncols()).filter(|cause| !used.contains(&self.family(*cause)));
            free.map(|cause| {
                let slope = self.columns.column(cause).component_mul(&(&self.reading - &left));
                let size = slope.dot(&left) / slope.norm_squared();
                let ln_gain = 0.5 * size * slope.dot(&left) + LN_PRIOR;
                Extension {
                    cause,
                    ln_gain,
                    start: base.sizes.iter().copied().chain([(cause, size)]).collect(),
                }
            })
            .collect()
        }

        fn without(&self, fit: &Fit, cause: usize) -> Self::Start {
            fit.sizes.iter().copied().filter(|(other, _)| *other != cause).collect()
        }

        fn fit(&self, start: &Self::Start) -> Option<Fit> {
            Some(self.fitted(start.clone()))
        }

        fn should_extend(&self, _: &Fit, _: &Fit) -> bool {
            true
        }
    }

    /// Of two causes with noise, against all sets of at most two: what is found is as probable as the best of them or more, and two forms of
    /// one cause are never both in it.
    #[test]
    fn no_set_of_two_is_better_than_what_is_found() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_pcg::Pcg64::seed_from_u64(5);
        let columns = DMatrix::from_fn(20, 8, |row, cause| ((row + 1) as f64 * (cause as f64 + 1.3)).sin());
        let (mut better, draws) = (0, 60);
        for _ in 0..draws {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let (a, b) = (0.8 * normal(), 0.8 * normal());
            let truth = (a * columns.column(1) + b * columns.column(6)).map(f64::exp);
            let bent = Bent {
                reading: truth + DVector::from_fn(20, |_, _| 0.3 * normal()),
                columns: columns.clone(),
            };
            let pairs = (0..8).flat_map(|one| (one + 1..8).map(move |other| vec![one, other]));
            let all = (0..8).map(|one| vec![one]).chain(pairs.filter(|pair| pair != &vec![6, 7]));
            let best =
                all.map(|set| bent.ln_odds(&bent.of(&set))).fold(bent.ln_odds(&bent.of(&[])), f64::max);
            let mut known = Known::default();
            known.keep(&bent, bent.of(&[]));
            (0..8).for_each(|cause| known.keep(&bent, bent.of(&[cause])));
            extend(&bent, &mut known, Limits { members: 3, starts: 2, fits: 4, slack: 3.0 });
            let nothing = bent.of(&[]);
            let found = known.ranked(&bent).into_iter().chain([nothing]);
            let found = found.max_by(|a, b| bent.ln_odds(a).total_cmp(&bent.ln_odds(b))).unwrap();
            better += usize::from(bent.ln_odds(&found) > best - 1e-6);
            assert!(!(bent.members(&found).contains(&6) && bent.members(&found).contains(&7)));
        }
        // A straight line leads astray now and then.
        assert!(better >= draws * 19 / 20, "{better} of {draws}");
    }
}
