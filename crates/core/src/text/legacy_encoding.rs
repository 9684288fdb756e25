//! Text in the encodings of programs before UTF-8.

use crate::names::column_name::is_known_word;
use encoding_rs::{Encoding, GB18030, SHIFT_JIS, WINDOWS_1250, WINDOWS_1251, WINDOWS_1252};

/// An encoding other than UTF-8 and UTF-16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LegacyEncoding(&'static Encoding);

/// Bytes that are evaluated, and lines among them that have letters outside ASCII.
const MAX_SAMPLE_BYTES: usize = 1 << 16;
const MAX_LINES: usize = 200;

impl LegacyEncoding {
    /// The encoding in which most words outside ASCII are known in names of quantities; Windows-1252, of which Latin 1 is a part, if none
    /// is.
    pub fn guess(bytes: &[u8]) -> LegacyEncoding {
        let sample = bytes.get(..MAX_SAMPLE_BYTES).unwrap_or(bytes);
        let lines = sample.split(|byte| *byte == b'\n').filter(|line| !line.is_ascii()).take(MAX_LINES);
        let lines: Vec<&[u8]> = lines.collect();
        let known_words = |encoding: &'static Encoding| {
            let count = |line: &&[u8]| {
                let (text, _) = encoding.decode_without_bom_handling(line);
                let words = text.split(|c: char| !c.is_alphabetic());
                words.filter(|word| !word.is_ascii() && is_known_word(word)).count()
            };
            lines.iter().map(count).sum::<usize>()
        };
        let usual = known_words(WINDOWS_1252);
        let others = [GB18030, SHIFT_JIS, WINDOWS_1251, WINDOWS_1250];
        let best =
            others.into_iter().map(|other| (known_words(other), other)).max_by_key(|(count, _)| *count);
        LegacyEncoding(best.filter(|(count, _)| *count > usual).map_or(WINDOWS_1252, |(_, other)| other))
    }

    /// The encoding of a name such as `latin-1`, `gbk` or `cp1251`.
    pub fn of_name(name: &str) -> Option<LegacyEncoding> {
        let name = name.to_ascii_lowercase();
        let name = if name == "latin-1" { "latin1" } else { name.as_str() };
        Encoding::for_label(name.as_bytes()).filter(|found| found.is_ascii_compatible()).map(LegacyEncoding)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        if self.0 == WINDOWS_1252 { "Latin-1" } else { self.0.name() }
    }

    /// Its text.
    pub fn decode(self, bytes: &[u8]) -> String {
        self.0.decode_without_bom_handling(bytes).0.into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_quantities_show_the_encoding() {
        for (encoding, text) in [
            (GB18030, "时间,转速(r/min),流量(kg/s)\n1,60000,0.05\n"),
            (WINDOWS_1251, "Время;Давление;Температура\n1;100;20\n"),
            (SHIFT_JIS, "時間,回転数,圧力比\n"),
            (WINDOWS_1252, "Zeit;Öltemperatur [°C];Massenstrom\n1;90;2\n"),
            (WINDOWS_1252, "time;T2 [°C];p2 [mbar]\n"),
        ] {
            let (bytes, _, _) = encoding.encode(text);
            let found = LegacyEncoding::guess(&bytes);
            assert_eq!(found, LegacyEncoding(encoding), "{text}");
            assert_eq!(found.decode(&bytes), text);
        }
        assert_eq!(LegacyEncoding::of_name("gbk").map(LegacyEncoding::name), Some("GBK"));
        assert_eq!(LegacyEncoding::of_name("latin-1").map(LegacyEncoding::name), Some("Latin-1"));
        assert_eq!(LegacyEncoding::of_name("utf-16le"), None);
    }
}
