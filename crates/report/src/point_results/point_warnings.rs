//! Warnings and remarks about points, each sentence once.

use mapper_core::{IdentifiedPoint, step_number};

/// A sentence, and the steps that it applies to.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt<'a> {
    /// Steps, from 1, in order.
    steps: Vec<usize>,
    /// Its kind.
    pub code: &'a str,
    /// The sentence; a number that differs between steps is shown as a range.
    pub message: String,
}

/// All remarks on the points, in order of the first step of each. Sentences that differ only in their numbers are merged into one, with
/// the range of each number. The exact sentence of a step is shown with its point.
pub fn doubts<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<Doubt<'a>> {
    let mut merged: Vec<DoubtText<'a>> = Vec::new();
    for point in points {
        let step = step_number(point.step);
        for warning in &point.warnings {
            let (code, pieces) = (warning.code.as_ref(), pieces(&warning.message));
            match merged.iter_mut().find(|known| known.code == code && are_alike(&known.pieces, &pieces)) {
                Some(known) => known.add(step, &pieces),
                None => merged.push(DoubtText { steps: vec![step], code, pieces }),
            }
        }
    }
    merged.into_iter().map(DoubtText::doubt).collect()
}

/// A sentence in pieces, and the steps that it applies to.
struct DoubtText<'a> {
    steps: Vec<usize>,
    code: &'a str,
    pieces: Vec<Piece<'a>>,
}

/// A piece of a sentence.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Piece<'a> {
    Words(&'a str),
    /// A number as written, smallest and largest so far.
    Number(&'a str, &'a str),
}

impl<'a> DoubtText<'a> {
    fn add(&mut self, step: usize, pieces: &[Piece<'a>]) {
        if self.steps.last() != Some(&step) {
            self.steps.push(step);
        }
        for (known, new) in self.pieces.iter_mut().zip(pieces) {
            let (Piece::Number(low, high), Piece::Number(this, _)) = (known, new) else { continue };
            if value(this) < value(low) {
                *low = this;
            }
            if value(this) > value(high) {
                *high = this;
            }
        }
    }

    fn doubt(self) -> Doubt<'a> {
        let word = |piece: &Piece<'_>| match piece {
            Piece::Words(words) => (*words).to_owned(),
            Piece::Number(low, high) if value(low) == value(high) => (*low).to_owned(),
            Piece::Number(low, high) => format!("{low} to {high}"),
        };
        Doubt { message: self.pieces.iter().map(word).collect(), steps: self.steps, code: self.code }
    }
}

fn value(number: &str) -> f64 {
    number.parse().unwrap_or(f64::NAN)
}

/// Whether two sentences differ only in their numbers.
fn are_alike(a: &[Piece<'_>], b: &[Piece<'_>]) -> bool {
    a.len() == b.len()
        && a.iter().zip(b).all(|(a, b)| match (a, b) {
            (Piece::Words(a), Piece::Words(b)) => a == b,
            (Piece::Number(..), Piece::Number(..)) => true,
            _ => false,
        })
}

/// Words and numbers in alternation. A digit after a letter belongs to a name (`T2`), and so does a number that touches a letter (`95krpm`).
fn pieces(sentence: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let (mut words, mut at) = (0, 0);
    while at < sentence.len() {
        let rest = &sentence[at..];
        let stands_free = !sentence[..at].ends_with(|c: char| c.is_alphanumeric() || "_.@-+".contains(c));
        let length = if stands_free { number_length(rest) } else { 0 };
        if length == 0 {
            at += rest.chars().next().map_or(1, char::len_utf8);
            continue;
        }
        if words < at {
            pieces.push(Piece::Words(&sentence[words..at]));
        }
        pieces.push(Piece::Number(&rest[..length], &rest[..length]));
        at += length;
        words = at;
    }
    if words < sentence.len() {
        pieces.push(Piece::Words(&sentence[words..]));
    }
    pieces
}

/// Length in bytes of the decimal number at the start of a text; 0 if there is none.
fn number_length(text: &str) -> usize {
    let sign = usize::from(text.starts_with(['+', '-']));
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let whole = digits(sign);
    if whole == 0 {
        return 0;
    }
    let mut length = sign + whole;
    if text[length..].starts_with('.') && digits(length + 1) > 0 {
        length += 1 + digits(length + 1);
    }
    let touches = text[length..].starts_with(|c: char| c.is_alphanumeric() || "_@".contains(c));
    if touches { 0 } else { length }
}

impl Doubt<'_> {
    /// Number of steps that it applies to.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The steps as text: "step 3", "steps 2, 5 to 9".
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
        let of = |steps: &[usize]| Doubt { steps: steps.to_vec(), code: "", message: String::new() }.steps();
        assert_eq!(of(&[3]), "step 3");
        assert_eq!(of(&[2, 5, 6, 7, 9, 10]), "steps 2, 5 to 7, 9, 10");
    }

    /// The merged sentence of all steps.
    fn merged(sentences: &[&'static str]) -> Vec<String> {
        let mut merged: Vec<DoubtText<'_>> = Vec::new();
        for (step, sentence) in sentences.iter().enumerate() {
            let pieces = pieces(sentence);
            match merged.iter_mut().find(|known| are_alike(&known.pieces, &pieces)) {
                Some(known) => known.add(step, &pieces),
                None => merged.push(DoubtText { steps: vec![step], code: "", pieces }),
            }
        }
        merged.into_iter().map(|merged| merged.doubt().message).collect()
    }

    #[test]
    fn sentences_that_differ_in_numbers_are_one_with_their_range() {
        let moved = ["T2 moves by -21.4 K, 95 % of it in 3 s", "T2 moves by +9.5 K, 95 % of it in 12 s"];
        assert_eq!(merged(&moved), ["T2 moves by -21.4 to +9.5 K, 95 % of it in 3 to 12 s"]);
        assert_eq!(merged(&["flow is 1.5.", "flow is 2."]), ["flow is 1.5 to 2."]);
    }

    /// Names are not numbers: T2 is not T1, and 95krpm@1 is one place.
    #[test]
    fn names_keep_sentences_apart() {
        for pair in [["T1 is off", "T2 is off"], ["at 95krpm@1", "at 50krpm@1"], ["by µ 2K", "by µ 3K"]] {
            assert_eq!(merged(&pair), pair);
        }
    }
}
