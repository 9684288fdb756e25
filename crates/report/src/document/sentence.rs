//! A sentence whose numbers are values of one point, or ranges over several.

use mapper_core::Channel;
use std::fmt;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sentence(pub(crate) Vec<Part>);

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Part {
    Words(String),
    Number { low: f64, high: f64, decimals: usize, signed: bool },
}

/// Makes a sentence of a text with `{}` for each of the parts behind it.
macro_rules! sentence {
    ($text:expr $(, $part:expr)* $(,)?) => {
        $crate::document::Sentence::new($text, vec![$($part.into()),*])
    };
}
pub(crate) use sentence;

pub(crate) fn number(value: f64, decimals: usize) -> Part {
    Part::Number { low: value, high: value, decimals, signed: false }
}

/// The same, with its sign.
pub(crate) fn signed(value: f64, decimals: usize) -> Part {
    Part::Number { low: value, high: value, decimals, signed: true }
}

impl From<&str> for Part {
    fn from(words: &str) -> Self {
        Part::Words(words.to_owned())
    }
}

impl From<String> for Part {
    fn from(words: String) -> Self {
        Part::Words(words)
    }
}

impl From<Channel> for Part {
    fn from(channel: Channel) -> Self {
        Part::Words(channel.to_string())
    }
}

impl From<usize> for Part {
    fn from(count: usize) -> Self {
        number(count as f64, 0)
    }
}

impl Sentence {
    pub(crate) fn new(text: &str, parts: Vec<Part>) -> Self {
        let mut words = text.split("{}").map(Part::from);
        let mut all: Vec<Part> = words.next().into_iter().collect();
        all.extend(parts.into_iter().zip(words).flat_map(|(part, words)| [part, words]));
        Sentence(all)
    }

    pub(crate) fn then(mut self, other: Sentence) -> Self {
        self.0.extend(other.0);
        self
    }

    /// Widens the numbers to those of another sentence; false, without a change, if anything else differs.
    pub(crate) fn merge(&mut self, other: &Sentence) -> bool {
        let can_merge = |pair: (&Part, &Part)| match pair {
            (Part::Words(a), Part::Words(b)) => a == b,
            (Part::Number { decimals: a, signed: b, .. }, Part::Number { decimals: c, signed: d, .. }) => {
                (a, b) == (c, d)
            }
            _ => false,
        };
        if self.0.len() != other.0.len() || !self.0.iter().zip(&other.0).all(can_merge) {
            return false;
        }
        for (part, other) in self.0.iter_mut().zip(&other.0) {
            if let (Part::Number { low, high, .. }, Part::Number { low: below, high: above, .. }) =
                (part, other)
            {
                (*low, *high) = (low.min(*below), high.max(*above));
            }
        }
        true
    }
}

impl From<String> for Sentence {
    fn from(words: String) -> Self {
        Sentence(vec![Part::Words(words)])
    }
}

impl fmt::Display for Sentence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|part| match part {
            Part::Words(words) => f.write_str(words),
            Part::Number { low, high, decimals, signed } => {
                let text = |value: f64| {
                    if *signed { format!("{value:+.decimals$}") } else { format!("{value:.decimals$}") }
                };
                match (text(*low), text(*high)) {
                    (low, high) if low == high => f.write_str(&low),
                    (low, high) => write!(f, "{low} to {high}"),
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_that_differ_in_numbers_are_one_with_their_range() {
        let moved = |by_k: f64, s: f64| {
            sentence!("{} moves by {} K in {} s", Channel::T2, signed(by_k, 1), number(s, 0))
        };
        let mut merged = moved(-21.4, 3.0);
        assert!(merged.merge(&moved(9.5, 3.4)) && merged.merge(&moved(0.0, 3.0)));
        assert_eq!(merged.to_string(), "T2 moves by -21.4 to +9.5 K in 3 s");
    }

    #[test]
    fn other_words_keep_sentences_apart() {
        let mut of_t2 = sentence!("{} is off by {}", Channel::T2, 2);
        let before = of_t2.clone();
        assert!(!of_t2.merge(&sentence!("{} is off by {}", Channel::T1, 3)));
        assert!(!of_t2.merge(&sentence!("{} is off by {}", Channel::T2, number(3.0, 1))));
        assert_eq!(of_t2, before);
    }
}
