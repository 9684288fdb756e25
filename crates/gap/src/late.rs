//! Causes that begin while a recording is made: from a step on, or growing from it.

use crate::additions::starts_of;
use crate::calibration::Calibration;
use crate::course::Course;
use crate::fit::{Effort, Fit, fit};
use crate::projector::Projector;
use crate::select::{does_something, keep_best};
use crate::selection::Selection;
use crate::study::{Hypothesis, Study, members};
use crate::weigh::{by_weight, weight};
use crate::whiten::{Linearised, rows_of_step};
use mapper_numerics::parallel;

/// Beginnings that are fitted.
const TRIED: usize = 6;
/// Of these, from the same effect at most.
const OF_ONE_EFFECT: usize = 2;
/// A beginning must promise this off the cost to be fitted.
const WORTH: f64 = 30.0;

const EFFORT: Effort = Effort { iterations: 5, enough: 0.5, most_sigmas: crate::fit::MOST_SIGMAS };

/// A cause that begins, as a straight line sees it.
struct Late {
    effect: usize,
    course: Course,
    gain: f64,
    value: f64,
    base: usize,
}

/// Adds causes that begin with a step to `fits` (best first), beside nothing, the best single and the best, where one beats all
/// that act throughout by the threshold by which a cause beats nothing.
pub(crate) fn late(
    study: &mut Study,
    linearised: &Linearised,
    selection: &Selection,
    calibration: &Calibration,
    null: &Fit,
    fits: &mut Vec<Fit>,
) {
    let bases: Vec<Fit> = {
        let single = fits.iter().find(|fit| fit.hypothesis.effects.len() == 1);
        let best = fits.first().filter(|fit| fit.hypothesis.effects.len() < 4);
        let mut bases = vec![null.clone()];
        bases.extend(single.cloned());
        bases.extend(best.filter(|best| best.hypothesis.effects.len() > 1).cloned());
        bases
    };
    let mut promising: Vec<Late> = bases
        .iter()
        .enumerate()
        .flat_map(|(place, base)| looks(study, linearised, selection, base, place))
        .collect();
    promising.sort_by(|a, b| (bases[a.base].cost - a.gain).total_cmp(&(bases[b.base].cost - b.gain)));
    promising.truncate(TRIED);
    let mut found = Vec::new();
    for round in 0..2 {
        let starts: Vec<Hypothesis> = promising
            .iter()
            .map(|late| {
                let index = study.add_late(late.effect, late.course);
                let mut start = bases[late.base].hypothesis.clone();
                start.effects.push((index, vec![late.value]));
                start
            })
            .collect();
        let study = &*study;
        for fitted in parallel::map(&starts, |start| fit(study, linearised, start, selection, EFFORT)) {
            match fitted {
                Ok(fitted) if does_something(study, &fitted) => keep_best(&mut found, fitted),
                _ => {}
            }
        }
        by_weight(calibration, study, &mut found);
        // The step beside, and the other way of beginning.
        let to_beat = weight(calibration, study, fits.first().unwrap_or(null));
        let beats = |best: &&Fit| round == 0 && weight(calibration, study, best) > to_beat;
        let Some(best) = found.first().filter(beats) else { break };
        promising = beside(study, best, &bases);
    }
    let Some(best) = found.first() else { return };
    let to_beat = fits.first().unwrap_or(null);
    if weight(calibration, study, best) > weight(calibration, study, to_beat) + calibration.threshold {
        found.truncate(3);
        for late in found {
            keep_best(fits, late);
        }
        by_weight(calibration, study, fits);
    }
}

/// What beginnings promise beside a base: what an effect changes is taken in the steps from each one on, as if nothing before
/// it had been changed and nothing lasted.
fn looks(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    base: &Fit,
    place: usize,
) -> Vec<Late> {
    let Some(projector) = Projector::new(study, linearised, selection, &base.effect_columns) else {
        return Vec::new();
    };
    let mut right_residual = projector.right(&base.residual);
    for (right, nuisance) in right_residual.iter_mut().zip(&base.hypothesis.nuisances) {
        *right -= nuisance;
    }
    let steps = study.steps.len();
    let used = members(&base.hypothesis);
    let effects: Vec<usize> = (0..study.catalogue)
        .filter(|index| !used.contains(index) && study.effects[*index].info().parameters.len() == 1)
        .collect();
    let of_effect = |effect: &usize| -> Option<Vec<Late>> {
        let parameter = &study.effects[*effect].info().parameters[0];
        let start = starts_of(study, &base.hypothesis, *effect).into_iter().next()?;
        let there = study.predict(&start).ok()?;
        let mut change: Vec<f64> =
            there.values.iter().zip(&base.prediction.values).map(|(t, b)| t - b).collect();
        linearised.whiten(study, &mut change);
        let step_size = start.effects.last()?.1.first()? - parameter.neutral;
        let mut all = Vec::new();
        for first in 1..steps {
            for course in [Course::From(first), Course::Growing(first)] {
                // Growing over a single step is beginning with it.
                if course == Course::Growing(steps - 1) {
                    continue;
                }
                let mut late = vec![0.0; change.len()];
                for step in first..steps {
                    let share = course.share(step, steps);
                    for row in rows_of_step(study, step) {
                        late[row] = share * change[row];
                    }
                }
                let right = projector.right(&late);
                let own = projector.product(&late, &right, &late, &right);
                let seen = projector.product(&late, &right, &base.residual, &right_residual);
                if own < 1.0 {
                    continue;
                }
                let value = (parameter.neutral + (seen / own).clamp(-3.0, 3.0) * step_size)
                    .clamp(parameter.low, parameter.high);
                let share = (value - parameter.neutral) / step_size;
                let gain = 2.0 * share * seen - share * share * own;
                all.push(Late { effect: *effect, course, gain, value, base: place });
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        all.truncate(OF_ONE_EFFECT);
        Some(all)
    };
    let mut best: Vec<Late> = parallel::map(&effects, of_effect).into_iter().flatten().flatten().collect();
    best.retain(|late| {
        late.gain > WORTH && late.value != study.effects[late.effect].info().parameters[0].neutral
    });
    best.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    best.truncate(TRIED);
    best
}

/// The neighbours of a found beginning.
fn beside(study: &Study, best: &Fit, bases: &[Fit]) -> Vec<Late> {
    let late = best.hypothesis.effects.iter().find(|(index, _)| study.courses[*index].onset().is_some());
    let Some((index, values)) = late else { return Vec::new() };
    let rest: Vec<usize> = members(&best.hypothesis).into_iter().filter(|other| other != index).collect();
    let Some(base) = bases.iter().position(|base| members(&base.hypothesis) == rest) else {
        return Vec::new();
    };
    let Some(effect) =
        (0..study.catalogue).find(|i| std::sync::Arc::ptr_eq(&study.effects[*i], &study.effects[*index]))
    else {
        return Vec::new();
    };
    let course = study.courses[*index];
    let first = course.onset().unwrap_or(0);
    let last = study.steps.len().saturating_sub(1);
    let mut courses: Vec<Course> = Vec::new();
    for step in [first.saturating_sub(1), first, first + 1] {
        if (1..=last).contains(&step) {
            courses.extend([Course::From(step), Course::Growing(step)]);
        }
    }
    courses.retain(|other| *other != course && *other != Course::Growing(last));
    let value = values.first().copied().unwrap_or(0.0);
    courses.into_iter().map(|course| Late { effect, course, gain: 0.0, value, base }).collect()
}
