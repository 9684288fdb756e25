//! Character encodings of a text file.

use mapper_recording::logs::{Encoding, LegacyEncoding};
use std::io::{self, Read};

/// The encoding of a file that starts with these bytes, and the length of its byte order mark.
pub(crate) fn guess(head: &[u8]) -> (Encoding, usize) {
    match head {
        [0xEF, 0xBB, 0xBF, ..] => (Encoding::Utf8, 3),
        [0xFF, 0xFE, ..] => (Encoding::Utf16Le, 2),
        [0xFE, 0xFF, ..] => (Encoding::Utf16Be, 2),
        _ if looks_like_utf16(head, 1) => (Encoding::Utf16Le, 0),
        _ if looks_like_utf16(head, 0) => (Encoding::Utf16Be, 0),
        _ => match std::str::from_utf8(head) {
            Ok(_) => (Encoding::Utf8, 0),
            // Truncated in the middle of a character.
            Err(error) if error.error_len().is_none() => (Encoding::Utf8, 0),
            Err(_) => (Encoding::Legacy(LegacyEncoding::guess(head)), 0),
        },
    }
}

/// Whether the bytes are UTF-16 without a byte order mark: in most letters only the high byte (at offset `high`) is 0.
fn looks_like_utf16(head: &[u8], high: usize) -> bool {
    let pairs = head.len() / 2;
    let latin = head.chunks_exact(2).filter(|pair| pair[high] == 0 && pair[1 - high] != 0).count();
    pairs >= 8 && latin * 10 >= pairs * 9
}

pub(crate) fn text(cell: &[u8], encoding: Encoding) -> String {
    match encoding {
        Encoding::Legacy(encoding) => encoding.decode(cell),
        _ => String::from_utf8_lossy(cell).into_owned(),
    }
}

/// UTF-16 converted to UTF-8; an unpaired surrogate becomes the replacement character.
pub(crate) struct Utf16Reader<R> {
    inner: R,
    big_endian: bool,
    pending: Vec<u8>,
    half: Vec<u8>,
    surrogate: Option<u16>,
}

impl<R: Read> Utf16Reader<R> {
    pub(crate) fn new(inner: R, big_endian: bool) -> Self {
        Utf16Reader { inner, big_endian, pending: Vec::new(), half: Vec::new(), surrogate: None }
    }

    fn fill(&mut self) -> io::Result<()> {
        let mut block = [0u8; 8192];
        let count = self.inner.read(&mut block)?;
        self.half.extend_from_slice(block.get(..count).unwrap_or_default());
        let whole = self.half.len() / 2 * 2;
        let units: Vec<u16> = self
            .surrogate
            .take()
            .into_iter()
            .chain(self.half[..whole].chunks_exact(2).map(|pair| {
                let pair = [pair[0], pair[1]];
                if self.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
            }))
            .collect();
        self.half.drain(..whole);
        // A high surrogate waits for its low surrogate, unless the input has ended.
        let waits = count > 0 && units.last().is_some_and(|unit| (0xD800..0xDC00).contains(unit));
        self.surrogate = units.last().copied().filter(|_| waits);
        let ready = units.len() - usize::from(waits);
        let letters = char::decode_utf16(units[..ready].iter().copied());
        let text: String = letters.map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        self.pending = text.into_bytes();
        if count > 0 && self.pending.is_empty() {
            return self.fill();
        }
        Ok(())
    }
}

impl<R: Read> Read for Utf16Reader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.pending.is_empty() {
            self.fill()?;
        }
        let count = self.pending.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(self.pending.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf_16_becomes_the_same_text() {
        let text = "T2 [°C];Drehzahl ATL 𝄞\n".repeat(1500);
        for big_endian in [false, true] {
            let bytes: Vec<u8> = text
                .encode_utf16()
                .flat_map(|unit| if big_endian { unit.to_be_bytes() } else { unit.to_le_bytes() })
                .collect();
            let mut read = String::new();
            Utf16Reader::new(bytes.as_slice(), big_endian).read_to_string(&mut read).unwrap();
            assert!(read == text);
        }
    }

    #[test]
    fn the_degree_sign_of_latin_1_is_not_utf_8() {
        let (latin1, _) = guess(b"T2 [\xB0C]");
        assert_eq!(text(b"T2 [\xB0C]", latin1), "T2 [°C]");
        assert_eq!(guess("T2 [°C]".as_bytes()).0, Encoding::Utf8);
        assert_eq!(guess(b"\xEF\xBB\xBFT2"), (Encoding::Utf8, 3));
        let utf16: Vec<u8> = "time;T2 [°C]".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(guess(&utf16), (Encoding::Utf16Le, 0));
        assert_eq!(guess(&utf16[1..]).0, Encoding::Utf16Be);
    }
}
