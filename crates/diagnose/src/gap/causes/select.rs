//! Searches the effects that explain a recording best, by [`mapper_inference::search`] with fits by model runs.

use crate::gap::best_fit::coordinate::Coordinate;
use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, Start, fit};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::{Addition, Calibration, additions};
use crate::gap::causes::probabilities::{prior, weight};
use crate::gap::residuals::nuisance::onset_step;
use crate::gap::residuals::study::{PredictError, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::half_width_95;
use mapper_inference::hypotheses::MAX_MEMBERS;
use mapper_inference::search::{Causes, Extension, Known, Limits, climb, extend};
use mapper_numerics::least_squares::ROUNDS;

#[derive(Clone, Copy)]
pub(crate) struct Search<'a> {
    pub study: &'a Study,
    /// Linearised where the fits start: at the nominal model, or at the best fit so far.
    pub linearised: &'a Linearised,
    /// Steps that count.
    pub selection: &'a Selection,
    /// Constants of the probabilities.
    pub calibration: &'a Calibration,
    /// Whether to search causes that begin with a step instead of those that act throughout.
    pub onsets: bool,
}

/// Limits of the search. Bound: effort. The slack is the evidence that a cause must have over no cause.
pub(crate) const LIMITS: Limits = Limits { members: MAX_MEMBERS, starts: 2, fits: 6, slack: 3.0 };
/// Decrease of the cost by a single effect above which nuisances are linearised again at its fit: their derivatives differ there from those at the
/// nominal point. Bound: an effect of fewer than five sigmas bends them by less than their errors.
const RELINEARISING_DECREASE: f64 = 30.0;
/// Number of starts of single effects that are fitted, those with the largest linear gain, which misjudges strong effects. Bound:
/// effort; the library has three times as many.
const SINGLES: usize = 26;
/// Share of the misfit that a cause must remove to explain it in part, also on held-out steps. An additional effect that removes less probably imitates a
/// cause outside the library, so the search does not extend that set. Source: "most" of the gap, a half.
pub(crate) const MIN_GAP_REDUCTION: f64 = 0.5;

/// Difference of the log evidence from the best above which a fit is not improved further. Bound: no linearisation changes it by so much.
pub(crate) const MAX_EVIDENCE_DEFICIT: f64 = 60.0;

/// Effort of fits that only select what to fit again. Bound: effort; three iterations order the effects.
const QUICK: Effort =
    Effort { iterations: 3, enough: 1.0, max_sigmas: 3.0, max_sigmas_of_rig: 3.0, exact: false };
/// Effort of fits of the search. Bound: effort; a decrease of 0.3 is small compared with the evidence that separates causes.
const EFFORT: Effort =
    Effort { iterations: 6, enough: 0.3, max_sigmas: MAX_SIGMAS, max_sigmas_of_rig: MAX_SIGMAS, exact: true };

#[derive(Debug)]
pub(crate) struct SearchResult {
    /// Fit of tolerances alone.
    pub null: Fit,
    /// Fits of sets of effects, most probable first.
    pub fits: Vec<Fit>,
    /// Linearised at the best single effect, or at tolerances alone, if the nominal point is far from it; with that set.
    pub relinearised: Option<(Linearised, Vec<usize>)>,
}

pub(crate) fn search(search: Search<'_>, progress: &dyn Fn(f64, &str)) -> Result<SearchResult, PredictError> {
    let Search { study, selection, .. } = search;
    let mut null = fit(study, search.linearised, &study.nothing(), selection, Effort::default())?;
    // A fit ends too early if the derivatives of the tolerances changed; linearise them again there.
    let mut at_null = None;
    for _ in 0..ROUNDS {
        if null.predicted_decrease < QUICK.enough {
            break;
        }
        let Ok(there) = search.linearised.at(study, &null.hypothesis) else { break };
        null = fit(study, &there, &null.hypothesis, selection, Effort::default())?;
        at_null = Some(there);
    }
    let linearised = at_null.as_ref().unwrap_or(search.linearised);
    let search = Search { linearised, ..search };
    progress(0.15, "single effects");
    // Not from the nuisances of the null fit, which may imitate an effect.
    let untouched = fit(study, linearised, &study.nothing(), selection, Effort { iterations: 1, ..QUICK })?;
    let mut singles = additions(study, linearised, selection, &untouched, false);
    singles.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let singles: Vec<(Start, Effort)> = singles.into_iter().take(SINGLES).map(|a| (a.start, QUICK)).collect();
    let mut known = Known::default();
    known.keep(&search, null.clone());
    known.fit_all(&search, &singles);
    refit_best(&search, &mut known, 7, f64::INFINITY, EFFORT);
    let relinearised =
        known.ranked(&search).first().filter(|best| null.cost - best.cost > RELINEARISING_DECREASE).and_then(
            |best| {
                let at_best = linearised.at(study, &best.hypothesis).ok()?;
                Some((at_best, members(&best.hypothesis)))
            },
        );
    let search = match &relinearised {
        Some((at_best, _)) => Search { linearised: at_best, ..search },
        None => search,
    };
    if relinearised.is_some() {
        refit_best(&search, &mut known, 4, MAX_EVIDENCE_DEFICIT, Effort::default());
    }
    progress(0.4, "several effects");
    extend(&search, &mut known, LIMITS);
    let fits = known.ranked(&search);
    Ok(SearchResult {
        null,
        fits,
        relinearised: relinearised.or(at_null.map(|linearised| (linearised, Vec::new()))),
    })
}

/// Adds fits of sets with effects that begin with a step; see [`Study::add_onsets`].
pub(crate) fn search_onsets(search: Search<'_>, null: &Fit, fits: &mut Vec<Fit>) {
    let mut known = Known::default();
    std::iter::once(null).chain(fits.iter()).for_each(|fit| known.keep(&search, fit.clone()));
    climb(&search, &mut known, fits.first().unwrap_or(null), LIMITS);
    *fits = known.ranked(&search);
}

/// Fits the best `count` sets again, with more effort; none that is further than `within` behind the best.
fn refit_best(search: &Search<'_>, known: &mut Known<Fit>, count: usize, within: f64, effort: Effort) {
    let ranked = known.ranked(search);
    let close = close(&ranked[..count.min(ranked.len())], within);
    let starts: Vec<(Start, Effort)> = close.iter().map(|fit| (Start::from(fit), effort)).collect();
    known.fit_all(search, &starts);
}

/// The first of these fits, and those that follow it with at most this difference of the log evidence.
pub(crate) fn close(fits: &[Fit], within: f64) -> &[Fit] {
    let behind = |fit: &Fit| fits[0].score - fit.score;
    &fits[..fits.iter().take_while(|fit| behind(fit) <= within).count()]
}

/// Fits these hypotheses again with new derivatives. Returns the more probable fit of each set, most probable first.
pub(crate) fn refit(search: &Search<'_>, fits: &[&Fit], effort: Effort) -> Vec<Fit> {
    let mut known = Known::default();
    let start = |fit: &Fit| Start { columns: Vec::new(), ..Start::from(fit) };
    let starts: Vec<(Start, Effort)> = fits.iter().map(|fit| (start(fit), effort)).collect();
    known.fit_all(search, &starts);
    known.ranked(search)
}

pub(crate) fn ranked<'a>(search: &Search<'_>, fits: impl Iterator<Item = &'a Fit>) -> Vec<Fit> {
    let mut known = Known::default();
    fits.for_each(|fit| known.keep(search, fit.clone()));
    known.ranked(search)
}

impl Causes for Search<'_> {
    type Fit = Fit;
    type Start = (Start, Effort);

    fn members(&self, fit: &Fit) -> Vec<usize> {
        members(&fit.hypothesis)
    }

    fn family(&self, cause: usize) -> usize {
        self.study.family(cause)
    }

    fn ln_odds(&self, fit: &Fit) -> f64 {
        weight(self.calibration, self.study, fit)
    }

    fn extensions(&self, base: &Fit) -> Vec<Extension<Self::Start>> {
        let before = prior(self.calibration, self.study, &base.hypothesis);
        let extension = |addition: Addition| {
            let prior = prior(self.calibration, self.study, &addition.start.hypothesis);
            Extension {
                cause: addition.effect,
                ln_gain: 0.5 * addition.gain + prior - before,
                start: (addition.start, EFFORT),
            }
        };
        let Search { study, linearised, selection, onsets, .. } = *self;
        additions(study, linearised, selection, base, onsets).into_iter().map(extension).collect()
    }

    fn without(&self, fit: &Fit, cause: usize) -> (Start, Effort) {
        let mut start = Start { prediction: None, ..Start::from(fit) };
        let mut place = 0;
        for (index, values) in &fit.hypothesis.effects {
            if *index == cause {
                start.columns.drain(place..place + values.len());
            } else {
                place += values.len();
            }
        }
        start.hypothesis.effects.retain(|(index, _)| *index != cause);
        (start, EFFORT)
    }

    fn fit(&self, (start, effort): &(Start, Effort)) -> Option<Fit> {
        let fitted = fit(self.study, self.linearised, start.clone(), self.selection, *effort).ok()?;
        all_effects_act(self.study, &fitted).then_some(fitted)
    }

    fn should_extend(&self, from: &Fit, to: &Fit) -> bool {
        let values: usize = self.selection.rows(self.study).iter().map(ExactSizeIterator::len).sum();
        let excess = |fit: &Fit| (fit.cost - values as f64).max(0.0);
        to.hypothesis.effects.len() < 3 || excess(to) < (1.0 - MIN_GAP_REDUCTION) * excess(from)
    }
}

/// ln of the odds that a set must have over a part of it, for each further member. Source: Jeffreys, Theory of Probability, appendix B, 10^(1/2).
const DEMANDED_LN_ODDS: f64 = 1.15;

/// Removes effects whose 95 % interval contains neutral, onsets without evidence against the same effect throughout, and sets of which a part is
/// among the fits and is nearly as likely.
pub(crate) fn supported(search: &Search<'_>, fits: Vec<Fit>) -> Vec<Fit> {
    let simpler = |fit: &Fit| -> Option<Fit> {
        let study = search.study;
        if fit.hypothesis.effects.len() > 1
            && let Some(member) = undetermined(search, fit)
        {
            return search.fit(&search.without(fit, member));
        }
        let mut hypothesis = fit.hypothesis.clone();
        let mut effects = hypothesis.effects.iter_mut();
        let (member, _) = effects.find(|(index, _)| onset_step(study.histories[*index]).is_some())?;
        *member = study.family(*member);
        let throughout = search.fit(&(Start::from(&hypothesis), EFFORT))?;
        (search.ln_odds(fit) - search.ln_odds(&throughout) < search.calibration.threshold)
            .then_some(throughout)
    };
    let mut kept: Vec<Fit> = Vec::with_capacity(fits.len());
    for mut fit in fits {
        for _ in 0..MAX_MEMBERS {
            let Some(next) = simpler(&fit) else { break };
            fit = next;
        }
        kept.push(fit);
    }
    let kept = ranked(search, kept.iter());
    let is_demanded = |fit: &&Fit| {
        let all = members(&fit.hypothesis);
        !kept.iter().any(|part| {
            let some = members(&part.hypothesis);
            let needed = DEMANDED_LN_ODDS * all.len().saturating_sub(some.len()) as f64;
            search.ln_odds(fit) - search.ln_odds(part) < needed && some.iter().all(|one| all.contains(one))
        })
    };
    kept.iter().filter(is_demanded).cloned().collect()
}

/// The first effect of a fit whose 95 % intervals all contain neutral.
fn undetermined(search: &Search<'_>, fit: &Fit) -> Option<usize> {
    let mut place = 0;
    for (index, values) in &fit.hypothesis.effects {
        let parameters = &search.study.effects[*index].info().parameters;
        let near = parameters.iter().zip(values).enumerate().all(|(i, (parameter, value))| {
            let coordinate = Coordinate::new(parameter);
            let variance = fit.covariance.get((place + i, place + i)).copied().unwrap_or(0.0);
            let half = half_width_95(search.calibration.interval_factor * variance.max(0.0).sqrt());
            (coordinate.of(*value) - coordinate.of(parameter.neutral)).abs() < half
        });
        if near {
            return Some(*index);
        }
        place += parameters.len();
    }
    None
}

/// Whether every effect of a fit changes the prediction; one at neutral, or one that this machine cannot have, explains nothing.
fn all_effects_act(study: &Study, fitted: &Fit) -> bool {
    let mut columns = fitted.effect_columns.as_slice();
    fitted.hypothesis.effects.iter().all(|(index, values)| {
        let (own, rest) = columns.split_at(values.len().min(columns.len()));
        columns = rest;
        let acts = own.iter().any(|column| column.iter().any(|change| *change != 0.0));
        let parameters = study.effects[*index].info().parameters.iter();
        acts && parameters.zip(values).any(|(parameter, value)| {
            (value - parameter.neutral).abs() > NEUTRAL_STEPS * parameter.typical_step.abs()
        })
    })
}

/// Distance from neutral, in typical steps, below which an effect is absent. Bound: no recording shows a thousandth of a typical step.
const NEUTRAL_STEPS: f64 = 1e-3;
