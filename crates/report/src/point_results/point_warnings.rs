//! Warnings and remarks about points, each sentence once.

use crate::document::Sentence;
use crate::point_results::warning_text::sentence_of;
use mapper_core::{IdentifiedPoint, Verdict, step_number};

/// A sentence, and the steps that it applies to.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt<'a> {
    /// Steps, from 1, in order.
    steps: Vec<usize>,
    /// Its kind.
    pub code: &'a str,
    sentence: Sentence,
}

/// All remarks on the points, in order of the first step of each. Warnings that differ only in their values are merged into one, with the range
/// of each value. The exact sentence of a step is shown with its point.
pub fn doubts<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<Doubt<'a>> {
    let mut merged: Vec<Doubt<'a>> = Vec::new();
    for point in points {
        let step = step_number(point.step);
        for warning in &point.warnings {
            let (code, sentence) = (warning.code(), sentence_of(warning));
            let mut same_sentence = merged
                .iter_mut()
                .filter_map(|known| (known.code == code && known.sentence.merge(&sentence)).then_some(known));
            match same_sentence.next() {
                Some(known) if known.steps.last() == Some(&step) => {}
                Some(known) => known.steps.push(step),
                None => merged.push(Doubt { steps: vec![step], code, sentence }),
            }
        }
    }
    merged
}

/// For each reason why points are not good, the steps and a sentence.
pub(crate) fn reasons<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<String> {
    let all: Vec<&IdentifiedPoint> = points.collect();
    let first_only: Vec<IdentifiedPoint> = all
        .iter()
        .filter(|point| point.verdict != Verdict::Good)
        .map(|point| IdentifiedPoint {
            warnings: point.warnings.iter().take(1).cloned().collect(),
            ..(*point).clone()
        })
        .collect();
    let named = |doubt: &Doubt<'_>| {
        let is_of_all = doubt.count() == all.len() && all.len() > 1;
        let steps = if is_of_all { "all steps".to_owned() } else { doubt.steps() };
        format!("{steps}: {}", doubt.message())
    };
    doubts(first_only.iter()).iter().map(named).collect()
}

impl Doubt<'_> {
    /// The sentence; a value that differs between steps is shown as a range.
    pub fn message(&self) -> String {
        self.sentence.to_string()
    }

    /// Number of steps that it applies to.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The steps as text: "step 3", "steps 2, 5 to 9".
    pub fn steps(&self) -> String {
        let noun = if self.steps.len() == 1 { "step" } else { "steps" };
        let mut ranges: Vec<(usize, usize)> = Vec::new();
        for step in &self.steps {
            match ranges.last_mut() {
                Some((_, last)) if *last + 1 == *step => *last = *step,
                _ => ranges.push((*step, *step)),
            }
        }
        let numbers = ranges.iter().map(|(first, last)| match last - first {
            0 => first.to_string(),
            1 => format!("{first}, {last}"),
            _ => format!("{first} to {last}"),
        });
        format!("{noun} {}", numbers.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_a_range_and_pairs_are_not() {
        let steps_text = |steps: &[usize]| {
            Doubt { steps: steps.to_vec(), code: "", sentence: Sentence(Vec::new()) }.steps()
        };
        assert_eq!(steps_text(&[3]), "step 3");
        assert_eq!(steps_text(&[2, 5, 6, 7, 9, 10]), "steps 2, 5 to 7, 9, 10");
    }
}
