//! Searches for closure terms that explain the residual of a diagnosis, and locates their source terms.

use crate::closure::columns::{Base, Products};
use crate::closure::combine::Combined;
use crate::closure::description::{ClosureDescription, describe, script_of};
use crate::closure::residual_source::{ResidualSource, residual_sources};
use crate::closure::select::{ClosureKey, FittedClosure};
use crate::closure::term::{Balance, Properties};
use crate::gap::best_fit::fit::{Fit, adequacy};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::place::{Explanation, Gain, LINEARISATION_ERROR_RATIO, Part, of_fits, places_of};
use crate::gap::causes::probabilities::{candidate_of, cause_set, weight};
use crate::gap::causes::select::MIN_GAP_REDUCTION;
use crate::gap::gap_reduction::{Compared, held_out_gap};
use crate::gap::library_fits::LibraryFits;
use crate::gap::report::{BalanceClosure, Candidate, ClosureTerm, Gap, MAX_EQUIVALENT, Place};
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use mapper_core::half_width_95;
use mapper_inference::posterior::{CauseProbabilities, CauseSet, RankedCause, Rules};

/// Results outside the effect library.
#[derive(Debug, Default)]
pub(crate) struct Discovered {
    /// The best closure term with the posterior of all causes, if it is proposed.
    pub(crate) proposed: Option<Proposed>,
    /// Residual source term of each balance, most probable first.
    pub(crate) residual_sources: Vec<BalanceClosure>,
    /// Locations of the gap; `None` if the diagnosis' locations remain valid.
    pub(crate) places: Option<Vec<Place>>,
}

/// A closure term, and the causes of one posterior: those of the library, and those with a closure term.
#[derive(Debug)]
pub(crate) struct Proposed {
    pub(crate) closure_term: ClosureTerm,
    /// The gap before and after the best cause.
    pub(crate) gap: Gap,
    /// The recording with the closure terms of the causes.
    pub(crate) study: Study,
    /// Probability of no cause.
    pub(crate) none: f64,
    /// Probability of an unmodelled cause.
    pub(crate) unmodelled: f64,
    /// Most probable first; a closure term is the last effect of its fit.
    pub(crate) causes: Vec<(Candidate, Fit, Option<ClosureKey>)>,
}

impl Proposed {
    /// Probability of a cause outside the library.
    pub(crate) fn outside(&self) -> f64 {
        let with = self.causes.iter().filter(|(candidate, ..)| candidate.has_closure());
        self.unmodelled + with.map(|(candidate, ..)| candidate.probability).sum::<f64>()
    }
}

/// Searches sets of causes with a closure term.
pub(crate) fn discover(
    library: &LibraryFits,
    calibration: &Calibration,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Discovered {
    let LibraryFits { study, linearised, .. } = library;
    progress(0.0, "closure terms");
    let nothing = Base::nothing(study, linearised);
    let mut combined = Combined::new(library, calibration);
    combined.search(&nothing);
    progress(0.6, "residual of the closure term");
    let found = combined.sets();
    let proposed = found.as_ref().and_then(|found| propose(library, calibration, &combined, found));
    let sets = found.map_or_else(Vec::new, |(sets, _)| sets);
    // If a closure term leaves only noise, linear gains of other parts are irrelevant.
    let closure = proposed.as_ref().map(|proposed| &proposed.closure_term);
    let settled = closure.filter(|closure| closure.probability > 0.5);
    let bend = if settled.is_some() { 0.0 } else { LINEARISATION_ERROR_RATIO };
    progress(0.7, "residual source terms");
    let here = |balance: &Balance| {
        settled.is_none_or(|closure| closure.submodel == balance.properties().submodel.name())
    };
    let residual_sources = residual_sources(&nothing, &Selection::all(study).steps, &here);
    let places = places((library, calibration), &combined, &sets, &residual_sources, bend);
    let reported = residual_sources.into_iter().take(1 + MAX_EQUIVALENT).map(reported_source);
    Discovered { residual_sources: reported.collect(), places: Some(places), proposed }
}

/// The best closure term, if its set passes all tests.
fn propose(
    library: &LibraryFits,
    calibration: &Calibration,
    combined: &Combined<'_>,
    (sets, there): &(Vec<FittedClosure>, Linearised),
) -> Option<Proposed> {
    let LibraryFits { linearised, null, fits, .. } = library;
    let terms = &combined.terms;
    let study = &terms.study;
    let best = sets.first()?;
    let weight = |fit: &Fit| weight(calibration, study, fit);
    // No cause, the causes of the library and those with a closure term in one posterior.
    let mut all: Vec<(&Fit, Option<&FittedClosure>)> = fits.iter().map(|fit| (fit, None)).collect();
    let inside = all.iter().map(|(fit, _)| weight(fit)).fold(weight(null), f64::max);
    all.extend(sets.iter().map(|closure| (&closure.fit, Some(closure))));
    all.sort_by(|a, b| weight(b.0).total_cmp(&weight(a.0)));
    if weight(&best.fit) - inside < calibration.threshold {
        return None;
    }
    let left = calibration.outside(adequacy(study, linearised, &best.fit).features());
    let set = |(fit, _): &(&Fit, _)| cause_set(calibration, study, fit);
    // All closure terms are among the sets.
    let rules = Rules { unlisted: 0.0, ..calibration.rules() };
    let causes = &all.iter().map(set).collect::<Vec<CauseSet>>();
    let probabilities = rules.cause_probabilities(weight(null), causes, left);
    let alike = probabilities.causes.iter().take(probabilities.alike.clamp(1, 1 + MAX_EQUIVALENT));
    let alike: Vec<&Fit> = alike.map(|cause| all[cause.set].0).collect();
    let compared = Compared { study, linearised: [linearised, there], null, causes: &alike, weight: &weight };
    let gap = held_out_gap(compared, &library.folds);
    // A closure term that makes a channel worse on steps that its fit has not seen closes nothing.
    if gap.gap_reduction < MIN_GAP_REDUCTION || !gap.worse.is_empty() {
        return None;
    }
    let describe =
        |candidate: &FittedClosure| describe(&terms.library, candidate, calibration.interval_factor);
    let description = describe(best);
    let script = script_of(&best.terms(&terms.library), &description);
    let candidate_of = |cause: &RankedCause| {
        let (fit, closure) = all[cause.set];
        let posterior = (&probabilities, causes.as_slice(), cause);
        let Some(closure) = closure else { return candidate_of(calibration, study, fit, posterior) };
        let mut effects = fit.clone();
        effects.hypothesis.effects.retain(|(index, _)| *index != closure.effect);
        let of_closure = probabilities.of_member(causes, closure.effect);
        candidate_of(calibration, study, &effects, posterior)
            .with_closure(&describe(closure).sentence, of_closure)
    };
    let found = probabilities.causes.iter().map(|cause| {
        let key = all[cause.set].1.map(|closure| closure.choice.key.clone());
        (candidate_of(cause), all[cause.set].0.clone(), key)
    });
    let found: Vec<(Candidate, Fit, Option<ClosureKey>)> = found.collect();
    let ClosureDescription { sentence, terms: coefficients, .. } = description;
    let others = found[..alike.len()].iter().filter_map(|(cause, ..)| cause.closure().cloned());
    let effects = found.first().map_or(&[][..], |(cause, ..)| &cause.effects);
    let with_effects = effects.iter().filter(|id| *id != Candidate::CLOSURE).cloned().collect();
    let closure_term = ClosureTerm {
        submodel: terms.library[best.choice.terms[0]].submodel().name().to_owned(),
        equivalent: others.filter(|other| *other != sentence).collect(),
        sentence,
        terms: coefficients,
        probability: probabilities.of_member(causes, best.effect),
        gap_reduction: gap.gap_reduction,
        held_out_steps: gap.held_out_steps.len(),
        with_effects,
        rhai: None,
        script,
    };
    let CauseProbabilities { none, unmodelled, .. } = probabilities;
    Some(Proposed { closure_term, gap, study: study.clone(), none, unmodelled, causes: found })
}

/// Locations from all explanations tried: effects, closure terms, source terms.
fn places(
    (library, calibration): (&LibraryFits, &Calibration),
    combined: &Combined<'_>,
    sets: &[FittedClosure],
    residual_sources: &[ResidualSource],
    bend: f64,
) -> Vec<Place> {
    let LibraryFits { study, linearised, null, fits, .. } = library;
    let all = combined.all();
    let gains = sets.iter().map(|set| &set.fit).chain(fits).chain(&all);
    let gains: Vec<Gain<'_>> = gains.map(|fit| Gain { fit, gain: null.cost - fit.cost }).collect();
    let mut explanations = of_fits(&combined.terms.study, &gains, calibration);
    // The other fits give each member's contribution.
    explanations.truncate(sets.len() + fits.len());
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
