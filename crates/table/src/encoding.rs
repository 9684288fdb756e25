//! Encodings of text files.

use crate::column_name::is_known_word;
use encoding_rs::{
    Decoder, Encoding, GB18030, SHIFT_JIS, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1250, WINDOWS_1251,
    WINDOWS_1252,
};
use std::io::{self, Read};

/// The encoding of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TextEncoding(&'static Encoding);

/// Maximum number of evaluated bytes. Bound: effort.
const MAX_SAMPLE_BYTES: usize = 1 << 16;
/// Maximum number of evaluated lines with letters outside ASCII. Bound: effort; some ten words identify an encoding.
const MAX_LINES: usize = 200;

impl TextEncoding {
    /// UTF-8.
    pub const UTF_8: TextEncoding = TextEncoding(UTF_8);

    /// The encoding of a file that starts with these bytes, and the length of its byte order mark.
    pub fn guess(head: &[u8]) -> (TextEncoding, usize) {
        let marked = Encoding::for_bom(head);
        let (encoding, mark) = marked.unwrap_or_else(|| match std::str::from_utf8(head) {
            _ if looks_like_utf16(head, 1) => (UTF_16LE, 0),
            _ if looks_like_utf16(head, 0) => (UTF_16BE, 0),
            Err(error) if error.error_len().is_some() => (guess_before_utf8(head), 0),
            // UTF-8, possibly truncated in the middle of a character.
            _ => (UTF_8, 0),
        });
        (TextEncoding(encoding), mark)
    }

    /// The encoding of a name such as `latin-1`, `gbk` or `cp1251`.
    pub fn of_name(name: &str) -> Option<TextEncoding> {
        let name = name.to_ascii_lowercase().replace("latin-1", "latin1");
        Encoding::for_label_no_replacement(name.as_bytes()).map(TextEncoding)
    }

    /// Name.
    pub fn name(self) -> &'static str {
        if self.0 == WINDOWS_1252 { "Latin-1" } else { self.0.name() }
    }

    /// Whether the encoding is UTF-8.
    pub fn is_utf8(self) -> bool {
        self.0 == UTF_8
    }

    /// Whether the encoding is a form of UTF-16.
    pub fn is_utf16(self) -> bool {
        [UTF_16LE, UTF_16BE].contains(&self.0)
    }

    /// The text of bytes without a byte order mark.
    pub fn decode(self, bytes: &[u8]) -> String {
        self.0.decode_without_bom_handling(bytes).0.into_owned()
    }

    /// Decodes piece by piece.
    pub fn decoder(self) -> Decoder {
        self.0.new_decoder_without_bom_handling()
    }
}

/// Whether the bytes are UTF-16 without a byte order mark: in most letters only the high byte (at offset `high`) is 0.
fn looks_like_utf16(head: &[u8], high: usize) -> bool {
    let pairs = head.len() / 2;
    let latin = head.chunks_exact(2).filter(|pair| pair[high] == 0 && pair[1 - high] != 0).count();
    pairs >= 8 && latin * 10 >= pairs * 9
}

/// The encoding in which most words outside ASCII are known in names of quantities; Windows-1252, of which Latin-1 is a part, if none is.
fn guess_before_utf8(bytes: &[u8]) -> &'static Encoding {
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
    // Of equal counts, `max_by_key` returns the last.
    let all = [WINDOWS_1250, WINDOWS_1251, SHIFT_JIS, GB18030, WINDOWS_1252];
    all.into_iter().max_by_key(|encoding| known_words(encoding)).unwrap_or(WINDOWS_1252)
}

/// Converts text to UTF-8.
pub struct DecodingReader<R> {
    inner: R,
    decoder: Decoder,
    decoded: io::Cursor<String>,
    is_finished: bool,
}

impl<R: Read> DecodingReader<R> {
    /// The text of a reader of bytes, decoded piece by piece.
    pub fn new(inner: R, decoder: Decoder) -> Self {
        DecodingReader { inner, decoder, decoded: io::Cursor::default(), is_finished: false }
    }
}

impl<R: Read> Read for DecodingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.decoded.read(buffer)?;
            if count > 0 || self.is_finished || buffer.is_empty() {
                return Ok(count);
            }
            let mut block = [0u8; 8192];
            let count = self.inner.read(&mut block)?;
            self.is_finished = count == 0;
            let mut text = String::with_capacity(self.decoder.max_utf8_buffer_length(count).unwrap_or(0));
            let _ = self.decoder.decode_to_string(&block[..count], &mut text, self.is_finished);
            self.decoded = io::Cursor::new(text);
        }
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
            (UTF_8, "time;T2 [°C];p2 [mbar]\n"),
        ] {
            let (bytes, _, _) = encoding.encode(text);
            let (found, mark) = TextEncoding::guess(&bytes);
            assert_eq!((found, mark), (TextEncoding(encoding), 0), "{text}");
            assert_eq!(found.decode(&bytes), text);
        }
        assert_eq!(TextEncoding::guess(b"\xEF\xBB\xBFT2"), (TextEncoding(UTF_8), 3));
        let utf16: Vec<u8> = "time;T2 [°C]".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(TextEncoding::guess(&utf16), (TextEncoding(UTF_16LE), 0));
        assert_eq!(TextEncoding::guess(&utf16[1..]).0, TextEncoding(UTF_16BE));
        assert_eq!(TextEncoding::of_name("gbk").map(TextEncoding::name), Some("GBK"));
        assert_eq!(TextEncoding::of_name("Latin-1").map(TextEncoding::name), Some("Latin-1"));
        assert_eq!(TextEncoding::of_name("morse"), None);
    }

    #[test]
    fn any_encoding_becomes_the_same_text() {
        let text = "T2 [°C];Drehzahl ATL 𝄞\n".repeat(1500);
        let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
        for (bytes, encoding) in [
            (wide(u16::to_le_bytes), encoding_rs::UTF_16LE),
            (wide(u16::to_be_bytes), encoding_rs::UTF_16BE),
            (encoding_rs::GB18030.encode(&text).0.into_owned(), encoding_rs::GB18030),
        ] {
            let mut read = String::new();
            let decoder = encoding.new_decoder_without_bom_handling();
            DecodingReader::new(bytes.as_slice(), decoder).read_to_string(&mut read).unwrap();
            assert!(read == text);
        }
    }
}
