//! Which library effects a side can diagnose, their smallest detectable size, and why the others cannot be diagnosed.

use crate::driven::cause_search::fit::{Fit, Question, normal, whitened};
use crate::driven::cause_search::side_diagnosis::NotAsked;
use crate::driven::cause_search::sides::side::Side;
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::smallest_seen::{evidence_needed, smallest_size};
use crate::gap::findings::in_words;
use crate::gap::findings::report::SmallestSeen;
use crate::gap::residuals::study::Hypothesis;
use mapper_inference::descent::FINE;
use mapper_numerics::{ROUNDING, parallel};
use mapper_physics::rig::effect::{EffectInfo, EffectParameter};

/// Indices of the effects that change a judged channel, and the others with the reason.
pub(crate) fn audible<S: Side>(question: &Question<'_, S>) -> (Vec<usize>, Vec<NotAsked>) {
    let Some(base) = question.predict(&question.nothing()) else { return (Vec::new(), Vec::new()) };
    let (mut asked, mut silent) = (Vec::new(), Vec::new());
    for (place, effect) in question.effects.iter().enumerate() {
        let info = effect.info();
        if let Some(reason) = S::free(&info.id) {
            silent.push(not_asked(info, reason.to_owned()));
            continue;
        }
        let changed = [1.0, -1.0].into_iter().any(|share| {
            let values =
                info.parameters.iter().map(|p| (p.neutral + share * p.typical_step).clamp(p.low, p.high));
            let there = Hypothesis { effects: vec![(place, values.collect())], ..question.nothing() };
            question.predict(&there).is_some_and(|predicted| largest(question, &predicted, &base) > ROUNDING)
        });
        if changed {
            asked.push(place);
        } else {
            silent.push(not_asked(info, question.side.silent(info.submodel).to_owned()));
        }
    }
    (asked, silent)
}

/// Largest change of a measured channel, K.
fn largest<S: Side>(question: &Question<'_, S>, predicted: &[Vec<f64>], base: &[Vec<f64>]) -> f64 {
    let mut largest: f64 = 0.0;
    for ((_, read), (predicted, base)) in question.side.rows().judged.iter().zip(predicted.iter().zip(base)) {
        for (_, (predicted, base)) in
            read.iter().zip(predicted.iter().zip(base)).filter(|(read, _)| read.is_finite())
        {
            largest = largest.max((predicted - base).abs());
        }
    }
    largest
}

fn not_asked(info: &EffectInfo, reason: String) -> NotAsked {
    NotAsked { effect: info.id.to_string(), name: info.name.to_string(), reason }
}

/// Smallest size of each effect, on the side of its typical step, that would be named in 95 of 100 logs like this one. Effects undetectable
/// within their range are returned with the parameter that absorbs them, except `open` ones, which were already detected. `found` is the
/// likeliest explanation.
pub(crate) fn smallest<S: Side>(
    question: &Question<'_, S>,
    asked: &[usize],
    found: &Fit,
    open: &[usize],
    counts: &[bool],
    calibration: &Calibration,
) -> (Vec<SmallestSeen>, Vec<NotAsked>) {
    // At the fitted unknowns, without any effect.
    let unknowns = S::unknowns().len();
    let base = Hypothesis { effects: Vec::new(), nuisances: found.hypothesis.nuisances.clone() };
    let Some(predicted) = question.predict(&base) else { return (Vec::new(), Vec::new()) };
    let whitenings = question.whitenings(counts, &found.left_k);
    let slopes = question.slopes(&base, &predicted, &[], FINE);
    let none: Vec<Vec<f64>> = predicted.iter().map(|column| vec![0.0; column.len()]).collect();
    let (normal, columns) = normal(&whitenings, &slopes, &none, &vec![(0.0, 1.0); unknowns]);
    let Some(cholesky) = normal.matrix.cholesky() else { return (Vec::new(), Vec::new()) };
    let against = evidence_needed(calibration, asked.len());
    let looked = parallel::map(asked, |effect| {
        let info = question.effects[*effect].info();
        let (parameter, others) = info.parameters.split_last()?;
        let length_with = |others: &[f64], value: f64| -> Option<(f64, usize)> {
            let there = Hypothesis { effects: vec![(*effect, [others, &[value]].concat())], ..base.clone() };
            let there = question.predict(&there)?;
            let change: Vec<Vec<f64>> = there
                .iter()
                .zip(&predicted)
                .map(|(t, s)| t.iter().zip(s).map(|(t, s)| t - s).collect())
                .collect();
            let change = whitened(&whitenings, &change);
            let dot = |column: &[Vec<f64>]| -> f64 {
                column.iter().flatten().zip(change.iter().flatten()).map(|(a, b)| a * b).sum()
            };
            let right = nalgebra::DVector::from_fn(unknowns, |i, _| dot(&columns[i]));
            let taken = cholesky.solve(&right);
            let whole = dot(&change);
            let most =
                (0..unknowns).max_by(|a, b| (taken[*a] * right[*a]).total_cmp(&(taken[*b] * right[*b])))?;
            Some(((whole - right.dot(&taken)).max(0.0).sqrt(), most))
        };
        // Alone if visible alone: a wall without mass is invisible, but the lag of an element without a sheath is not.
        let typical = |p: &EffectParameter| (p.neutral + p.typical_step).clamp(p.low, p.high);
        let neutral: Vec<f64> = others.iter().map(|p| p.neutral).collect();
        let usual: Vec<f64> = others.iter().map(typical).collect();
        let alone = length_with(&neutral, typical(parameter))?.0 > ROUNDING;
        let mut taker = 0;
        let smallest = smallest_size(parameter, against, |value| {
            let (sigma, most) = length_with(if alone { &neutral } else { &usual }, value)?;
            taker = most;
            Some(sigma)
        })?;
        let largest = in_words::size(parameter, smallest.furthest);
        let smallest = SmallestSeen::of(info, parameter, smallest.value);
        let unknown = &S::unknowns()[taker];
        let reason = format!(
            "even {largest} would not be told from what is not known: {} ({}) takes its place",
            unknown.name, unknown.description
        );
        Some((open.contains(effect), smallest, not_asked(info, reason)))
    });
    let (mut smallest, mut silent) = (Vec::new(), Vec::new());
    for (open, seen, why_not) in looked.into_iter().flatten() {
        if open || seen.value.is_some() { smallest.push(seen) } else { silent.push(why_not) }
    }
    (smallest, silent)
}
