//! Searches for closure terms that explain the residual of a diagnosis, and locates their source terms.

use crate::closure::columns::{Base, Products};
use crate::closure::description::{ClosureDescription, describe, script_of};
use crate::closure::library as term_library;
use crate::closure::residual_source::{ResidualSource, residual_sources};
use crate::closure::select::{
    Choice, ClosureKey, FittedClosure, TermSearch, begun, choices, keep_determined, promising,
};
use crate::closure::term::{Balance, Properties};
use crate::gap::best_fit::fit::{Effort, Fit, adequacy, fit, misfit_of_steps, with_start_read};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::place::{
    Explanation, Gain, LINEARISATION_ERROR_RATIO, Part, of_fits, places_of, rarity, signature,
};
use crate::gap::causes::probabilities::{candidate, weight};
use crate::gap::causes::select::MIN_GAP_REDUCTION;
use crate::gap::gap_reduction::{FOLDS, channels_on};
use crate::gap::library_fits::{Explained, LibraryFits};
use crate::gap::report::{BalanceClosure, Candidate, ClosureTerm, MAX_EQUIVALENT, Place};
use crate::gap::residuals::study::{Study, members};
use mapper_core::half_width_95;
use mapper_inference::posterior::{CauseProbabilities, CauseSet, Rules};

/// Decrease of the cost that a reported fit may leave. Bound: a tenth of what one more sigma of evidence costs.
const ENOUGH: f64 = 0.2;

/// Results outside the effect library.
#[derive(Debug, Default)]
pub(crate) struct Discovered {
    /// Proposed closure terms, best first; usually one or none.
    pub(crate) closure_terms: Vec<ClosureTerm>,
    /// Residual source term of each balance, most probable first.
    pub(crate) residual_sources: Vec<BalanceClosure>,
    /// Locations of the gap; `None` if the diagnosis' locations remain valid.
    pub(crate) places: Option<Vec<Place>>,
    /// The first closure term fitted to all steps, and those that the recording does not distinguish from it; each with the index of its effect.
    pub(crate) fits: Vec<(ClosureKey, usize, Fit)>,
}

impl Discovered {
    /// Whether a closure term is more probable than not.
    pub(crate) fn is_settled(&self) -> bool {
        self.closure_terms.first().is_some_and(|closure| closure.probability > 0.5)
    }

    /// Without the closure terms; the locations that were found with them remain.
    pub(crate) fn without_terms(self) -> Discovered {
        Discovered { closure_terms: Vec::new(), fits: Vec::new(), ..self }
    }
}

/// Searches outside the effect library, and if it explains most of the gap also in addition to its best cause.
pub(crate) fn discover(
    library: &LibraryFits,
    explained: Explained,
    calibration: &Calibration,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Discovered {
    let LibraryFits { study, linearised, .. } = library;
    progress(0.0, "closure terms");
    let everywhere = Selection::all(study);
    let mut training = everywhere.clone();
    for step in held_out_steps(library) {
        training.steps[*step] = false;
    }
    let nothing = Base::nothing(study, linearised);
    let mut search = TermSearch { study: study.clone(), library: term_library::library() };
    let mut found = found(&mut search, (library, calibration), &nothing, &training, &everywhere);
    progress(0.4, "a closure term together with a cause");
    let left = found.as_ref().is_none_or(|found| !found.adequate);
    // Of effects that explain little, only one alone may be real: several imitate what is outside.
    let is_candidate = |fit: &&Fit| explained == Explained::Most || fit.hypothesis.effects.len() == 1;
    if left
        && let Some(best) = library.fits.iter().find(is_candidate)
        && let Some(both) =
            together_with_cause(&mut search, (library, calibration), best, &training, &everywhere)
    {
        let score =
            |found: &FittedTerms| found.fitted.first().map_or(f64::NEG_INFINITY, FittedClosure::score);
        let better =
            found.as_ref().is_none_or(|alone| score(&both) > score(alone) + rarity(calibration, study));
        found = if better { Some(both) } else { found };
    }
    progress(0.6, "residual of the closure term");
    let closure_terms = propose(library, calibration, &search, found.as_ref(), &training);
    // If a closure term leaves only noise, linear gains of other parts are irrelevant.
    let settled = closure_terms.first().filter(|closure| closure.probability > 0.5);
    let alike = closure_terms.first().map_or(0, |closure| 1 + closure.equivalent.len());
    let fits = found.iter().flat_map(|found| &found.fitted).take(alike);
    let fits = fits.map(|one| (one.choice.key.clone(), one.effect, one.fit.clone())).collect();
    let bend = if settled.is_some() { 0.0 } else { LINEARISATION_ERROR_RATIO };
    progress(0.7, "residual source terms");
    let here = |balance: &Balance| {
        settled.is_none_or(|closure| closure.submodel == balance.properties().submodel.name())
    };
    let residual_sources = residual_sources(&nothing, &everywhere.steps, &here);
    let places = places((library, calibration), &search, found.as_ref(), &residual_sources, bend);
    Discovered {
        closure_terms,
        residual_sources: residual_sources
            .into_iter()
            .take(1 + MAX_EQUIVALENT)
            .map(reported_source)
            .collect(),
        places: Some(places),
        fits,
    }
}

/// Steps withheld while a closure term is chosen: the first fold. A search for each fold would take three times as long.
fn held_out_steps(library: &LibraryFits) -> &[usize] {
    match library.folds.steps.as_slice() {
        [first, _, ..] => first,
        _ => &[],
    }
}

struct FittedTerms {
    /// Fits to the training steps, best first.
    trained: Vec<FittedClosure>,
    /// The best of these fitted to all steps, best first.
    fitted: Vec<FittedClosure>,
    /// Share of the folds in which the best recurs.
    stability: f64,
    /// Whether the best leaves only noise.
    adequate: bool,
}

/// Search in addition to the best library cause.
fn together_with_cause(
    search: &mut TermSearch,
    (library, calibration): (&LibraryFits, &Calibration),
    best: &Fit,
    training: &Selection,
    everywhere: &Selection,
) -> Option<FittedTerms> {
    let LibraryFits { study, linearised, .. } = library;
    let there = linearised.at(study, &best.hypothesis).ok()?;
    found(search, (library, calibration), &Base::at_fit(study, &there, best), training, everywhere)
}

/// Searches the term library from a base: in closed form, then with model runs.
fn found(
    search: &mut TermSearch,
    (library, calibration): (&LibraryFits, &Calibration),
    base: &Base<'_>,
    training: &Selection,
    everywhere: &Selection,
) -> Option<FittedTerms> {
    let adequate =
        |fit: &Fit| calibration.outside(adequacy(&library.study, &library.linearised, fit).features()) < 0.5;
    let changes = base.changes(&search.library);
    let usable: Vec<usize> = (0..changes.len()).filter(|place| changes[*place].is_some()).collect();
    let columns: Vec<Vec<f64>> = changes.into_iter().flatten().collect();
    let products = Products::new(base, &columns);
    let of = |counts: &[bool]| Some(choices(&search.library, &usable, &products.projected(counts)?));
    let on_training = of(&training.steps)?;
    let folds: Vec<Vec<bool>> = (0..FOLDS)
        .map(|fold| {
            let steps = training.steps.iter().enumerate();
            steps.map(|(step, counts)| *counts && step % FOLDS != fold).collect()
        })
        .collect();
    let in_folds: Vec<Vec<Choice>> = folds.iter().filter_map(|counts| of(counts)).collect();
    let chosen = promising(&search.library, &on_training);
    let found = fitted(search, base, &chosen, training, everywhere)?;
    let (trained, fitted_best) = (found.0.first()?, found.1.first()?);
    let part = |choice: &Choice| search.library[choice.terms[0]].submodel();
    let again = in_folds.iter().filter(|fold| {
        let Some(first) = fold.first() else { return false };
        let own = fold.iter().find(|choice| choice.terms == trained.choice.terms);
        part(first) == part(&trained.choice)
            && own.is_some_and(|own| own.gain > (1.0 - LINEARISATION_ERROR_RATIO) * first.gain)
    });
    let stability = again.count() as f64 / folds.len().max(1) as f64;
    if adequate(&fitted_best.fit) {
        return Some(FittedTerms { trained: found.0, fitted: found.1, stability, adequate: true });
    }
    // If no closure term explains the residual, one may have begun during the recording.
    let alone = FittedTerms { trained: found.0, fitted: found.1, stability, adequate: false };
    let Some((later, stability)) = begun(base, &mut search.library, &on_training, &training.steps, &folds)
    else {
        return Some(alone);
    };
    let has_gained =
        later.first().is_some_and(|later| on_training.first().is_none_or(|first| later.gain > first.gain));
    let fits = if has_gained { fitted(search, base, &later, training, everywhere) } else { None };
    Some(match fits {
        Some((trained, fitted)) if fitted.first()?.score() > alone.fitted.first()?.score() => {
            let adequate = adequate(&fitted.first()?.fit);
            FittedTerms { trained, fitted, stability, adequate }
        }
        _ => alone,
    })
}

/// Fits choices with model runs: to the training steps, and the best of them to all steps.
fn fitted(
    search: &mut TermSearch,
    base: &Base<'_>,
    chosen: &[Choice],
    training: &Selection,
    everywhere: &Selection,
) -> Option<(Vec<FittedClosure>, Vec<FittedClosure>)> {
    let quick = Effort { iterations: 3, enough: 1.0, exact: false, ..Effort::default() };
    let starts: Vec<_> = chosen.iter().map(|choice| search.start(&base.hypothesis, choice)).collect();
    let mut trained = search.fit(starts.into_iter(), base.linearised, training, quick);
    keep_determined(&search.library, &mut trained);
    trained.truncate(1 + MAX_EQUIVALENT);
    // Tolerances act differently in the presence of a strong term.
    let at_trained = base.linearised.at(&search.study, &trained.first()?.fit.hypothesis).ok();
    let linearised = at_trained.as_ref().unwrap_or(base.linearised);
    let effort = Effort { iterations: 5, enough: ENOUGH, ..Effort::default() };
    let trained = search.fit(trained.iter().map(FittedClosure::restart), linearised, training, effort);
    let mut fitted = search.fit(trained.iter().map(FittedClosure::restart), linearised, everywhere, effort);
    keep_determined(&search.library, &mut fitted);
    Some((trained, fitted))
}

/// The best closure term, if it passes all tests.
fn propose(
    library: &LibraryFits,
    calibration: &Calibration,
    search: &TermSearch,
    found: Option<&FittedTerms>,
    training: &Selection,
) -> Vec<ClosureTerm> {
    let Some(found) = found else { return Vec::new() };
    let Some(best) = found.fitted.first() else { return Vec::new() };
    let Some(trained) = found.trained.iter().find(|trained| trained.effect == best.effect) else {
        return Vec::new();
    };
    let LibraryFits { study, linearised, null, fits, .. } = library;
    // The best alternative: no cause, or a library cause.
    let inside = fits
        .iter()
        .map(|fit| weight(calibration, study, fit))
        .fold(weight(calibration, study, null), f64::max);
    let left = calibration.outside(adequacy(&search.study, linearised, &best.fit).features());
    let set = |closure: &FittedClosure| CauseSet {
        members: vec![closure.effect],
        ln_weight: closure.score() + PRIOR_CLOSURE.ln(),
    };
    let sets: Vec<CauseSet> = found.fitted.iter().map(set).collect();
    // All closure terms are among the sets.
    let rules = Rules { unlisted: 0.0, ..calibration.rules() };
    let CauseProbabilities { named, alike, causes, .. } = rules.cause_probabilities(inside, &sets, left);
    if !named {
        return Vec::new();
    }
    let Ok(before) = fit(&search.study, linearised, &study.nothing(), training, Effort::default()) else {
        return Vec::new();
    };
    let held_out = held_out_steps(library);
    let read = |fit: Fit| {
        if training.steps[0] { fit } else { with_start_read(&search.study, linearised, fit) }
    };
    let (before, after) = (read(before), read(trained.fit.clone()));
    let gap_reduction = gap_reduction(study, &before, &after, held_out);
    // It must recur in half of the folds.
    if gap_reduction < MIN_GAP_REDUCTION || found.stability < 0.5 {
        return Vec::new();
    }
    let (channels, worse) = channels_on(study, linearised, [&before, &after], held_out);
    // A closure term that makes a channel worse on steps that it has not seen closes nothing.
    if !worse.is_empty() {
        return Vec::new();
    }
    let describe =
        |candidate: &FittedClosure| describe(&search.library, candidate, calibration.interval_factor);
    let description = describe(best);
    let script = script_of(&best.terms(&search.library), &description);
    let ClosureDescription { sentence, terms, .. } = description;
    let others = found.fitted[..alike].iter().skip(1).take(MAX_EQUIVALENT);
    let beside = accompanying_cause(calibration, &search.study, best);
    vec![ClosureTerm {
        submodel: search.library[best.choice.terms[0]].submodel().name().to_owned(),
        sentence,
        terms,
        probability: causes[0].probability,
        gap_reduction,
        held_out_steps: held_out.len(),
        channels,
        worse,
        beside: beside.as_ref().map(|cause| cause.effects.clone()).unwrap_or_default(),
        beside_cause: beside,
        stability: found.stability,
        equivalent: others.map(|closure| describe(closure).sentence).collect(),
        rhai: None,
        script,
    }]
}

/// The library effects fitted together with a closure term; `None` if it was found alone.
fn accompanying_cause(
    calibration: &Calibration,
    study: &Study,
    closure: &FittedClosure,
) -> Option<Candidate> {
    let mut hypothesis = closure.fit.hypothesis.clone();
    hypothesis.effects.retain(|(index, _)| *index != closure.effect);
    // The closure term's coordinates are the last of the fit.
    let covariance = Some(&closure.fit.covariance);
    (!hypothesis.effects.is_empty())
        .then(|| candidate(calibration, &study.effects, &hypothesis, covariance, 1.0))
}

/// Prior of all closure terms together. Judgement: one gap in seven is none of the library's effects and has a physical term.
const PRIOR_CLOSURE: f64 = 0.15;

/// Locations from all explanations tried: effects, closure terms, source terms.
fn places(
    (library, calibration): (&LibraryFits, &Calibration),
    search: &TermSearch,
    found: Option<&FittedTerms>,
    residual_sources: &[ResidualSource],
    bend: f64,
) -> Vec<Place> {
    let LibraryFits { study, linearised, null, fits, .. } = library;
    let rarity = rarity(calibration, study);
    let gains: Vec<Gain<'_>> = fits.iter().map(|fit| Gain { fit, gain: null.cost - fit.cost }).collect();
    let mut explanations: Vec<Explanation<'_>> = of_fits(study, &gains, rarity);
    let fitted = found.map_or(&[][..], |found| &found.fitted);
    explanations.extend(fitted.iter().map(|closure| {
        let gain = null.cost - closure.fit.cost;
        let others: Vec<usize> =
            members(&closure.fit.hypothesis).into_iter().filter(|effect| *effect != closure.effect).collect();
        let without = fits.iter().find(|fit| members(&fit.hypothesis) == others);
        let of_others = without.map_or(0.0, |fit| null.cost - fit.cost).clamp(0.0, gain.max(0.0));
        let closure_part = Part {
            submodel: search.library[closure.choice.terms[0]].submodel(),
            gain: (gain - of_others).max(0.0),
            signature: Box::new(move || signature(&search.study, &closure.fit, closure.effect)),
        };
        let each = of_others / others.len().max(1) as f64;
        let other_parts = others.iter().map(|effect| {
            let effect = *effect;
            Part {
                submodel: study.effects[effect].info().submodel,
                gain: each,
                signature: Box::new(move || signature(&search.study, &closure.fit, effect)),
            }
        });
        let score = 0.5 * gain - closure.choice.rarity - rarity * (1 + others.len()) as f64;
        Explanation { score, parts: std::iter::once(closure_part).chain(other_parts).collect() }
    }));
    // Linear gains are relative to the linear cost of the null hypothesis.
    let linear_null = 0.5 * (null.cost - linear_cost(library));
    for source in residual_sources.iter().filter(|source| source.gain > 0.0) {
        let part = Part {
            submodel: source.balance.properties().submodel,
            gain: 2.0 * source.gain,
            signature: Box::new(move || Some(source.signature.clone())),
        };
        explanations.push(Explanation { score: source.gain + linear_null, parts: vec![part] });
    }
    places_of(study, linearised, null, &explanations, bend)
}

/// Linear estimate of the cost with tolerances only, from the nominal model.
fn linear_cost(library: &LibraryFits) -> f64 {
    let base = Base::nothing(&library.study, &library.linearised);
    let everywhere = Selection::all(&library.study);
    Products::new(&base, &[]).projected(&everywhere.steps).map_or(library.null.cost, |left| left[(0, 0)])
}

fn reported_source(source: ResidualSource) -> BalanceClosure {
    let Properties { submodel, words, unit, .. } = source.balance.properties();
    BalanceClosure {
        submodel: submodel.name().to_owned(),
        quantity: words,
        unit: unit.to_owned(),
        evidence: source.gain,
        steps: source
            .levels
            .iter()
            .map(|(level, sigma)| [*level, level - half_width_95(*sigma), level + half_width_95(*sigma)])
            .collect(),
    }
}

/// Gap reduction by a closure term: `1 - sum g_after+/sum g_before+`, `g = (|r|^2 - n)/n`, over the held-out steps, or all if there are none.
fn gap_reduction(study: &Study, before: &Fit, after: &Fit, held_out: &[usize]) -> f64 {
    let all: Vec<usize> = (0..study.steps.len()).collect();
    let steps = if held_out.is_empty() { &all } else { held_out };
    let of = |fit: &Fit| {
        let misfit = misfit_of_steps(study, &fit.residual);
        steps.iter().map(|step| misfit[*step].max(0.0)).sum::<f64>()
    };
    let (before, after) = (of(before), of(after));
    if before > 0.0 { 1.0 - after / before } else { 0.0 }
}
