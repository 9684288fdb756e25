//! Reliability of the probabilities, with exact intervals: an answer given with probability p should be right in a share p of the cases.

use crate::blind::calibration::{DiagnosisSummary, fit, shipped, weights};
use crate::blind::cases::{BlindError, CaseKind};
use mapper_diagnose::gap::Calibration;
use mapper_numerics::statistics::share_interval_95;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::fmt::Write;

/// `hits` out of `trials`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Share {
    /// Number of hits.
    pub hits: usize,
    /// Number of trials.
    pub trials: usize,
}

impl Share {
    pub(crate) fn count(&mut self, hit: bool) {
        self.trials += 1;
        self.hits += usize::from(hit);
    }
}

/// Both ends of the exact 95 % interval of a binomial share (Clopper and Pearson 1934); 0 and 1 without trials.
pub fn clopper_pearson_95(share: Share) -> (f64, f64) {
    share_interval_95(share.hits as f64, share.trials as f64)
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.trials == 0 {
            return f.write_str("0/0");
        }
        let (low, high) = clopper_pearson_95(*self);
        write!(f, "{}/{}  [{:.0}, {:.0}] %", self.hits, self.trials, 100.0 * low, 100.0 * high)
    }
}

/// Number of probability classes of equal width.
const BINS: usize = 10;
/// Number of folds of the cross-validation: each part is judged by a calibration fitted to the others.
const FOLDS: usize = 5;

/// Cases whose first answer has a probability in the same class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Lowest probability of the class.
    pub from: f64,
    /// Highest probability of the class.
    pub to: f64,
    /// Weighted share of all cases.
    pub share: f64,
    /// Mean of the predicted probabilities.
    pub said: f64,
    /// Number of correct first answers, unweighted.
    pub right: Share,
    /// Weighted share of correct first answers.
    pub right_share: f64,
    /// 95 % interval of that share (Clopper and Pearson), for [`Bin::effective_cases`] equal cases.
    pub right_low: f64,
    /// Upper end of the interval.
    pub right_high: f64,
    /// Number of equally weighted cases with the same information (Kish 1965): squared sum of the weights over the sum of their squares.
    pub effective_cases: f64,
}

#[derive(Debug, Clone, Copy)]
struct Answer {
    probability: f64,
    right: bool,
    weight: f64,
}

/// Reliability of the first answer, by one calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reliability {
    /// The calibration of the probabilities.
    pub calibration: String,
    /// The classes with cases, in ascending order of probability.
    pub bins: Vec<Bin>,
    /// Expected calibration error, fraction (Naeini, Cooper and Hauskrecht 2015): mean distance of right share and probability, or `None`.
    pub expected_calibration_error: Option<f64>,
    /// The error expected by chance if all probabilities are correct.
    pub expected_by_chance: Option<f64>,
    /// Cases whose true cause was not among the candidates.
    pub truth_not_listed: usize,
}

/// The first answer: its probability, and whether it is right. `None` without any score.
fn first_answer(case: &DiagnosisSummary, calibration: &Calibration) -> Option<(f64, bool)> {
    let outside = calibration.outside(case.features);
    let scores = || case.candidates.iter().map(|(_, score)| *score).chain([case.nothing]);
    let top = scores().reduce(f64::max)?;
    let weight = |score: f64| ((score - top) / calibration.temperature).exp();
    let total: f64 = scores().map(weight).sum();
    let inside = |score: f64| (1.0 - outside) * weight(score) / total;
    let is_outside = case.kind == CaseKind::Outside;
    // As in the diagnosis, a hypothesis that only adds effects to a better one is merged with that one.
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
    let listed = 1.0 - calibration.unlisted;
    let named = shown.into_iter().map(|(causes, probability)| (listed * probability, is_right(causes)));
    named
        .chain([(inside(case.nothing), case.kind == CaseKind::None), (outside, is_outside)])
        .filter(|(probability, _)| probability.is_finite())
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

fn reliability(calibration: &str, cases: &[DiagnosisSummary], answers: &[Answer]) -> Reliability {
    let all: f64 = answers.iter().map(|answer| answer.weight).sum();
    let bins: Vec<Bin> = (0..BINS)
        .filter_map(|index| {
            let inside =
                |answer: &&Answer| ((answer.probability * BINS as f64) as usize).min(BINS - 1) == index;
            let members: Vec<&Answer> = answers.iter().filter(inside).collect();
            bin(index, &members, all)
        })
        .collect();
    let weighted_mean = |error: &dyn Fn(&Bin) -> f64| {
        (!bins.is_empty()).then(|| bins.iter().map(|bin| bin.share * error(bin)).sum::<f64>())
    };
    let error = |bin: &Bin| (bin.right_share - bin.said).abs();
    // Mean absolute deviation of a share about its expectation, by the normal distribution: sqrt(2/pi) sigma.
    let by_chance = |bin: &Bin| {
        (2.0 / std::f64::consts::PI * bin.said * (1.0 - bin.said) / bin.effective_cases).max(0.0).sqrt()
    };
    Reliability {
        calibration: calibration.to_owned(),
        expected_calibration_error: weighted_mean(&error),
        expected_by_chance: weighted_mean(&by_chance),
        truth_not_listed: cases.iter().filter(|case| !case.is_listed()).count(),
        bins,
    }
}

/// A class; `None` without members. `all`: the sum of all weights.
fn bin(index: usize, members: &[&Answer], all: f64) -> Option<Bin> {
    let sum = |value: &dyn Fn(&Answer) -> f64| members.iter().map(|answer| value(answer)).sum::<f64>();
    let weight = sum(&|answer| answer.weight);
    let right_share = sum(&|answer| if answer.right { answer.weight } else { 0.0 }) / weight;
    let effective_cases = weight * weight / sum(&|answer| answer.weight * answer.weight);
    let equal = Share {
        hits: (right_share * effective_cases).round() as usize,
        trials: effective_cases.round() as usize,
    };
    let (right_low, right_high) = clopper_pearson_95(equal);
    let edge = |index: usize| index as f64 / BINS as f64;
    (!members.is_empty()).then_some(Bin {
        from: edge(index),
        to: edge(index + 1),
        share: weight / all,
        said: sum(&|answer| answer.weight * answer.probability) / weight,
        right: Share { hits: members.iter().filter(|answer| answer.right).count(), trials: members.len() },
        right_share,
        right_low,
        right_high,
        effective_cases,
    })
}

/// Reliability by the shipped calibration, which may be fitted to these cases, and by a five-fold cross-validation.
pub fn reliabilities(observed: &[DiagnosisSummary]) -> Result<[Reliability; 2], BlindError> {
    Ok(shipped_and_cross_validated(&shipped()?, observed))
}

fn shipped_and_cross_validated(before: &Calibration, observed: &[DiagnosisSummary]) -> [Reliability; 2] {
    let weights = weights(before, observed);
    let by = |calibration: &Calibration, (case, weight): (&DiagnosisSummary, f64)| {
        first_answer(case, calibration).map(|(probability, right)| Answer { probability, right, weight })
    };
    let weighted: Vec<(&DiagnosisSummary, f64)> = observed.iter().zip(weights.iter().copied()).collect();
    let shipped: Vec<Answer> = weighted.iter().filter_map(|case| by(before, *case)).collect();
    let mut held_out = Vec::new();
    for fold in 0..FOLDS {
        let of_fold = |(index, _): &(usize, &(&DiagnosisSummary, f64))| index % FOLDS == fold;
        let (judged, fitted): (Vec<_>, Vec<_>) = weighted.iter().enumerate().partition(of_fold);
        let fitted: Vec<DiagnosisSummary> =
            fitted.into_iter().map(|(_, (case, _))| (*case).clone()).collect();
        let calibration = fit(before, &fitted, String::new());
        held_out.extend(judged.iter().filter_map(|(_, case)| by(&calibration, **case)));
    }
    [
        reliability("that ships", observed, &shipped),
        reliability("fitted to the other cases", observed, &held_out),
    ]
}

/// One sentence for each result.
pub fn reliability_text(reliabilities: &[Reliability]) -> String {
    let mut text = String::new();
    for row in reliabilities {
        let cases: usize = row.bins.iter().map(|bin| bin.right.trials).sum();
        let percent =
            |share: Option<f64>| share.map_or("-".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "calibration {}: expected calibration error {} over {cases} diagnoses ({} by chance alone if every probability \
             is correct); the truth was not among the answers in {}",
            row.calibration,
            percent(row.expected_calibration_error),
            percent(row.expected_by_chance),
            row.truth_not_listed,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_diagnose::gap::Verdict;

    /// Without a miss in n trials the lower end is 0.025^(1/n), in closed form; and by symmetry without a hit. For 19 of
    /// 20 the textbook values 0.7513 and 0.9987 (e.g. Hollander and Wolfe, table of binomial intervals).
    #[test]
    fn intervals_are_exact() {
        for n in [1, 5, 20, 300] {
            let closed = 0.025f64.powf(1.0 / n as f64);
            let (low, high) = clopper_pearson_95(Share { hits: n, trials: n });
            assert!((low - closed).abs() < 1e-9 && high == 1.0, "{n}: {low}");
            let (low, high) = clopper_pearson_95(Share { hits: 0, trials: n });
            assert!((high - (1.0 - closed)).abs() < 1e-9 && low == 0.0);
        }
        let (low, high) = clopper_pearson_95(Share { hits: 19, trials: 20 });
        assert!((low - 0.7513).abs() < 5e-5 && (high - 0.9987).abs() < 5e-5, "{low} {high}");
        assert_eq!(clopper_pearson_95(Share::default()), (0.0, 1.0));
    }

    /// A case whose first candidate has this `probability`; `right`: whether it is the true cause.
    fn case(probability: f64, right: bool) -> DiagnosisSummary {
        let set = |id: &str| BTreeSet::from([id.to_owned()]);
        let lead = (probability / (1.0 - probability)).ln();
        DiagnosisSummary {
            kind: CaseKind::Single,
            causes: set(if right { "a" } else { "b" }),
            verdict: Verdict::Explained,
            sigma: Some(30.0),
            nothing: f64::NEG_INFINITY,
            candidates: vec![(set("a"), lead), (set("b"), 0.0)],
            features: [-1e9; 2],
            errors_sigma: Vec::new(),
        }
    }

    /// Temperature 1 and nothing outside: the probabilities are those of the scores.
    fn plain() -> Calibration {
        Calibration {
            temperature: 1.0,
            unlisted: 0.0,
            outside: [-50.0, 0.0, 0.0],
            ..Calibration::shipped().unwrap()
        }
    }

    fn reliability_of(cases: &[DiagnosisSummary]) -> Reliability {
        let [before, _] = shipped_and_cross_validated(&plain(), cases);
        before
    }

    #[test]
    fn probabilities_that_match_the_shares_have_no_error() {
        // 0.8 is right in 80 of 100 cases, 0.6 in 60 of 100.
        let of = |p: f64, hits: usize| (0..100).map(move |i| case(p, i < hits));
        let honest: Vec<DiagnosisSummary> = of(0.8, 80).chain(of(0.6, 60)).collect();
        let result = reliability_of(&honest);
        assert!(result.expected_calibration_error.unwrap() < 1e-9, "{result:?}");
        assert_eq!(result.bins.len(), 2);
        // sqrt(2/pi 0.8 0.2/100) = 3.2 % and sqrt(2/pi 0.6 0.4/100) = 3.9 %, half of the cases each.
        assert!((result.expected_by_chance.unwrap() - 0.0355).abs() < 1e-3, "{result:?}");
    }

    #[test]
    fn overconfidence_of_a_fifth_is_an_error_of_a_fifth() {
        let boasting: Vec<DiagnosisSummary> = (0..100).map(|i| case(0.95, i < 75)).collect();
        let result = reliability_of(&boasting);
        assert!((result.expected_calibration_error.unwrap() - 0.2).abs() < 1e-9, "{result:?}");
        let [bin] = result.bins.as_slice() else { panic!("{result:?}") };
        assert!(bin.right_low < 0.75 && 0.75 < bin.right_high && bin.right_high < bin.said);
        assert_eq!(reliability_of(&[]).expected_calibration_error, None);
    }
}
