//! Cuts a name into words, letters and numbers.

use super::measured::Measured;
use super::words::{Word, meanings};

/// A part of a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Token {
    Word(&'static [Word]),
    Letter(char),
    Number(u32),
    Unknown,
}

impl Token {
    pub(super) fn is(self, word: Word) -> bool {
        matches!(self, Token::Word(words) if words.contains(&word))
    }

    pub(super) fn is_machine(self) -> bool {
        self.is(Word::Compressor) || self.is(Word::Turbine)
    }

    pub(super) fn measured(self) -> Option<Measured> {
        let Token::Word(words) = self else { return None };
        words.iter().find_map(|word| if let Word::Is(measured) = word { Some(*measured) } else { None })
    }

    /// The quantity of a letter at the start of a name.
    pub(super) fn letter(self) -> Option<Measured> {
        match self {
            Token::Letter('t') => Some(Measured::Temperature),
            Token::Letter('p') => Some(Measured::Pressure),
            Token::Letter('n') => Some(Measured::Speed),
            Token::Letter('m' | 'w') => Some(Measured::Flow),
            Token::Letter('v' | 'q') => Some(Measured::VolumeFlow),
            _ => None,
        }
    }
}

pub(super) fn parts_of(name: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    for part in normalise(name).split('_').filter(|part| !part.is_empty()) {
        push_part(&mut tokens, part);
    }
    tokens
}

/// The name in lower case, umlauts spelled out, without accents, with `_` for everything but letters and digits and between the words of
/// `compInletTemp`.
fn normalise(text: &str) -> String {
    let mut normalised = String::new();
    let mut letters = text.chars().peekable();
    let mut was_small = false;
    while let Some(letter) = letters.next() {
        if was_small && letter.is_uppercase() && letters.peek().is_some_and(|next| next.is_lowercase()) {
            normalised.push('_');
        }
        was_small = letter.is_lowercase();
        for letter in letter.to_lowercase() {
            match letter {
                'ä' | 'æ' => normalised.push_str("ae"),
                'ö' | 'ø' => normalised.push_str("oe"),
                'ü' => normalised.push_str("ue"),
                'ß' => normalised.push_str("ss"),
                'à' | 'á' | 'â' | 'ã' | 'å' | 'ą' => normalised.push('a'),
                'è' | 'é' | 'ê' | 'ę' | 'ě' => normalised.push('e'),
                'ì' | 'í' | 'î' => normalised.push('i'),
                'ò' | 'ó' | 'ô' | 'õ' => normalised.push('o'),
                'ù' | 'ú' | 'û' | 'ů' => normalised.push('u'),
                'ç' | 'ć' | 'č' => normalised.push('c'),
                'ñ' | 'ń' => normalised.push('n'),
                'ś' | 'š' => normalised.push('s'),
                'ż' | 'ź' | 'ž' => normalised.push('z'),
                'ł' => normalised.push('l'),
                'ё' => normalised.push('е'),
                letter if letter.is_alphanumeric() => normalised.push(letter),
                _ if normalised.ends_with('_') => {}
                _ => normalised.push('_'),
            }
        }
    }
    // German compounds: `Eintrittsdruck`.
    normalised.replace("eintritts", "eintritt_").replace("austritts", "austritt_")
}

/// Whether a script has words without blanks between them.
fn is_unspaced(letter: char) -> bool {
    matches!(letter, '\u{3040}'..='\u{30ff}' | '\u{4e00}'..='\u{9fff}')
}

/// Maximum length of a compound, bytes: twice that of the longest German words. It limits the time for any name.
const MAX_WORD_BYTES: usize = 64;

/// Adds the letters and numbers of a part between blanks.
fn push_part(tokens: &mut Vec<Token>, part: &str) {
    let class = |c: char| (c.is_ascii_digit(), is_unspaced(c));
    let mut rest = part;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| class(c) != class(first)).unwrap_or(rest.len());
        let (piece, tail) = rest.split_at(end);
        rest = tail;
        if first.is_ascii_digit() {
            tokens.push(piece.parse().map_or(Token::Unknown, Token::Number));
        } else if let Some(words) = meanings(piece) {
            tokens.push(Token::Word(words));
        } else if piece.len() == 1 || ["vv", "nv", "vt", "nt"].contains(&piece) {
            tokens.extend(piece.chars().map(Token::Letter));
        } else if piece.len() > MAX_WORD_BYTES {
            tokens.push(Token::Unknown);
        } else if let Some(parts) = compound(piece) {
            tokens.extend(parts);
        } else {
            push_known_stems(tokens, piece);
        }
    }
}

/// Short words that count at the start or end of a compound: `prcomp`, `etats`, `tcompin`, `ntc`.
const SHORT_STARTS: [&str; 5] = ["pr", "pi", "nc", "mc", "wc"];
const SHORT_ENDS: [&str; 5] = ["in", "ts", "tt", "tc", "tl"];

/// The parts of a compound, if all are known: `luftmassenstrom`, `tcompin`, `mdotc`.
fn compound(text: &str) -> Option<Vec<Token>> {
    const LINK: &[Word] = &[Word::Filler];
    let places: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
    // The first part of the rest of the text, from each place.
    let mut known: Vec<Option<(usize, Token)>> = vec![None; text.len() + 1];
    for (index, &start) in places.iter().enumerate().rev() {
        for &end in places[index + 1..].iter().rev() {
            let (is_start, is_end) = (start == 0, end == text.len());
            if !is_end && known[end].is_none() {
                continue;
            }
            let piece = &text[start..end];
            let letter =
                piece.chars().next().filter(|first| piece.len() == first.len_utf8() && first.is_ascii());
            let before_side =
                !is_end && known[end].is_some_and(|(_, next)| next.is(Word::In) || next.is(Word::Out));
            let token = match letter {
                Some(letter @ ('t' | 'p' | 'n' | 'm' | 'w' | 'v')) if is_start => Some(Token::Letter(letter)),
                Some(letter @ ('c' | 't')) if is_end || before_side => Some(Token::Letter(letter)),
                Some('s' | 'n') if !is_start && !is_end => Some(Token::Word(LINK)),
                Some(_) => None,
                None if piece == "is" && is_end => Some(Token::Word(LINK)),
                None if piece.len() > 2
                    || is_start && SHORT_STARTS.contains(&piece)
                    || is_end && SHORT_ENDS.contains(&piece) =>
                {
                    meanings(piece).map(Token::Word)
                }
                None => None,
            };
            if let Some(token) = token {
                known[start] = Some((end, token));
                break;
            }
        }
    }
    let (mut parts, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let (end, token) = known[at]?;
        parts.push(token);
        at = end;
    }
    Some(parts)
}

/// Adds the known words of at least four letters within an unknown word, such as inflected forms and compounds.
fn push_known_stems(tokens: &mut Vec<Token>, text: &str) {
    let places: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
    let (mut index, mut is_known) = (0, true);
    while index + 1 < places.len() {
        // An ending: `давление`, `pressures`.
        if index > 0 && is_known && places.len() - 1 - index <= 3 {
            return;
        }
        let start = places[index];
        let is_word = |end: &usize| {
            let piece = &text[start..places[*end]];
            (piece.starts_with(is_unspaced) || *end - index >= 4) && meanings(piece).is_some()
        };
        match (index + 1..places.len()).rev().find(is_word) {
            Some(end) => {
                tokens.extend(meanings(&text[start..places[end]]).map(Token::Word));
                index = end;
            }
            None => (index, is_known) = (index + 1, false),
        }
    }
    if !is_known {
        tokens.push(Token::Unknown);
    }
}
