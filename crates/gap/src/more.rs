//! Three and more effects at once: the best pair is extended as long as the evidence grows.

use crate::additions::additions;
use crate::calibration::Calibration;
use crate::fit::{Effort, Fit, fit};
use crate::select::{does_something, keep_best};
use crate::selection::Selection;
use crate::study::{Hypothesis, Study, members};
use crate::weigh::{by_weight, weight};
use crate::whiten::Linearised;
use mapper_numerics::parallel;

/// Effects at most.
const MOST_EFFECTS: usize = 4;
/// A further effect must promise at least this off the cost to be tried: what it costs in evidence is of this order.
const WORTH: f64 = 12.0;
/// Further effects that are fitted.
const TRIED: usize = 4;
/// Above this share of the number of values, a set's cost says that one of its members stands in for another.
const INADEQUATE: f64 = 1.05;
/// A further effect that leaves more than this share of the excess cost is one of many that chip at a cause of another kind:
/// nothing is built upon it.
const HALVED: f64 = 0.5;

const EFFORT: Effort = Effort { iterations: 6, enough: 0.3, most_sigmas: crate::fit::MOST_SIGMAS };

/// Adds sets of three and more effects to `fits` (best first) where one beats all smaller ones by the same threshold by which a
/// cause beats nothing. Gives what one more effect would take off the best's cost at most.
pub(crate) fn extend(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    calibration: &Calibration,
    null: &Fit,
    fits: &mut Vec<Fit>,
) -> f64 {
    loop {
        let best = fits.first().unwrap_or(null);
        let effects = best.hypothesis.effects.len();
        let mut further = additions(study, linearised, selection, best);
        further.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let one_more = further.first().map_or(0.0, |first| first.gain.max(0.0));
        if !(2..MOST_EFFECTS).contains(&effects) || one_more < WORTH {
            return one_more;
        }
        let starts: Vec<Hypothesis> =
            further.into_iter().take(TRIED).map(|addition| addition.start).collect();
        let mut larger = fitted(study, linearised, selection, &starts);
        by_weight(calibration, study, &mut larger);
        let values: usize = selection.rows(study).iter().map(ExactSizeIterator::len).sum();
        let excess = |fit: &Fit| (fit.cost - values as f64).max(0.0);
        let halved = larger.first().is_some_and(|found| excess(found) < HALVED * excess(best));
        if halved && larger.first().is_some_and(|found| found.cost > INADEQUATE * values as f64) {
            swap(study, linearised, selection, calibration, &mut larger);
        }
        let Some(found) = larger.first() else { return one_more };
        if weight(calibration, study, found) < weight(calibration, study, best) + calibration.threshold {
            return one_more;
        }
        // Near relatives of the best stay as rivals, each with what it is worth.
        larger.truncate(3);
        for found in larger {
            keep_best(fits, found);
        }
        by_weight(calibration, study, fits);
        if !halved {
            return one_more;
        }
    }
}

fn fitted(study: &Study, linearised: &Linearised, selection: &Selection, starts: &[Hypothesis]) -> Vec<Fit> {
    let mut fits: Vec<Fit> = Vec::new();
    let found = parallel::map(starts, |start| fit(study, linearised, start, selection, EFFORT));
    for fitted in found.into_iter().flatten().filter(|fitted| does_something(study, fitted)) {
        keep_best(&mut fits, fitted);
    }
    fits
}

/// Where the best set leaves too much, each of its members in turn gives way to what promises most in its place.
fn swap(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    calibration: &Calibration,
    sets: &mut Vec<Fit>,
) {
    let Some(best) = sets.first() else { return };
    let without: Vec<Hypothesis> = members(&best.hypothesis)
        .into_iter()
        .map(|dropped| {
            let mut rest = best.hypothesis.clone();
            rest.effects.retain(|(index, _)| *index != dropped);
            rest
        })
        .collect();
    let known: Vec<Vec<usize>> = sets.iter().map(|set| members(&set.hypothesis)).collect();
    let mut starts: Vec<Hypothesis> = Vec::new();
    for rest in fitted(study, linearised, selection, &without) {
        let mut promising = additions(study, linearised, selection, &rest);
        promising.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let fresh = promising.into_iter().map(|addition| addition.start);
        starts.extend(fresh.filter(|start| !known.contains(&members(start))).take(2));
    }
    for found in fitted(study, linearised, selection, &starts) {
        keep_best(sets, found);
    }
    by_weight(calibration, study, sets);
}
