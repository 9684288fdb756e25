//! Cuts a name into words, letters and numbers, or into the tag number of a piping diagram (ISA 5.1): `TT-101`, `PT_2101`, `FT-3`.

use crate::words::{Measured, Word, meanings};

/// A part of a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Token {
    Word(&'static [Word]),
    Letter(char),
    Number(u32),
    Unknown,
}

impl Token {
    pub(crate) fn is(self, word: Word) -> bool {
        matches!(self, Token::Word(words) if words.contains(&word))
    }

    pub(crate) fn is_machine(self) -> bool {
        self.is(Word::Compressor) || self.is(Word::Turbine)
    }

    pub(crate) fn measured(self) -> Option<Measured> {
        let Token::Word(words) = self else { return None };
        words.iter().find_map(|word| if let Word::Is(measured) = word { Some(*measured) } else { None })
    }

    /// The quantity of a letter at the start of a name.
    pub(crate) fn letter(self) -> Option<Measured> {
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

pub(crate) fn parts_of(name: &str) -> Vec<Token> {
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

/// Maximum length of a compound, bytes. Bound: twice that of the longest German words. It limits the time for any name.
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
const SHORT_STARTS: [&str; 6] = ["pr", "pi", "nc", "mc", "wc", "mf"];
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

/// Tags with another meaning if their number is short: `PT2` is the total pressure at station 2, `TIT 1` a turbine inlet temperature.
const LONG_NUMBERS: [&str; 6] = ["tt", "pt", "pi", "pit", "tit", "st"];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tag {
    pub(crate) measured: Measured,
    /// The number of its loop.
    pub(crate) number: u32,
}

/// The tag number at the start of a name, and the rest of the name.
pub(crate) fn split_tag(name: &str) -> Option<(Tag, &str)> {
    let letters = name.find(|c: char| !c.is_ascii_alphabetic())?;
    let (code, rest) = name.split_at(letters);
    let code = code.to_ascii_lowercase();
    let mut functions = code.chars();
    // `PT100` is a resistance thermometer, `PT-100` a tag.
    let is_thermometer = code == "pt" && ["100", "500", "1000"].iter().any(|ohms| rest.starts_with(ohms));
    let measured = match functions.next()? {
        'p' if is_thermometer => Measured::Temperature,
        't' => Measured::Temperature,
        'p' => Measured::Pressure,
        'f' => Measured::Flow,
        's' => Measured::Speed,
        _ => return None,
    };
    // Transmitter, element, indicator, recorder; `D` is a difference, `V` a valve.
    if !(1..=2).contains(&functions.as_str().len()) || !functions.all(|letter| "teir".contains(letter)) {
        return None;
    }
    let number = rest.trim_start_matches(['-', '_', ' ', '.']);
    let digits = number.find(|c: char| !c.is_ascii_digit()).unwrap_or(number.len());
    let suffix = number[digits..].trim_start_matches(|c: char| c.is_ascii_uppercase());
    let ends = suffix.is_empty() || suffix.starts_with(|c: char| !c.is_alphanumeric());
    let least = if LONG_NUMBERS.contains(&code.as_str()) { 3 } else { 1 };
    let loop_number = number[..digits].parse().ok()?;
    (ends && (least..=5).contains(&digits)).then_some((Tag { measured, number: loop_number }, suffix))
}
