//! Searches the effects and pairs of effects that explain the judged channels, with their probabilities.

use crate::driven::fit::{Columns, SideFit, SideProblem};
use crate::driven::side::SideModel;
use crate::driven::side_diagnosis::NotDiagnosable;
use crate::gap::best_fit::coordinate::{Coordinate, typical};
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::{evidence_needed, prior_of_number, smallest_size};
use crate::gap::report::{SmallestSeen, size_in_words};
use crate::gap::residuals::study::{Hypothesis, members};
use mapper_inference::posterior::{CauseProbabilities, CauseSet, Rules, shares};
use mapper_inference::search::{Causes, Extension, Known, Limits, extend};
use mapper_numerics::{ROUNDING, parallel};
use mapper_physics::rig::effect::{EffectInfo, EffectParameter};

pub(crate) struct SearchResult {
    pub(crate) null: SideFit,
    /// Effects and pairs of effects, most probable first.
    pub(crate) fits: Vec<SideFit>,
}

/// Prior probability that a cause is outside the library. Judgement: as small as the remainder of the library priors.
const PRIOR_OUTSIDE: f64 = 0.1;

fn prior(calibration: &Calibration, effects: usize, fit: &SideFit) -> f64 {
    prior_of_number(calibration, effects, fit.hypothesis.effects.len())
}

/// Logarithm of the evidence of a fit, including its prior.
pub(crate) fn weight(calibration: &Calibration, effects: usize, fit: &SideFit) -> f64 {
    fit.score + prior(calibration, effects, fit)
}

/// Start values of an effect, in typical steps from neutral. Bound: effort; a visible size, a large one, and the other side.
const START_STEPS: [f64; 3] = [1.0, 3.0, -1.0];

fn start_values(info: &EffectInfo) -> Vec<Vec<f64>> {
    let at = |share: f64| -> Vec<f64> {
        let value = |p: &EffectParameter| {
            let coordinate = Coordinate::new(p);
            // For a parameter that spans decades, a step is a factor.
            let value = if coordinate.is_logarithmic() {
                coordinate.value(coordinate.of(p.neutral + p.typical_step))
            } else {
                p.neutral + share * p.typical_step
            };
            value.clamp(p.low, p.high)
        };
        info.parameters.iter().map(value).collect()
    };
    let neutral: Vec<f64> = info.parameters.iter().map(|p| p.neutral).collect();
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for share in START_STEPS {
        let start = at(share);
        if start != neutral && !starts.contains(&start) {
            starts.push(start);
        }
    }
    starts
}

/// Limits of the search. Bound: effort. Every effect is tried, because the linear gain depends on the model error, which a cause reduces.
const LIMITS: Limits = Limits { members: 2, starts: 3, fits: 6, slack: f64::INFINITY };

pub(crate) fn search<S: SideModel>(
    problem: &SideProblem<'_, S>,
    effects: &[usize],
    counts: &[bool],
    calibration: &Calibration,
) -> Option<SearchResult> {
    let search = SideSearch { problem, effects, counts, calibration };
    let null = problem.fit(&problem.nothing(), counts)?;
    let mut known = Known::default();
    known.keep(&search, null.clone());
    let starts_of = |effect: &usize| search.starts(&problem.nothing(), *effect);
    known.fit_all(&search, &effects.iter().flat_map(starts_of).collect::<Vec<_>>());
    let best = known.ranked(&search).first().map_or(f64::NEG_INFINITY, |best| best.score);
    if best - null.score > calibration.threshold {
        extend(&search, &mut known, LIMITS);
    }
    Some(SearchResult { null, fits: known.ranked(&search) })
}

struct SideSearch<'a, S> {
    problem: &'a SideProblem<'a, S>,
    effects: &'a [usize],
    counts: &'a [bool],
    calibration: &'a Calibration,
}

impl<S: SideModel> SideSearch<'_, S> {
    fn starts(&self, base: &Hypothesis, effect: usize) -> Vec<Hypothesis> {
        let with = |values: Vec<f64>| {
            let mut start = base.clone();
            start.effects.push((effect, values));
            start
        };
        start_values(self.problem.effects[effect].info()).into_iter().map(with).collect()
    }
}

impl<S: SideModel> Causes for SideSearch<'_, S> {
    type Fit = SideFit;
    type Start = Hypothesis;

    fn members(&self, fit: &SideFit) -> Vec<usize> {
        members(&fit.hypothesis)
    }

    fn family(&self, cause: usize) -> usize {
        cause
    }

    fn ln_odds(&self, fit: &SideFit) -> f64 {
        weight(self.calibration, self.effects.len(), fit)
    }

    fn extensions(&self, base: &SideFit) -> Vec<Extension<Hypothesis>> {
        let Some(linearised) = self.problem.linearise(base, self.counts) else { return Vec::new() };
        let used = members(&base.hypothesis);
        let others = self.effects.iter().filter(|effect| !used.contains(effect));
        let starts: Vec<(usize, Hypothesis)> = others
            .flat_map(|cause| self.starts(&base.hypothesis, *cause).into_iter().map(|start| (*cause, start)))
            .collect();
        let extensions = parallel::map(&starts, |(cause, start)| {
            Some(Extension { cause: *cause, ln_gain: 0.5 * linearised.gain(start)?, start: start.clone() })
        });
        extensions.into_iter().flatten().collect()
    }

    fn without(&self, fit: &SideFit, cause: usize) -> Hypothesis {
        let mut start = fit.hypothesis.clone();
        start.effects.retain(|(index, _)| *index != cause);
        start
    }

    fn fit(&self, start: &Hypothesis) -> Option<SideFit> {
        self.problem.fit(start, self.counts)
    }

    fn should_extend(&self, _: &SideFit, _: &SideFit) -> bool {
        true
    }
}

/// Probabilities of the causes of a search among this number of effects. Causes outside the library show as a larger error of the model.
pub(crate) fn probabilities(
    calibration: &Calibration,
    effects: usize,
    found: &SearchResult,
) -> CauseProbabilities {
    let all = || std::iter::once(&found.null).chain(&found.fits);
    let inside = all().map(|fit| weight(calibration, effects, fit) + (1.0 - PRIOR_OUTSIDE).ln());
    let outside = all().map(|fit| fit.score_outside + prior(calibration, effects, fit) + PRIOR_OUTSIDE.ln());
    let shares = shares(&inside.chain(outside).collect::<Vec<_>>(), calibration.temperature);
    let unmodelled = shares[shares.len() / 2..].iter().sum();
    let set = |fit: &SideFit| CauseSet {
        members: members(&fit.hypothesis),
        ln_weight: weight(calibration, effects, fit),
    };
    let sets: Vec<CauseSet> = found.fits.iter().map(set).collect();
    // Every effect is tried, and the second one of a pair needs the evidence of a cause.
    let rules = Rules { unlisted: 0.0, part_margin: calibration.threshold, ..calibration.rules() };
    rules.cause_probabilities(weight(calibration, effects, &found.null), &sets, unmodelled)
}

/// Indices of the effects that change a judged channel, and the other effects with the reason.
pub(crate) fn diagnosable<S: SideModel>(problem: &SideProblem<'_, S>) -> (Vec<usize>, Vec<NotDiagnosable>) {
    let Some(base) = problem.predict(&problem.nothing()) else { return (Vec::new(), Vec::new()) };
    let (mut diagnosable, mut others) = (Vec::new(), Vec::new());
    for (index, effect) in problem.effects.iter().enumerate() {
        let info = effect.info();
        if let Some(reason) = S::covered(&info.id) {
            others.push(not_diagnosable(info, reason.to_owned()));
            continue;
        }
        let acts = [1.0, -1.0].into_iter().any(|share| {
            let values =
                info.parameters.iter().map(|p| (p.neutral + share * p.typical_step).clamp(p.low, p.high));
            let there = Hypothesis { effects: vec![(index, values.collect())], ..problem.nothing() };
            problem.predict(&there).is_some_and(|there| largest_change_k(problem, &there, &base) > ROUNDING)
        });
        if acts {
            diagnosable.push(index);
        } else {
            others.push(not_diagnosable(info, problem.side.why_silent(info.submodel).to_owned()));
        }
    }
    (diagnosable, others)
}

/// Largest change of a judged channel in the rows in which it was measured, K.
fn largest_change_k<S: SideModel>(problem: &SideProblem<'_, S>, there: &Columns, base: &Columns) -> f64 {
    let mut largest_k: f64 = 0.0;
    for ((_, read), (there, base)) in problem.side.rows().judged.iter().zip(there.iter().zip(base)) {
        for i in (0..read.len()).filter(|i| read[*i].is_finite()) {
            largest_k = largest_k.max((there[i] - base[i]).abs());
        }
    }
    largest_k
}

fn not_diagnosable(info: &EffectInfo, reason: String) -> NotDiagnosable {
    NotDiagnosable { effect: info.id.to_string(), name: info.name.to_string(), reason }
}

/// Smallest size of each effect, on the side of its typical step, that would be named in 95 of 100 logs like this one. Effects that no size in their range
/// makes detectable are returned with the unknown that imitates them, except the `open` ones: they were detected. `found` is the most probable fit.
pub(crate) fn smallest<S: SideModel>(
    problem: &SideProblem<'_, S>,
    diagnosable: &[usize],
    found: &SideFit,
    open: &[usize],
    counts: &[bool],
    calibration: &Calibration,
) -> (Vec<SmallestSeen>, Vec<NotDiagnosable>) {
    let Some(base) = problem.linearise_without_cause(found, counts) else { return (Vec::new(), Vec::new()) };
    let against = evidence_needed(calibration, diagnosable.len());
    let results = parallel::map(diagnosable, |effect| {
        let info = problem.effects[*effect].info();
        let (parameter, others) = info.parameters.split_last()?;
        // Length of the signature in sigmas, and the unknown that imitates most of it.
        let signature = |others: &[f64], value: f64| -> Option<(f64, usize)> {
            let effects = vec![(*effect, [others, &[value]].concat())];
            let change = base.change(&Hypothesis { effects, ..base.hypothesis.clone() })?;
            let imitated = &change.imitated;
            let imitator = (0..imitated.len()).max_by(|a, b| imitated[*a].total_cmp(&imitated[*b]))?;
            Some((change.own.max(0.0).sqrt(), imitator))
        };
        // The other parameters stay neutral if the effect is visible then: the lag of an element is, a wall without mass is not.
        let mut fixed: Vec<f64> = others.iter().map(|p| p.neutral).collect();
        if signature(&fixed, typical(parameter))?.0 <= ROUNDING {
            fixed = others.iter().map(typical).collect();
        }
        let mut last_imitator = 0;
        let smallest = smallest_size(parameter, against, |value| {
            let (sigma, imitator) = signature(&fixed, value)?;
            last_imitator = imitator;
            Some(sigma)
        })?;
        let unknown = &S::UNKNOWNS[last_imitator];
        let reason = format!(
            "even {} cannot be distinguished from another value of the unknown {} ({})",
            size_in_words(parameter, smallest.furthest),
            unknown.name,
            unknown.description
        );
        let seen = SmallestSeen::of(info, parameter, smallest.value);
        Some((open.contains(effect), seen, not_diagnosable(info, reason)))
    });
    let (mut smallest, mut others) = (Vec::new(), Vec::new());
    for (is_open, seen, not_diagnosable) in results.into_iter().flatten() {
        if is_open || seen.value.is_some() { smallest.push(seen) } else { others.push(not_diagnosable) }
    }
    (smallest, others)
}
