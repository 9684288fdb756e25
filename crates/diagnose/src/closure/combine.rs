//! Sets of causes with a closure term. Closure terms are tried together with sets of library effects, and effects together with a closure term.

use crate::closure::columns::{Base, Products};
use crate::closure::library as term_library;
use crate::closure::select::{Choice, FittedClosure, TermSearch, begun, choices, keep_determined, promising};
use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, adequacy};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::select::{LIMITS, Search, supported};
use crate::gap::library_fits::LibraryFits;
use crate::gap::report::MAX_EQUIVALENT;
use crate::gap::residuals::study::members;
use crate::gap::residuals::whiten::Linearised;
use mapper_inference::search::{Causes, Known, climb};
use std::collections::{BTreeMap, BTreeSet};

/// Effort of the fits that are compared. Bound: the decrease is a tenth of what one more sigma of evidence costs.
const EFFORT: Effort =
    Effort { iterations: 5, enough: 0.2, max_sigmas: MAX_SIGMAS, max_sigmas_of_rig: MAX_SIGMAS, exact: true };
/// Effort of fits that only select what to fit again. Bound: effort; three iterations order the terms.
const QUICK: Effort = Effort { iterations: 3, enough: 1.0, exact: false, ..EFFORT };
/// Maximum number of further sets of effects with which closure terms are tried. Bound: effort; two mostly agree.
const MAX_ROUNDS: usize = 2;

pub(crate) struct Combined<'a> {
    library: &'a LibraryFits,
    calibration: &'a Calibration,
    pub(crate) terms: TermSearch,
    everywhere: Selection,
    /// Fits to all steps, of sets with a closure term and of their subsets.
    known: Known<Fit>,
}

impl<'a> Combined<'a> {
    pub(crate) fn new(library: &'a LibraryFits, calibration: &'a Calibration) -> Combined<'a> {
        let (study, closures) = (library.study.clone(), BTreeMap::new());
        let terms = TermSearch { study, library: term_library::library(), closures };
        let (everywhere, known) = (Selection::all(&library.study), Known::default());
        Combined { library, calibration, terms, everywhere, known }
    }

    /// Searches from no cause; if that leaves a gap also from library causes, and last for terms that begin during the recording.
    pub(crate) fn search(&mut self, nothing: &Base<'_>) {
        for late in [false, true] {
            let mut tried = BTreeSet::from([Vec::new()]);
            self.add_terms(nothing, late);
            self.add_effects();
            if !self.leaves_only_noise() {
                let LibraryFits { study, linearised, .. } = self.library;
                for fit in self.library.bases() {
                    tried.insert(members(&fit.hypothesis));
                    if let Ok(there) = linearised.at(study, &fit.hypothesis) {
                        self.add_terms(&Base::at_fit(study, &there, fit), late);
                    }
                }
                self.add_effects();
            }
            for _ in 0..MAX_ROUNDS {
                let Some(best) = self.ranked().into_iter().next() else { break };
                let closure = |index: &usize| self.terms.closures.contains_key(index);
                let mut effects = best.hypothesis.clone();
                effects.effects.retain(|(index, _)| !closure(index));
                if !tried.insert(members(&effects)) {
                    break;
                }
                let LibraryFits { study, linearised, .. } = self.library;
                let Ok(there) = linearised.at(study, &effects) else { break };
                let counts = best
                    .hypothesis
                    .effects
                    .iter()
                    .flat_map(|(index, values)| std::iter::repeat_n(!closure(index), values.len()));
                let columns = best.effect_columns.iter().zip(counts).filter(|(_, free)| *free);
                let free = columns.map(|(column, _)| column.clone()).collect();
                let residual = there.residual(study, &there.base);
                self.add_terms(
                    &Base { study, linearised: &there, hypothesis: effects, residual, free },
                    late,
                );
                self.add_effects();
            }
            if self.leaves_only_noise() {
                break;
            }
        }
    }

    fn at<'b>(&'b self, linearised: &'b Linearised) -> Search<'b> {
        let Combined { terms, everywhere, calibration, .. } = self;
        Search { study: &terms.study, linearised, selection: everywhere, calibration, onsets: false }
    }

    /// All fits with a closure term, most probable first.
    pub(crate) fn ranked(&self) -> Vec<Fit> {
        let mut ranked = self.all();
        ranked.retain(|fit| self.closure_of(fit).is_some());
        ranked
    }

    /// All fits, also those of subsets without a closure term.
    pub(crate) fn all(&self) -> Vec<Fit> {
        self.known.ranked(&self.at(&self.library.linearised))
    }

    fn closure_of(&self, fit: &Fit) -> Option<(usize, &Choice)> {
        let mut effects = fit.hypothesis.effects.iter();
        effects.find_map(|(index, _)| Some((*index, self.terms.closures.get(index)?)))
    }

    pub(crate) fn leaves_only_noise(&self) -> bool {
        self.ranked().first().is_some_and(|best| {
            let features = adequacy(&self.terms.study, &self.library.linearised, best).features();
            self.calibration.outside(features) < 0.5
        })
    }

    /// Tries every closure term with the causes of a base: in closed form, then the most promising ones with model runs.
    fn add_terms(&mut self, base: &Base<'_>, late: bool) {
        let library = &mut self.terms.library;
        // Terms that begin later were added behind the library's own.
        let changes = base.changes(&library[..term_library::library().len()]);
        let usable: Vec<usize> = (0..changes.len()).filter(|place| changes[*place].is_some()).collect();
        let columns: Vec<Vec<f64>> = changes.into_iter().flatten().collect();
        let steps = &self.everywhere.steps;
        let Some(products) = Products::new(base, &columns).projected(steps) else { return };
        let choices = choices(library, &usable, &products);
        let chosen = if late {
            begun(base, library, &choices, steps).unwrap_or_default()
        } else {
            promising(library, &choices)
        };
        self.fit(base, &chosen);
    }

    /// Fits choices with model runs, the best of them with more effort.
    fn fit(&mut self, base: &Base<'_>, chosen: &[Choice]) {
        let Combined { terms, everywhere, .. } = self;
        let starts: Vec<_> = chosen.iter().map(|choice| terms.start(&base.hypothesis, choice)).collect();
        let mut quick = terms.fit(starts.into_iter(), base.linearised, everywhere, QUICK);
        keep_determined(&terms.library, &mut quick);
        quick.truncate(1 + MAX_EQUIVALENT);
        let Some(best) = quick.first() else { return };
        // Tolerances act differently in the presence of a strong term.
        let at_best = base.linearised.at(&terms.study, &best.fit.hypothesis).ok();
        let linearised = at_best.as_ref().unwrap_or(base.linearised);
        let mut fitted = terms.fit(quick.iter().map(FittedClosure::restart), linearised, everywhere, EFFORT);
        keep_determined(&terms.library, &mut fitted);
        let mut known = std::mem::take(&mut self.known);
        fitted.into_iter().for_each(|closure| known.keep(&self.at(linearised), closure.fit));
        self.known = known;
    }

    /// Adds effects to the best closure term, replaces and removes them.
    fn add_effects(&mut self) {
        let Some(best) = self.ranked().into_iter().next() else { return };
        let Ok(there) = self.library.linearised.at(&self.terms.study, &best.hypothesis) else { return };
        let mut known = std::mem::take(&mut self.known);
        climb(&self.at(&there), &mut known, &best, LIMITS);
        self.known = known;
    }

    /// The most probable sets with a closure term, without members that the recording does not support, and where they were linearised. The closure
    /// term is the last member.
    pub(crate) fn sets(&self) -> Option<(Vec<FittedClosure>, Linearised)> {
        let mut ranked = self.ranked();
        ranked.truncate(1 + 2 * MAX_EQUIVALENT);
        let there = self.library.linearised.at(&self.terms.study, &ranked.first()?.hypothesis).ok()?;
        let search = self.at(&there);
        let kept = supported(&search, ranked);
        let restart = |fit: &Fit| {
            let (effect, choice) = self.closure_of(fit)?;
            let mut last = fit.hypothesis.clone();
            last.effects.sort_by_key(|(index, _)| *index == effect);
            Some((choice.clone(), effect, (&last).into()))
        };
        let mut sets = self.terms.fit(kept.iter().filter_map(restart), &there, &self.everywhere, EFFORT);
        sets.sort_by(|a, b| search.ln_odds(&b.fit).total_cmp(&search.ln_odds(&a.fit)));
        Some((sets, there))
    }
}
