//! Which effects, alone or two together, explain a recording best.
//!
//! Every single effect is fitted with runs of the model. What a second effect would add is first estimated in closed
//! form beside the best singles; the most promising pairs are then fitted likewise.

use crate::additions::{additions, starts_of};
use crate::fit::{Effort, Fit, fit};
use crate::projector::Projector;
use crate::screen::{Screened, screen};
use crate::selection::Selection;
use crate::study::{Hypothesis, PredictError, Study, members};
use crate::whiten::Linearised;
use mapper_numerics::parallel;

/// All hypotheses that were fitted, the empty one first, then best first.
#[derive(Debug)]
pub struct Found {
    /// Nothing but tolerances.
    pub null: Fit,
    /// Singles and pairs, best score first.
    pub fits: Vec<Fit>,
    /// Linearised beside the best single, where the nominal point is far from it, and that single.
    pub refound: Option<(Linearised, Vec<usize>)>,
}

/// A single must take at least this off the cost to be worth a second look.
const WORTH: f64 = 6.0;
/// Where a single takes at least this off the cost, nuisances are linearised again beside it: tolerances of what an
/// effect changes act otherwise beside it than where nothing is off.
const STRONG: f64 = 30.0;

/// A single that promises less than this off the cost in a straight line is not fitted: it would not be named by ten times as
/// much.
const PROMISES: f64 = 0.5;

/// What the search works with.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The recording.
    pub study: &'a Study,
    /// Linearised where nothing is off.
    pub nominal: &'a Linearised,
    /// Linearised where the fits begin: there too, or beside the best so far.
    pub linearised: &'a Linearised,
    /// Steps that count.
    pub selection: &'a Selection,
    /// Told the share done, and what comes.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

/// Searches singles and pairs on the steps of the selection.
///
/// # Errors
/// [`PredictError`] where the nominal model cannot follow the recording.
pub fn search(search: Search<'_>) -> Result<Found, PredictError> {
    let Search { study, selection, progress, .. } = search;
    let null = fit(study, search.linearised, &study.nothing(), selection, Effort::default())?;
    progress(0.15, "single effects");
    let mut singles = singles(search);
    let refound = match singles.first() {
        Some(best) if null.cost - best.cost > STRONG => {
            let beside = search.linearised.at(study, &best.hypothesis).ok();
            beside.map(|linearised| (linearised, members(&best.hypothesis)))
        }
        _ => None,
    };
    let linearised = refound.as_ref().map_or(search.linearised, |(linearised, _)| linearised);
    let beside = Search { linearised, ..search };
    if refound.is_some() {
        refit(beside, &mut singles, 4, Effort::default());
    }
    progress(0.5, "pairs");
    let mut fits = if singles.first().is_some_and(|first| null.cost - first.cost > WORTH) {
        pairs(beside, &singles)
    } else {
        Vec::new()
    };
    fits.retain(|pair| does_something(study, pair));
    if let Some(best) = fits.first() {
        // A single that stood off its best would make any partner look useful: each member alone, from where the pair stands.
        let starts: Vec<Hypothesis> = members(&best.hypothesis)
            .into_iter()
            .map(|dropped| {
                let mut start = best.hypothesis.clone();
                start.effects.retain(|(index, _)| *index != dropped);
                start
            })
            .collect();
        let alone = parallel::map(&starts, |start| {
            fit(
                study,
                linearised,
                start,
                selection,
                Effort { iterations: 6, enough: 0.2, ..Effort::default() },
            )
        });
        for fitted in alone.into_iter().flatten() {
            keep_best(&mut singles, fitted);
        }
    }
    fits.append(&mut singles);
    sort(&mut fits);
    Ok(Found { null, fits, refound })
}

/// Fits of all single effects, best first.
fn singles(search: Search<'_>) -> Vec<Fit> {
    let Search { study, linearised, selection, .. } = search;
    let mut starts: Vec<Hypothesis> = Vec::new();
    for index in 0..study.catalogue {
        starts.extend(starts_of(study, &study.nothing(), index));
    }
    let quick = Effort { iterations: 3, enough: 1.0, most_sigmas: 3.0 };
    let tried = parallel::map(&starts, |start| {
        let (started, promised) = linear_start(study, linearised, selection, start)?;
        // What promises nothing is looked at where the line puts it, and no closer.
        let effort = if promised < PROMISES { Effort { iterations: 1, ..quick } } else { quick };
        fit(study, linearised, &started, selection, effort).ok()
    });
    let mut singles: Vec<Fit> = Vec::new();
    for fitted in tried.into_iter().flatten() {
        keep_best(&mut singles, fitted);
    }
    singles.retain(acts);
    sort(&mut singles);
    refit(search, &mut singles, 7, Effort { iterations: 6, enough: 0.2, ..Effort::default() });
    singles
}

/// Fits the best few more thoroughly.
pub fn refit(search: Search<'_>, fits: &mut Vec<Fit>, count: usize, effort: Effort) {
    let best: Vec<Hypothesis> = fits.iter().take(count).map(|f| f.hypothesis.clone()).collect();
    let again =
        parallel::map(&best, |start| fit(search.study, search.linearised, start, search.selection, effort));
    for fitted in again.into_iter().flatten() {
        keep_best(fits, fitted);
    }
    sort(fits);
}

/// Pairs that are fitted because they promise most beside the best singles.
const BESIDE: usize = 6;
/// Pairs that are fitted because the closed form promises most of them, whatever their members do alone.
const SCREENED: usize = 3;

/// Fits of the most promising pairs: beside the best singles, and beside the partners that these ask for.
fn pairs(search: Search<'_>, singles: &[Fit]) -> Vec<Fit> {
    let Search { study, linearised, selection, progress, .. } = search;
    let mut wanted: Vec<Wanted> = Vec::new();
    let mut bases: Vec<usize> = (0..singles.len().min(2)).collect();
    for round in 0..2 {
        let found = parallel::map(&bases, |base| additions(study, linearised, selection, &singles[*base]));
        for (base, added) in bases.iter().zip(found) {
            for addition in added {
                let cost = singles[*base].cost - addition.gain;
                let mut names = vec![singles[*base].hypothesis.effects[0].0, addition.effect];
                names.sort_unstable();
                let candidate = Wanted { cost, names, partner: addition.effect, start: addition.start };
                match wanted.iter_mut().find(|other| other.names == candidate.names) {
                    Some(other) if other.cost <= cost => {}
                    Some(other) => *other = candidate,
                    None => wanted.push(candidate),
                }
            }
        }
        wanted.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        if round == 0 {
            let place = |effect: usize| singles.iter().position(|f| f.hypothesis.effects[0].0 == effect);
            let mut next: Vec<usize> = Vec::new();
            for base in wanted.iter().take(8).filter_map(|w| place(w.partner)) {
                if !next.contains(&base) && !bases.contains(&base) && next.len() < 2 {
                    next.push(base);
                }
            }
            bases = next;
        }
    }
    progress(0.65, "pairs");
    // Pairs that neither of the best singles is a member of: by the straight line from where nothing is off.
    let known = |s: &Screened| wanted.iter().take(BESIDE).any(|w| w.names == s.names);
    let mut screened = screen(study, search.nominal, selection, singles);
    screened.retain(|s| !known(s));
    wanted.truncate(BESIDE);
    wanted.extend(screened.into_iter().take(SCREENED).map(|s| Wanted {
        cost: s.cost,
        partner: s.names[1],
        names: s.names,
        start: s.start,
    }));
    // A second effect that promises nothing beside the best single costs time; two show what pairs there are.
    let least = singles.first().map_or(f64::INFINITY, |best| best.cost - WORTH);
    let starts: Vec<Hypothesis> = wanted
        .into_iter()
        .enumerate()
        .filter(|(place, w)| *place < 2 || w.cost < least)
        .map(|(_, w)| w.start)
        .collect();
    let effort = Effort { iterations: 5, enough: 0.5, ..Effort::default() };
    let fitted = parallel::map(&starts, |start| fit(study, linearised, start, selection, effort));
    let mut pairs = Vec::new();
    for fitted in fitted.into_iter().flatten() {
        keep_best(&mut pairs, fitted);
    }
    sort(&mut pairs);
    refit(search, &mut pairs, 2, Effort::default());
    swap(search, &mut pairs);
    pairs
}

/// Above this share of the number of values, the best pair's cost says that it is not the right one.
const INADEQUATE: f64 = 1.1;

/// Where even the best pair leaves too much, what a third effect would do beside it may be what one of the two should
/// have done: each member in turn gives way to the three that promise most.
fn swap(search: Search<'_>, pairs: &mut Vec<Fit>) {
    let Search { study, linearised, selection, .. } = search;
    let values: usize = selection.rows(study).iter().map(ExactSizeIterator::len).sum();
    let Some(best) = pairs.first().filter(|best| best.cost > INADEQUATE * values as f64) else { return };
    let mut thirds = additions(study, linearised, selection, best);
    thirds.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut starts: Vec<Hypothesis> = Vec::new();
    for third in thirds.into_iter().take(3) {
        for dropped in members(&best.hypothesis) {
            let mut start = third.start.clone();
            start.effects.retain(|(index, _)| *index != dropped);
            starts.push(start);
        }
    }
    let effort = Effort { iterations: 6, enough: 0.5, ..Effort::default() };
    for fitted in
        parallel::map(&starts, |start| fit(study, linearised, start, selection, effort)).into_iter().flatten()
    {
        keep_best(pairs, fitted);
    }
    sort(pairs);
    refit(search, pairs, 2, Effort::default());
}

/// A pair worth a fit.
struct Wanted {
    cost: f64,
    names: Vec<usize>,
    partner: usize,
    start: Hypothesis,
}

/// Best score first.
pub fn sort(fits: &mut [Fit]) {
    fits.sort_by(|a, b| b.score.total_cmp(&a.score));
}

/// Whether each effect of a fit does something: one that the fit left at its neutral value, or that this machine has no place
/// for (convection before the wheel without area there), explains nothing, and a pair with it is not a pair.
pub fn does_something(study: &Study, fitted: &Fit) -> bool {
    acts(fitted)
        && fitted.hypothesis.effects.iter().all(|(index, values)| {
            study.effects[*index].info().parameters.iter().zip(values).any(|(parameter, value)| {
                (value - parameter.neutral).abs() > NEUTRAL_STEPS * parameter.typical_step.abs()
            })
        })
}

/// Whether each effect of a fit changes anything on this machine.
fn acts(fitted: &Fit) -> bool {
    let mut columns = fitted.effect_columns.as_slice();
    fitted.hypothesis.effects.iter().all(|(_, values)| {
        let (own, rest) = columns.split_at(values.len().min(columns.len()));
        columns = rest;
        own.iter().any(|column| column.iter().any(|change| *change != 0.0))
    })
}

/// This near to neutral, in typical steps, an effect is not there.
const NEUTRAL_STEPS: f64 = 1e-3;

/// Keeps one fit for each set of effects: the better.
pub fn keep_best(fits: &mut Vec<Fit>, fitted: Fit) {
    let names = members(&fitted.hypothesis);
    match fits.iter_mut().find(|other| members(&other.hypothesis) == names) {
        Some(other) if other.cost <= fitted.cost => {}
        Some(other) => *other = fitted,
        None => fits.push(fitted),
    }
}

/// The start of a single, moved to where a straight line says its best lies, and what the line promises off the cost; infinity
/// where there is no line.
fn linear_start(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    start: &Hypothesis,
) -> Option<(Hypothesis, f64)> {
    let (index, values) = start.effects.first()?;
    let parameters = &study.effects[*index].info().parameters;
    let [parameter] = parameters.as_slice() else { return Some((start.clone(), f64::INFINITY)) };
    let projector = Projector::new(study, linearised, selection, &[])?;
    let residual = linearised.residual(study, &linearised.base);
    let right_residual = projector.right(&residual);
    // How many times `step` a straight line through neutral and it asks for.
    let share_of = |step: f64| -> Option<(f64, f64)> {
        let mut there = start.clone();
        there.effects = vec![(*index, vec![parameter.neutral + step])];
        let there = study.predict(&there).ok()?;
        let mut change: Vec<f64> =
            there.values.iter().zip(&linearised.base.values).map(|(t, b)| t - b).collect();
        linearised.whiten(study, &mut change);
        let right = projector.right(&change);
        let own = projector.product(&change, &right, &change, &right);
        let seen = projector.product(&change, &right, &residual, &right_residual);
        Some(if own > 1e-9 { ((seen / own).clamp(-4.0, 4.0), seen * seen / own) } else { (0.0, 0.0) })
    };
    let mut step = values[0] - parameter.neutral;
    if step == 0.0 {
        return Some((start.clone(), f64::INFINITY));
    }
    let (mut share, mut promised) = share_of(step)?;
    let opposite = (parameter.neutral - step).clamp(parameter.low, parameter.high) - parameter.neutral;
    if share < -0.1 && opposite != 0.0 {
        // Effects bend: the line is drawn on the side it points to.
        if let Some((there, gain)) = share_of(opposite).filter(|(there, _)| *there > 0.0) {
            (step, share, promised) = (opposite, there, promised.max(gain));
        }
    }
    // Where the line says nothing, stand a little off neutral: at neutral some effects have no slope.
    let share = if share.abs() < 0.1 { 0.1 * if share < 0.0 { -1.0 } else { 1.0 } } else { share };
    let mut moved = study.nothing();
    let value = (parameter.neutral + share * step).clamp(parameter.low, parameter.high);
    let value = if value == parameter.neutral {
        (parameter.neutral + 0.1 * step).clamp(parameter.low, parameter.high)
    } else {
        value
    };
    moved.effects = vec![(*index, vec![value])];
    // From where nothing is off, not from the null's nuisances, which may have bent far to stand in for the effect.
    Some((moved, promised))
}
