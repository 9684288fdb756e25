//! Whether probabilities hold: what was said with probability p should be right in a share p of the cases.

use crate::calibrate::{Observed, fit, shipped};
use crate::error::BlindError;
use crate::interval::{Share, clopper_pearson_95};
use crate::kind::CaseKind;
use mapper_gap::calibration::Calibration;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// Classes of equal width from 0 to 1.
const BINS: usize = 10;
/// Parts of the cases: each is judged by a calibration that was fitted to the others.
const FOLDS: usize = 5;

/// Cases whose first answer was given about the same probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Lowest probability of the class.
    pub from: f64,
    /// Highest probability of the class.
    pub to: f64,
    /// Mean of the probabilities that were given.
    pub said: f64,
    /// How often the first answer was right.
    pub right: Share,
    /// 95 % interval of the share that is right (Clopper and Pearson).
    pub right_low: f64,
    /// Its other end.
    pub right_high: f64,
}

/// Reliability of the first answer, by one calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reliability {
    /// Which calibration gave the probabilities.
    pub calibration: String,
    /// The classes that hold cases, from small probabilities to large ones.
    pub bins: Vec<Bin>,
    /// Expected calibration error: how far the share that is right is from the mean probability of a class, on average over all
    /// cases, fraction (Naeini, Cooper and Hauskrecht 2015); `None` without cases.
    pub expected_calibration_error: Option<f64>,
    /// How large that error is expected to be by chance alone where every probability holds.
    pub expected_by_chance: Option<f64>,
    /// Cases whose truth was not among the answers that have a probability.
    pub truth_not_listed: usize,
}

/// By how much the odds of nothing against a cause of the catalogue are larger among the cases than the priors say, logarithm. Cases
/// without a cause are drawn in numbers for the threshold's sake; a probability is judged as of somebody who knows how many.
fn odds_of_nothing(calibration: &Calibration, cases: &[Observed]) -> f64 {
    let count = |wanted: fn(CaseKind) -> bool| cases.iter().filter(|case| wanted(case.kind)).count() as f64;
    let nothing = count(|kind| kind == CaseKind::None);
    let causes = count(|kind| !matches!(kind, CaseKind::None | CaseKind::Outside));
    let prior_causes = calibration.prior_single + calibration.prior_pair + calibration.prior_triple;
    let more = (nothing / causes).ln() - (calibration.prior_none / prior_causes).ln();
    if more.is_finite() { more } else { 0.0 }
}

/// The first answer: its probability, and whether it is right. `None` without any score.
fn first_answer(case: &Observed, calibration: &Calibration, odds_of_nothing: f64) -> Option<(f64, bool)> {
    let outside = calibration.outside(case.features);
    let nothing = case.nothing + odds_of_nothing;
    let scores = || case.candidates.iter().map(|(_, score)| *score).chain([nothing]);
    let top = scores().reduce(f64::max)?;
    let weight = |score: f64| ((score - top) / calibration.temperature).exp();
    let total: f64 = scores().map(weight).sum();
    let inside = |score: f64| (1.0 - outside) * weight(score) / total;
    let is_outside = case.kind == CaseKind::Outside;
    // What only adds to a better cause is that cause, as the diagnosis shows it.
    let mut shown: Vec<(&BTreeSet<String>, f64)> = Vec::new();
    for (causes, score) in &case.candidates {
        match shown.iter_mut().find(|(better, _)| better.is_subset(causes)) {
            Some((_, probability)) => *probability += inside(*score),
            None => shown.push((causes, inside(*score))),
        }
    }
    let is_right = |causes: &BTreeSet<String>| {
        !matches!(case.kind, CaseKind::None | CaseKind::Outside) && *causes == case.causes
    };
    let named = shown.into_iter().map(|(causes, probability)| (probability, is_right(causes)));
    named
        .chain([(inside(nothing), case.kind == CaseKind::None), (outside, is_outside)])
        .filter(|(probability, _)| probability.is_finite())
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Whether the truth has a probability at all.
fn is_listed(case: &Observed) -> bool {
    matches!(case.kind, CaseKind::None | CaseKind::Outside)
        || case.candidates.iter().any(|(causes, _)| *causes == case.causes)
}

/// Classes, and their expected calibration error.
fn reliability(calibration: &str, cases: &[Observed], answers: &[(f64, bool)]) -> Reliability {
    let bins: Vec<Bin> = (0..BINS)
        .filter_map(|index| {
            let inside = |p: f64| ((p * BINS as f64) as usize).min(BINS - 1) == index;
            let members: Vec<(f64, bool)> = answers.iter().copied().filter(|(p, _)| inside(*p)).collect();
            let trials = members.len();
            let right = Share { hits: members.iter().filter(|(_, right)| *right).count(), trials };
            let (right_low, right_high) = clopper_pearson_95(right);
            let said = members.iter().map(|(p, _)| p).sum::<f64>() / trials as f64;
            let edge = |index: usize| index as f64 / BINS as f64;
            (trials > 0).then_some(Bin {
                from: edge(index),
                to: edge(index + 1),
                said,
                right,
                right_low,
                right_high,
            })
        })
        .collect();
    let all = answers.len() as f64;
    let over = |error: &dyn Fn(&Bin) -> f64| {
        (all > 0.0).then(|| bins.iter().map(|bin| bin.right.trials as f64 * error(bin)).sum::<f64>() / all)
    };
    let missed = |bin: &Bin| (bin.right.hits as f64 / bin.right.trials as f64 - bin.said).abs();
    // Mean absolute deviation of a share about its expectation, by the normal law: sqrt(2/pi) sigma.
    let by_chance = |bin: &Bin| {
        (2.0 / std::f64::consts::PI * bin.said * (1.0 - bin.said) / bin.right.trials as f64).max(0.0).sqrt()
    };
    Reliability {
        calibration: calibration.to_owned(),
        expected_calibration_error: over(&missed),
        expected_by_chance: over(&by_chance),
        truth_not_listed: cases.iter().filter(|case| !is_listed(case)).count(),
        bins,
    }
}

/// Reliability by the calibration that ships, which has seen none of the cases, and by the one that they fit, each case judged by
/// a fit to the others (five parts).
///
/// # Errors
/// [`BlindError::Signatures`] where the one that ships was spoilt.
pub fn reliabilities(observed: &[Observed]) -> Result<[Reliability; 2], BlindError> {
    Ok(beside(&shipped()?, observed))
}

fn beside(before: &Calibration, observed: &[Observed]) -> [Reliability; 2] {
    let odds = odds_of_nothing(before, observed);
    let by = |calibration: &Calibration, case: &Observed| first_answer(case, calibration, odds);
    let shipped: Vec<(f64, bool)> = observed.iter().filter_map(|case| by(before, case)).collect();
    let mut held_out = Vec::new();
    for fold in 0..FOLDS {
        let of_fold = |(index, _): &(usize, &Observed)| index % FOLDS == fold;
        let (judged, fitted): (Vec<_>, Vec<_>) = observed.iter().enumerate().partition(of_fold);
        let fitted: Vec<Observed> = fitted.into_iter().map(|(_, case)| case.clone()).collect();
        let calibration = fit(before, &fitted, String::new());
        held_out.extend(judged.iter().filter_map(|(_, case)| by(&calibration, case)));
    }
    [
        reliability("that ships", observed, &shipped),
        reliability("fitted to the other cases", observed, &held_out),
    ]
}

/// What came of so many diagnoses, and where the calibration is.
pub fn calibrated_text(diagnoses: usize, file: &Path, reliabilities: &[Reliability]) -> String {
    let said = reliability_text(reliabilities);
    format!("calibration from {diagnoses} diagnoses in {}\n{said}", file.display())
}

/// A sentence for each.
pub fn reliability_text(reliabilities: &[Reliability]) -> String {
    let mut text = String::new();
    for one in reliabilities {
        let cases: usize = one.bins.iter().map(|bin| bin.right.trials).sum();
        let percent =
            |share: Option<f64>| share.map_or("-".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "calibration {}: expected calibration error {} over {cases} diagnoses ({} by chance alone where every probability \
             holds); the truth was not among the answers in {}",
            one.calibration,
            percent(one.expected_calibration_error),
            percent(one.expected_by_chance),
            one.truth_not_listed,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_gap::report::Verdict;

    /// A case whose first candidate leads by the score that gives it `probability`, right or not.
    fn case(probability: f64, right: bool) -> Observed {
        let set = |id: &str| BTreeSet::from([id.to_owned()]);
        let lead = (probability / (1.0 - probability)).ln();
        Observed {
            kind: CaseKind::Single,
            causes: set(if right { "a" } else { "b" }),
            verdict: Verdict::Explained,
            sigma: Some(30.0),
            nothing: f64::NEG_INFINITY,
            candidates: vec![(set("a"), lead), (set("b"), 0.0)],
            features: [-1e9; 3],
            errors_sigma: Vec::new(),
        }
    }

    /// Temperature 1 and nothing outside: the probabilities are those of the scores.
    fn plain() -> Calibration {
        Calibration { temperature: 1.0, outside: [-50.0, 0.0, 0.0, 0.0], ..Calibration::shipped().unwrap() }
    }

    fn judged(cases: &[Observed]) -> Reliability {
        let [before, _] = beside(&plain(), cases);
        before
    }

    #[test]
    fn what_is_right_as_often_as_it_says_has_no_error() {
        // 0.8 is right in 80 of 100 cases, 0.6 in 60 of 100.
        let of = |p: f64, hits: usize| (0..100).map(move |i| case(p, i < hits));
        let honest: Vec<Observed> = of(0.8, 80).chain(of(0.6, 60)).collect();
        let found = judged(&honest);
        assert!(found.expected_calibration_error.unwrap() < 1e-9, "{found:?}");
        assert_eq!(found.bins.len(), 2);
        // sqrt(2/pi 0.8 0.2/100) = 3.2 % and sqrt(2/pi 0.6 0.4/100) = 3.9 %, half of the cases each.
        assert!((found.expected_by_chance.unwrap() - 0.0355).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn too_sure_by_a_fifth_is_an_error_of_a_fifth() {
        let boasting: Vec<Observed> = (0..100).map(|i| case(0.95, i < 75)).collect();
        let found = judged(&boasting);
        assert!((found.expected_calibration_error.unwrap() - 0.2).abs() < 1e-9, "{found:?}");
        let [bin] = found.bins.as_slice() else { panic!("{found:?}") };
        assert!(bin.right_low < 0.75 && 0.75 < bin.right_high && bin.right_high < bin.said);
        assert_eq!(judged(&[]).expected_calibration_error, None);
    }
}
