//! Which effects explain a recording best: the causes of [`mapper_inference::search`], fitted by runs of the model.

use crate::gap::best_fit::coordinate::Coordinate;
use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, Start, fit, fit_from};
use crate::gap::best_fit::selection::Selection;
use crate::gap::causes::additions::{Addition, additions, onset_additions};
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::weigh::{prior, weight};
use crate::gap::residuals::study::{PredictError, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::half_width_95;
use mapper_inference::descent::ROUNDS;
use mapper_inference::hypotheses::MAX_MEMBERS;
use mapper_inference::search::{Causes, Known, Limits, Offer, climb, extend};

/// What the search works with.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The recording.
    pub study: &'a Study,
    /// Linearised at the start of the fits: at the nominal point, or at the best so far.
    pub linearised: &'a Linearised,
    /// Steps that count.
    pub selection: &'a Selection,
    /// Numbers behind the probabilities.
    pub calibration: &'a Calibration,
    /// Whether to search for causes that begin with a step, in addition to what is known, or for those that act throughout.
    pub onsets: bool,
}

/// Judgement: bounds the time. The slack is the evidence that a cause has to have over nothing.
const LIMITS: Limits = Limits { members: MAX_MEMBERS, starts: 2, fits: 6, slack: 3.0 };
/// If a single takes at least this off the cost, nuisances are linearised again at its fit: tolerances of what an
/// effect changes act otherwise there than at the nominal point.
const STRONG: f64 = 30.0;
/// Starts with the most linear gain that are fitted as a single: bounds the time. Judgement: half of the library, since strong effects bend.
const SINGLES: usize = 26;
/// Share of the misfit that a cause must remove to explain it in part, also on steps that its fit did not see. A further effect that removes
/// less is one of many that chip at a cause of another kind: nothing is built upon it.
pub const MIN_SHRINK: f64 = 0.5;

/// What one more iteration may promise in the cost of a fit that is at its best: well below what any cause is named for.
const UNFINISHED: f64 = 1.0;

const QUICK: Effort = Effort { iterations: 3, enough: 1.0, most_sigmas: 3.0, most_sigmas_of_rig: 3.0 };
const EFFORT: Effort =
    Effort { iterations: 6, enough: 0.3, most_sigmas: MAX_SIGMAS, most_sigmas_of_rig: MAX_SIGMAS };

/// All sets that were fitted.
#[derive(Debug)]
pub struct SearchResult {
    /// Nothing but tolerances.
    pub null: Fit,
    /// Sets of effects, most probable first.
    pub fits: Vec<Fit>,
    /// Linearised at the best single, or at nothing but tolerances, where the nominal point is far from it, and that set.
    pub refound: Option<(Linearised, Vec<usize>)>,
}

/// Searches all effects of the catalogue on the steps of the selection.
///
/// # Errors
/// [`PredictError`] where the nominal model cannot follow the recording.
pub fn search(search: Search<'_>, progress: &dyn Fn(f64, &str)) -> Result<SearchResult, PredictError> {
    let Search { study, selection, .. } = search;
    let mut null = fit(study, search.linearised, &study.nothing(), selection, Effort::default())?;
    // Tolerances that act differently at the fit than where they were linearised stop it short.
    let mut at_null = None;
    for _ in 0..ROUNDS {
        if null.promised < UNFINISHED {
            break;
        }
        let Ok(there) = search.linearised.at(study, &null.hypothesis) else { break };
        null = fit(study, &there, &null.hypothesis, selection, Effort::default())?;
        at_null = Some(there);
    }
    let linearised = at_null.as_ref().unwrap_or(search.linearised);
    let search = Search { linearised, ..search };
    progress(0.15, "single effects");
    // From where nothing is off, not from the null's nuisances, which may have bent far to stand in for an effect.
    let untouched = fit(study, linearised, &study.nothing(), selection, Effort { iterations: 1, ..QUICK })?;
    let mut singles = additions(study, linearised, selection, &untouched);
    singles.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let singles: Vec<(Start, Effort)> = singles.into_iter().take(SINGLES).map(|a| (a.start, QUICK)).collect();
    let mut known = Known::default();
    known.keep(&search, null.clone());
    known.fit_all(&search, &singles);
    again(&search, &mut known, 7, EFFORT);
    let refound =
        known.ranked(&search).first().filter(|best| null.cost - best.cost > STRONG).and_then(|best| {
            let at_best = linearised.at(study, &best.hypothesis).ok()?;
            Some((at_best, members(&best.hypothesis)))
        });
    let search = match &refound {
        Some((at_best, _)) => Search { linearised: at_best, ..search },
        None => search,
    };
    if refound.is_some() {
        again(&search, &mut known, 4, Effort::default());
    }
    progress(0.4, "several effects");
    extend(&search, &mut known, LIMITS);
    let fits = known.ranked(&search);
    Ok(SearchResult { null, fits, refound: refound.or(at_null.map(|linearised| (linearised, Vec::new()))) })
}

/// Adds sets with effects that begin with a step, for which the study has candidates by now.
pub fn search_onsets(search: Search<'_>, null: &Fit, fits: &mut Vec<Fit>) {
    let mut known = Known::default();
    std::iter::once(null).chain(fits.iter()).for_each(|fit| known.keep(&search, fit.clone()));
    climb(&search, &mut known, fits.first().unwrap_or(null), LIMITS);
    *fits = known.ranked(&search);
}

/// Fits the best few again, more thoroughly.
fn again(search: &Search<'_>, known: &mut Known<Fit>, count: usize, effort: Effort) {
    let best: Vec<(Start, Effort)> =
        known.ranked(search).iter().take(count).map(|fit| (Start::from(fit), effort)).collect();
    known.fit_all(search, &best);
}

/// Fits of these hypotheses again, most probable first; of the same effects the more probable one.
pub fn refit(search: &Search<'_>, fits: &[&Fit], effort: Effort) -> Vec<Fit> {
    let mut known = Known::default();
    let afresh = |fit: &&Fit| Start { columns: Vec::new(), ..Start::from(*fit) };
    let starts: Vec<(Start, Effort)> = fits.iter().map(|fit| (afresh(fit), effort)).collect();
    known.fit_all(search, &starts);
    known.ranked(search)
}

/// The most probable fit of each set, most probable first.
pub fn ranked<'a>(search: &Search<'_>, fits: impl Iterator<Item = &'a Fit>) -> Vec<Fit> {
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

    fn offers(&self, base: &Fit) -> Vec<Offer<Self::Start>> {
        let before = prior(self.calibration, self.study, &base.hypothesis);
        let offer = |addition: Addition| {
            let prior = prior(self.calibration, self.study, &addition.start.hypothesis);
            Offer {
                cause: addition.effect,
                ln_gain: 0.5 * addition.gain + prior - before,
                start: (addition.start, EFFORT),
            }
        };
        let look = if self.onsets { onset_additions } else { additions };
        look(self.study, self.linearised, self.selection, base).into_iter().map(offer).collect()
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
        let fitted = fit_from(self.study, self.linearised, start, self.selection, *effort).ok()?;
        does_something(self.study, &fitted).then_some(fitted)
    }

    fn goes_on(&self, from: &Fit, to: &Fit) -> bool {
        let values: usize = self.selection.rows(self.study).iter().map(ExactSizeIterator::len).sum();
        let excess = |fit: &Fit| (fit.cost - values as f64).max(0.0);
        to.hypothesis.effects.len() < 3 || excess(to) < (1.0 - MIN_SHRINK) * excess(from)
    }
}

/// Fits without what the recording does not support: members of a set whose 95 % interval contains neutral, and onsets without evidence
/// against the same effect throughout.
pub fn supported(search: &Search<'_>, fits: Vec<Fit>) -> Vec<Fit> {
    let simpler = |fit: &Fit| -> Option<Fit> {
        let study = search.study;
        if fit.hypothesis.effects.len() > 1
            && let Some(member) = undetermined(search, fit)
        {
            return search.fit(&search.without(fit, member));
        }
        let onset =
            fit.hypothesis.effects.iter().position(|(index, _)| study.courses[*index].onset().is_some());
        let mut hypothesis = fit.hypothesis.clone();
        hypothesis.effects[onset?].0 = study.family(hypothesis.effects[onset?].0);
        let start = Start { hypothesis, prediction: None, columns: Vec::new() };
        let throughout = search.fit(&(start, EFFORT))?;
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
    ranked(search, kept.iter())
}

/// The first effect of a fit with all its parameters within their 95 % interval of neutral.
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

/// Whether each effect of a fit does something: one that the fit left at its neutral value, or that this machine has no place
/// for (convection before the wheel without area there), explains nothing, and a pair with it is not a pair.
fn does_something(study: &Study, fitted: &Fit) -> bool {
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

/// This near to neutral, in typical steps, an effect is not there.
const NEUTRAL_STEPS: f64 = 1e-3;
