//! Selects the few library terms that explain the recording, and the step with which they begin.

use crate::closure::columns::{Base, LinearEvidence, Products, linear_evidence};
use crate::closure::expression::{Expression, Spans, product};
use crate::closure::library::library;
use crate::closure::term::{ClosureEffect, Role, Term};
use crate::gap::best_fit::fit::{Effort, Fit, Start, fit};
use crate::gap::best_fit::normal::{PRIOR_STEPS, Selection};
use crate::gap::causes::select::MIN_GAP_REDUCTION;
use crate::gap::report::MAX_EQUIVALENT;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_core::step_number;
use mapper_numerics::parallel;
use mapper_numerics::statistics::HINT_SIGMAS;
use mapper_physics::rig::effect::Effect;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Some library terms, by index, with their fit to the recording.
#[derive(Debug, Clone)]
pub(crate) struct Choice {
    /// Indices in the library, ascending.
    pub(crate) terms: Vec<usize>,
    /// Log evidence relative to none, including rarity.
    pub(crate) gain: f64,
    /// Evidence penalty for one choice among many.
    pub(crate) rarity: f64,
    /// Coefficients, in steps.
    pub(crate) coefficients: Vec<f64>,
    /// The same terms without their onset, by which a file names them.
    pub(crate) key: ClosureKey,
}

/// Terms of the library, by index, that begin with a step; 0 from the beginning.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ClosureKey {
    terms: Vec<usize>,
    begin: usize,
}

impl ClosureKey {
    /// Adds the closure term to a study, and returns the index of its effect; `None` for a term or a step that does not exist.
    pub(crate) fn add_to(&self, study: &mut Study) -> Option<usize> {
        let library = library();
        let begin_s = study.steps.get(self.begin)?.marker.start_s;
        let term = |place: &usize| {
            let term = library.get(*place)?;
            Some(if self.begin > 0 { from(term, begin_s, self.begin) } else { term.clone() })
        };
        let terms = self.terms.iter().map(term).collect::<Option<Vec<Term>>>()?;
        Some(study.add(Arc::new(ClosureEffect::new(terms))))
    }
}

/// All closure terms of one term, and of two in the same machine part; best first. `usable` are the library indices of the products' columns.
pub(crate) fn choices(library: &[Term], usable: &[usize], products: &DMatrix<f64>) -> Vec<Choice> {
    let mut found: Vec<Choice> = Vec::new();
    let mut add = |places: &[usize], rarity: f64| {
        let Some(LinearEvidence { gain, coefficients }) = linear_evidence(products, places, PRIOR_STEPS)
        else {
            return;
        };
        let terms: Vec<usize> = places.iter().map(|place| usable[*place]).collect();
        let wrong =
            terms.iter().zip(coefficients.iter()).any(|(term, c)| library[*term].positive && *c < 0.0);
        if !wrong && gain.is_finite() {
            let coefficients = coefficients.iter().copied().collect();
            let key = ClosureKey { terms: terms.clone(), begin: 0 };
            found.push(Choice { terms, gain: gain - rarity, rarity, coefficients, key });
        }
    };
    let simple = (usable.len() as f64).ln();
    for place in 0..usable.len() {
        if library[usable[place]].role != Role::Slope {
            add(&[place], simple);
        }
    }
    let pairs: Vec<(usize, usize)> = (0..usable.len())
        .flat_map(|a| (0..a).map(move |b| (b, a)))
        .filter(|(a, b)| go_together(&library[usable[*a]], &library[usable[*b]]))
        .collect();
    for (a, b) in &pairs {
        // Level and slope form one closure term, with its own temperature.
        let sink = library[usable[*a]].role == Role::Slope || library[usable[*b]].role == Role::Slope;
        add(&[*a, *b], if sink { simple } else { 1.0 + (pairs.len() as f64).ln() });
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Whether two terms form a closure term: both in one machine part, and a slope only with the level of its own balance.
fn go_together(a: &Term, b: &Term) -> bool {
    let same_balance = a.balance() == b.balance();
    match (a.role, b.role) {
        (Role::Slope, Role::Level) | (Role::Level, Role::Slope) => same_balance,
        (Role::Slope, _) | (_, Role::Slope) => false,
        // A level with a known sink equals an unknown sink.
        (Role::Level, Role::Exchange) | (Role::Exchange, Role::Level) => {
            !same_balance && a.submodel() == b.submodel()
        }
        _ => a.submodel() == b.submodel(),
    }
}

/// Maximum number of terms tried with an onset. Bound: effort; each costs a run for each step.
const TRIED: usize = 12;

/// The best choices, best first, each with its best onset; adds their terms to the library. `choices`: of the same products, best first.
pub(crate) fn begun(
    base: &Base<'_>,
    library: &mut Vec<Term>,
    choices: &[Choice],
    counts: &[bool],
) -> Option<Vec<Choice>> {
    let part = |choice: &Choice| library[choice.terms[0]].submodel();
    let mut parts = Vec::new();
    for choice in choices {
        if parts.len() < MAX_EQUIVALENT && !parts.contains(&part(choice)) {
            parts.push(part(choice));
        }
    }
    // A constant with an onset does not look like a constant, so the best parts' constants are tried whatever their gain.
    let constants = choices.iter().filter(|choice| {
        choice.terms.iter().all(|term| library[*term].is_constant()) && parts.contains(&part(choice))
    });
    let mut tried: Vec<&Choice> = Vec::new();
    for choice in constants.chain(choices) {
        let lags = choice.terms.iter().any(|term| library[*term].has_memory());
        let of_part = tried.iter().filter(|other| part(other) == part(choice)).count();
        let known = tried.iter().any(|other| other.terms == choice.terms);
        // No part takes the place of all others.
        if choice.terms.len() == 1 && !lags && !known && 2 * of_part < TRIED && tried.len() < TRIED {
            tried.push(choice);
        }
    }
    let steps = base.study.steps.len();
    // Each term's change for every possible onset.
    let mut terms: Vec<usize> = tried.iter().flat_map(|choice| choice.terms.iter().copied()).collect();
    terms.sort_unstable();
    terms.dedup();
    let columns: Vec<Vec<f64>> =
        terms.iter().flat_map(|term| from_each_step(base, &library[*term])).collect();
    let projected = Products::new(base, &columns).projected(counts)?;
    let mut found: Vec<Choice> = Vec::new();
    for choice in &tried {
        let rarity = choice.rarity + (steps as f64).ln();
        for begin in 1..steps {
            let place = |term| Some(terms.iter().position(|other| other == term)? * steps + begin);
            let places: Option<Vec<usize>> = choice.terms.iter().map(place).collect();
            let Some(evidence) = linear_evidence(&projected, &places?, PRIOR_STEPS) else { continue };
            let coefficients: Vec<f64> = evidence.coefficients.iter().copied().collect();
            let mut signs = choice.terms.iter().zip(&coefficients);
            let wrong = signs.any(|(term, c)| library[*term].positive && *c < 0.0);
            if !wrong && evidence.gain.is_finite() {
                let key = ClosureKey { begin, ..choice.key.clone() };
                let (gain, terms) = (evidence.gain - rarity, choice.terms.clone());
                found.push(Choice { gain, rarity, coefficients, terms, key });
            }
        }
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut chosen: Vec<Choice> = Vec::new();
    for choice in found {
        if chosen.len() <= MAX_EQUIVALENT && chosen.iter().all(|other| other.terms != choice.terms) {
            chosen.push(choice);
        }
    }
    for choice in &mut chosen {
        let begin_s = base.study.steps[choice.key.begin].marker.start_s;
        choice.terms = choice
            .terms
            .iter()
            .map(|term| {
                library.push(from(&library[*term], begin_s, choice.key.begin));
                library.len() - 1
            })
            .collect();
    }
    Some(chosen)
}

fn from(term: &Term, begin_s: f64, step: usize) -> Term {
    let mut later = term.clone();
    for (_, formula) in &mut later.acts_on {
        *formula = product(Expression::InTime(Spans::from(begin_s)), formula.clone());
    }
    // Level and slope form separate closure terms now: each sentence includes its own onset.
    later.role = Role::Other;
    later.words = format!("{} from step {} on", later.words, step_number(step));
    later
}

/// Whitened changes for one step of a term's coefficient, for an onset at each step. As for effects, memory of earlier steps does not count.
fn from_each_step(base: &Base<'_>, term: &Term) -> Vec<Vec<f64>> {
    let change = base.changes(std::slice::from_ref(term)).swap_remove(0);
    let change = change.unwrap_or_else(|| vec![0.0; base.residual.len()]);
    let from = |step| {
        let mut later = change.clone();
        (0..step).for_each(|before| later[rows_of_step(base.study, before)].fill(0.0));
        later
    };
    (0..base.study.steps.len()).map(from).collect()
}

/// Share of the range that a start may use. Bound: the fit needs some room on both sides.
const START_RANGE_SHARE: f64 = 0.9;

/// A fitted closure term; its effect is [`TermSearch::study`]'s effect number `effect`.
#[derive(Debug, Clone)]
pub(crate) struct FittedClosure {
    /// Terms, by index in the term library.
    pub(crate) choice: Choice,
    /// Index of the closure term's effect in the study.
    pub(crate) effect: usize,
    pub(crate) fit: Fit,
}

/// A closure term to fit: its choice, the index of its effect, and the start values.
type TermStart = (Choice, usize, Start);

impl FittedClosure {
    pub(crate) fn restart(&self) -> TermStart {
        (self.choice.clone(), self.effect, Start::from(&self.fit))
    }

    /// Logarithm of the evidence, including the rarity.
    pub(crate) fn score(&self) -> f64 {
        self.fit.score - self.choice.rarity
    }

    pub(crate) fn terms<'a>(&self, library: &'a [Term]) -> Vec<&'a Term> {
        self.choice.terms.iter().map(|place| &library[*place]).collect()
    }

    /// Whether every coefficient differs significantly from 0. The level that accompanies a slope may have any value.
    pub(crate) fn is_determined(&self, library: &[Term]) -> bool {
        let covariance = &self.fit.covariance;
        let terms = self.terms(library);
        let first = covariance.nrows().saturating_sub(terms.len());
        let sink = terms.iter().any(|term| term.role == Role::Slope);
        let values = self.coefficients();
        terms.iter().zip(values).enumerate().all(|(place, (term, value))| {
            let variance = covariance.get((first + place, first + place)).copied().unwrap_or(f64::INFINITY);
            (sink && term.role == Role::Level) || (value / term.step).abs() > HINT_SIGMAS * variance.sqrt()
        })
    }

    pub(crate) fn coefficients(&self) -> &[f64] {
        let own = self.fit.hypothesis.effects.iter().find(|(index, _)| *index == self.effect);
        own.map_or(&[], |(_, values)| values)
    }
}

/// A study with closure terms as additional effects.
#[derive(Debug)]
pub(crate) struct TermSearch {
    /// The recording, with the library effects followed by the closure terms.
    pub(crate) study: Study,
    pub(crate) library: Vec<Term>,
    /// The closure terms among the effects of the study.
    pub(crate) closures: BTreeMap<usize, Choice>,
}

impl TermSearch {
    /// Fits from all starts in parallel; best first.
    pub(crate) fn fit(
        &self,
        starts: impl Iterator<Item = TermStart>,
        linearised: &Linearised,
        selection: &Selection,
        effort: Effort,
    ) -> Vec<FittedClosure> {
        let starts: Vec<TermStart> = starts.collect();
        let fitted = parallel::map(&starts, |(choice, effect, start)| {
            let fit = fit(&self.study, linearised, start.clone(), selection, effort).ok()?;
            Some(FittedClosure { choice: choice.clone(), effect: *effect, fit })
        });
        let mut candidates: Vec<FittedClosure> = fitted.into_iter().flatten().collect();
        candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
        candidates
    }

    /// Adds the closure term of a choice to the study, to be fitted together with the effects of the base from its linear estimate.
    pub(crate) fn start(&mut self, base: &Hypothesis, choice: &Choice) -> TermStart {
        let terms: Vec<Term> = choice.terms.iter().map(|place| self.library[*place].clone()).collect();
        let closure = ClosureEffect::new(terms);
        let parameters = &closure.info().parameters;
        let values = parameters
            .iter()
            .zip(&choice.coefficients)
            .map(|(p, steps)| {
                (steps * p.typical_step).clamp(START_RANGE_SHARE * p.low, START_RANGE_SHARE * p.high)
            })
            .collect();
        let known =
            self.closures.iter().find(|(_, known)| known.key == choice.key).map(|(effect, _)| *effect);
        let effect = known.unwrap_or_else(|| self.study.add(Arc::new(closure)));
        self.study.rarities.insert(effect, choice.rarity);
        self.closures.insert(effect, choice.clone());
        let mut start = base.clone();
        start.effects.push((effect, values));
        (choice.clone(), effect, Start::from(&start))
    }
}

/// Drops candidates with an insignificant coefficient, if others remain.
pub(crate) fn keep_determined(library: &[Term], candidates: &mut Vec<FittedClosure>) {
    if candidates.iter().any(|candidate| candidate.is_determined(library)) {
        candidates.retain(|candidate| candidate.is_determined(library));
    }
}

/// Selects the choices to fit: the best ones, and the best of every machine part with a sufficient linear gain.
pub(crate) fn promising(library: &[Term], choices: &[Choice]) -> Vec<Choice> {
    let Some(best) = choices.first() else { return Vec::new() };
    let mut selected: Vec<Choice> = Vec::new();
    let part = |choice: &Choice| library[choice.terms[0]].submodel();
    // A strong term makes the linearisation less accurate, so that part of the best gain is in doubt.
    let min_gain = MIN_GAP_REDUCTION * best.gain;
    for choice in choices.iter().filter(|choice| choice.gain > min_gain) {
        let of_part = selected.iter().filter(|other| part(other) == part(choice)).count();
        let parts = if part(choice) == part(best) { 1 + MAX_EQUIVALENT } else { 1 };
        if of_part < parts {
            selected.push(choice.clone());
        }
    }
    selected
}
