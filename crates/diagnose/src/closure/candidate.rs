//! A closure term as a hypothesis: its coefficients are fitted by model runs, together with tolerances and any other effects.

use crate::closure::select::Choice;
use crate::closure::term::{ClosureEffect, Role, Term};
use crate::gap::best_fit::fit::{Effort, Fit, Start, fit};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::select::MIN_GAP_REDUCTION;
use crate::gap::findings::report::MAX_EQUIVALENT;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::Linearised;
use mapper_numerics::parallel;
use mapper_numerics::statistics::HINT_SIGMAS;
use mapper_physics::rig::effect::Effect;
use std::sync::Arc;

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
    /// A start from the current values.
    pub(crate) fn restart(&self) -> TermStart {
        (self.choice.clone(), self.effect, Start::from(&self.fit))
    }

    /// Logarithm of the evidence, including the rarity.
    pub(crate) fn score(&self) -> f64 {
        self.fit.score - self.choice.rarity
    }

    /// Its terms.
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
        let effect = self.study.add(Arc::new(closure));
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
