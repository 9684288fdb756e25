//! A law as a hypothesis: terms with coefficients fitted by runs of the model, with tolerances and what stands beside it.

use crate::law_effect::LawEffect;
use crate::select::Choice;
use crate::term::{Role, Term};
use mapper_gap::fit::{Effort, Fit, fit};
use mapper_gap::selection::Selection;
use mapper_gap::study::{Hypothesis, Study};
use mapper_gap::whiten::Linearised;
use mapper_numerics::parallel;
use mapper_physics::effect::Effect;
use std::sync::Arc;

/// A law with its fit; its effect stands in [`Bench::study`] at `effect`.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Terms of the library, by place.
    pub choice: Choice,
    /// The law's effect, by its place in the study.
    pub effect: usize,
    /// At its best.
    pub fit: Fit,
}

impl Candidate {
    /// Logarithm of the evidence, rarity included.
    pub fn score(&self) -> f64 {
        self.fit.score - self.choice.rarity
    }

    /// Whether the data tell every coefficient from 0, but for the level beside a slope, which may be anything.
    pub fn is_determined(&self, library: &[Term]) -> bool {
        let covariance = &self.fit.covariance;
        let terms: Vec<&Term> = self.choice.terms.iter().map(|place| &library[*place]).collect();
        let first = covariance.nrows().saturating_sub(terms.len());
        let sink = terms.iter().any(|term| term.role == Role::Slope);
        let values = self.coefficients();
        terms.iter().zip(values).enumerate().all(|(place, (term, value))| {
            let variance = covariance.get((first + place, first + place)).copied().unwrap_or(f64::INFINITY);
            (sink && term.role == Role::Level) || (value / term.step).abs() > MIN_SIGMAS * variance.sqrt()
        })
    }

    /// The law's coefficients.
    pub fn coefficients(&self) -> &[f64] {
        let own = self.fit.hypothesis.effects.iter().find(|(index, _)| *index == self.effect);
        own.map_or(&[], |(_, values)| values)
    }
}

/// A study to which laws are added as effects.
#[derive(Debug)]
pub struct Bench {
    /// The recording, with the catalogue's effects and then the laws'.
    pub study: Study,
    /// The library.
    pub library: Vec<Term>,
}

impl Bench {
    /// Fits choices from where the straight line leaves them, beside what stands in the base.
    pub fn fit(
        &mut self,
        base_hypothesis: &Hypothesis,
        linearised: &Linearised,
        choices: &[Choice],
        selection: &Selection,
        effort: Effort,
    ) -> Vec<Candidate> {
        let starts: Vec<(Choice, usize, Hypothesis)> =
            choices.iter().map(|choice| self.start(base_hypothesis, choice)).collect();
        let fitted = parallel::map(&starts, |(choice, effect, start)| {
            let fit = fit(&self.study, linearised, start, selection, effort).ok()?;
            Some(Candidate { choice: choice.clone(), effect: *effect, fit })
        });
        let mut found: Vec<Candidate> = fitted.into_iter().flatten().collect();
        sort(&mut found);
        found
    }

    /// Fits candidates again from where they stand.
    pub fn refit(
        &self,
        candidates: &[Candidate],
        linearised: &Linearised,
        selection: &Selection,
        effort: Effort,
    ) -> Vec<Candidate> {
        let fitted = parallel::map(candidates, |candidate| {
            let fit = fit(&self.study, linearised, &candidate.fit.hypothesis, selection, effort).ok()?;
            Some(Candidate { fit, ..candidate.clone() })
        });
        let mut found: Vec<Candidate> = fitted.into_iter().flatten().collect();
        sort(&mut found);
        found
    }

    /// A candidate's fit in a study with the catalogue's effects and its own law alone: what else was tried is no further
    /// effect.
    pub fn alone(&self, catalogue: &Study, candidate: &Candidate) -> (Study, Fit) {
        let mut own = catalogue.clone();
        let law = own.add(self.study.effects[candidate.effect].clone());
        let mut fit = candidate.fit.clone();
        for (index, _) in &mut fit.hypothesis.effects {
            *index = if *index == candidate.effect { law } else { *index };
        }
        (own, fit)
    }

    fn start(&mut self, base: &Hypothesis, choice: &Choice) -> (Choice, usize, Hypothesis) {
        let terms: Vec<Term> = choice.terms.iter().map(|place| self.library[*place].clone()).collect();
        let law = LawEffect::new(terms);
        let parameters = &law.info().parameters;
        let values = parameters
            .iter()
            .zip(&choice.coefficients)
            .map(|(p, steps)| (steps * p.typical_step).clamp(0.9 * p.low, 0.9 * p.high))
            .collect();
        let effect = self.study.add(Arc::new(law));
        let mut start = base.clone();
        start.effects.push((effect, values));
        (choice.clone(), effect, start)
    }
}

/// A coefficient nearer to 0 than this, in standard errors, says nothing.
const MIN_SIGMAS: f64 = 2.0;

/// Drops candidates with a coefficient that says nothing, where others are left.
pub fn keep_determined(library: &[Term], candidates: &mut Vec<Candidate>) {
    if candidates.iter().any(|candidate| candidate.is_determined(library)) {
        candidates.retain(|candidate| candidate.is_determined(library));
    }
}

/// Best first.
pub fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
}

/// Choices that are worth a fit: the best, and the best of every part of the machine that promises something beside it.
pub fn worth(library: &[Term], choices: &[Choice]) -> Vec<Choice> {
    let Some(best) = choices.first() else { return Vec::new() };
    let mut worth: Vec<Choice> = Vec::new();
    let part = |choice: &Choice| library[choice.terms[0]].submodel();
    // Beside something strong a straight line is off by more.
    let least = PROMISE * best.gain;
    for choice in choices.iter().filter(|choice| choice.gain > least) {
        let of_part = worth.iter().filter(|other| part(other) == part(choice)).count();
        let parts = if part(choice) == part(best) { OF_THE_BEST_PART } else { OF_OTHER_PARTS };
        if of_part < parts && worth.len() < MAX {
            worth.push(choice.clone());
        }
    }
    worth
}

/// Share of the best's promise that another part of the machine must promise.
const PROMISE: f64 = 0.3;
/// Laws that are fitted.
const MAX: usize = 6;
const OF_THE_BEST_PART: usize = 3;
const OF_OTHER_PARTS: usize = 1;
