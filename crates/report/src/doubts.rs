//! Doubts and remarks about points, each sentence once.

use mapper_core::IdentifiedPoint;

/// A sentence, and the steps that it is about.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt<'a> {
    /// Steps, from 1, in order.
    steps: Vec<usize>,
    /// What kind of doubt it is.
    pub code: &'a str,
    /// The sentence.
    pub message: &'a str,
}

/// What is said of the points, in order of the first step of each.
pub fn doubts<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<Doubt<'a>> {
    let mut doubts: Vec<Doubt<'a>> = Vec::new();
    for point in points {
        let step = point.step + 1;
        for warning in &point.warnings {
            let (code, message) = (warning.code.as_ref(), warning.message.as_str());
            match doubts.iter_mut().find(|doubt| doubt.code == code && doubt.message == message) {
                Some(known) => known.steps.push(step),
                None => doubts.push(Doubt { steps: vec![step], code, message }),
            }
        }
    }
    doubts
}

impl Doubt<'_> {
    /// How many steps it is about.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The steps in words: "step 3", "steps 2, 5 to 9".
    pub fn steps(&self) -> String {
        let one = if self.steps.len() == 1 { "step" } else { "steps" };
        let mut ranges: Vec<(usize, usize)> = Vec::new();
        for step in &self.steps {
            match ranges.last_mut() {
                Some((_, last)) if *last + 1 == *step => *last = *step,
                _ => ranges.push((*step, *step)),
            }
        }
        let words = ranges.iter().map(|(first, last)| match last - first {
            0 => first.to_string(),
            1 => format!("{first}, {last}"),
            _ => format!("{first} to {last}"),
        });
        format!("{one} {}", words.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_a_range_and_pairs_are_not() {
        let of = |steps: &[usize]| Doubt { steps: steps.to_vec(), code: "", message: "" }.steps();
        assert_eq!(of(&[3]), "step 3");
        assert_eq!(of(&[2, 5, 6, 7, 9, 10]), "steps 2, 5 to 7, 9, 10");
    }
}
