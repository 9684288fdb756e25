//! Which library effects a side can diagnose, their smallest detectable size, and why the others cannot be diagnosed.

use crate::driven::fit::{Columns, SideFit, SideProblem};
use crate::driven::side::SideModel;
use crate::driven::side_diagnosis::NotDiagnosable;
use crate::gap::best_fit::coordinate::typical;
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::smallest_seen::{evidence_needed, smallest_size};
use crate::gap::findings::in_words;
use crate::gap::findings::report::SmallestSeen;
use crate::gap::residuals::study::Hypothesis;
use mapper_numerics::{ROUNDING, parallel};
use mapper_physics::rig::effect::EffectInfo;

/// Indices of the effects that change a judged channel, and the other effects with the reason.
pub(crate) fn diagnosable<S: SideModel>(problem: &SideProblem<'_, S>) -> (Vec<usize>, Vec<NotDiagnosable>) {
    let Some(base) = problem.predict(&problem.nothing()) else { return (Vec::new(), Vec::new()) };
    let (mut diagnosable, mut others) = (Vec::new(), Vec::new());
    for (index, effect) in problem.effects.iter().enumerate() {
        let info = effect.info();
        if let Some(reason) = S::covered(&info.id) {
            others.push(not_diagnosable(info, reason.to_owned()));
            continue;
        }
        let acts = [1.0, -1.0].into_iter().any(|share| {
            let values =
                info.parameters.iter().map(|p| (p.neutral + share * p.typical_step).clamp(p.low, p.high));
            let there = Hypothesis { effects: vec![(index, values.collect())], ..problem.nothing() };
            problem.predict(&there).is_some_and(|there| largest_change_k(problem, &there, &base) > ROUNDING)
        });
        if acts {
            diagnosable.push(index);
        } else {
            others.push(not_diagnosable(info, problem.side.why_silent(info.submodel).to_owned()));
        }
    }
    (diagnosable, others)
}

/// Largest change of a judged channel in the rows in which it was measured, K.
fn largest_change_k<S: SideModel>(problem: &SideProblem<'_, S>, there: &Columns, base: &Columns) -> f64 {
    let mut largest_k: f64 = 0.0;
    for ((_, read), (there, base)) in problem.side.rows().judged.iter().zip(there.iter().zip(base)) {
        for i in (0..read.len()).filter(|i| read[*i].is_finite()) {
            largest_k = largest_k.max((there[i] - base[i]).abs());
        }
    }
    largest_k
}

fn not_diagnosable(info: &EffectInfo, reason: String) -> NotDiagnosable {
    NotDiagnosable { effect: info.id.to_string(), name: info.name.to_string(), reason }
}

/// Smallest size of each effect, on the side of its typical step, that would be named in 95 of 100 logs like this one. Effects that no size in their range
/// makes detectable are returned with the unknown that imitates them, except the `open` ones: they were detected. `found` is the most probable fit.
pub(crate) fn smallest<S: SideModel>(
    problem: &SideProblem<'_, S>,
    diagnosable: &[usize],
    found: &SideFit,
    open: &[usize],
    counts: &[bool],
    calibration: &Calibration,
) -> (Vec<SmallestSeen>, Vec<NotDiagnosable>) {
    let Some(base) = problem.linearise_without_cause(found, counts) else { return (Vec::new(), Vec::new()) };
    let against = evidence_needed(calibration, diagnosable.len());
    let results = parallel::map(diagnosable, |effect| {
        let info = problem.effects[*effect].info();
        let (parameter, others) = info.parameters.split_last()?;
        // Length of the signature in sigmas, and the unknown that imitates most of it.
        let signature = |others: &[f64], value: f64| -> Option<(f64, usize)> {
            let effects = vec![(*effect, [others, &[value]].concat())];
            let change = base.change(&Hypothesis { effects, ..base.hypothesis.clone() })?;
            let imitated = &change.imitated;
            let imitator = (0..imitated.len()).max_by(|a, b| imitated[*a].total_cmp(&imitated[*b]))?;
            Some((change.own.max(0.0).sqrt(), imitator))
        };
        // The other parameters stay neutral if the effect is visible then: the lag of an element is, a wall without mass is not.
        let mut fixed: Vec<f64> = others.iter().map(|p| p.neutral).collect();
        if signature(&fixed, typical(parameter))?.0 <= ROUNDING {
            fixed = others.iter().map(typical).collect();
        }
        let mut last_imitator = 0;
        let smallest = smallest_size(parameter, against, |value| {
            let (sigma, imitator) = signature(&fixed, value)?;
            last_imitator = imitator;
            Some(sigma)
        })?;
        let unknown = &S::unknowns()[last_imitator];
        let reason = format!(
            "even {} cannot be distinguished from another value of the unknown {} ({})",
            in_words::size(parameter, smallest.furthest),
            unknown.name,
            unknown.description
        );
        let seen = SmallestSeen::of(info, parameter, smallest.value);
        Some((open.contains(effect), seen, not_diagnosable(info, reason)))
    });
    let (mut smallest, mut others) = (Vec::new(), Vec::new());
    for (is_open, seen, not_diagnosable) in results.into_iter().flatten() {
        if is_open || seen.value.is_some() { smallest.push(seen) } else { others.push(not_diagnosable) }
    }
    (smallest, others)
}
