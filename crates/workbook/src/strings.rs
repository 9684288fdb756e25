//! Texts: a count of characters, a byte of flags, and characters of one or two bytes, which may continue in the next record.

use std::rc::Rc;

/// Set if characters have two bytes.
const WIDE: u8 = 0x01;
/// Set if a list of fonts follows the characters.
const RICH: u8 = 0x08;
/// Set if phonetic data follow the characters.
const EXTENDED: u8 = 0x04;

/// Bytes in one record and those that continue it.
pub(crate) struct Bytes<'a> {
    pieces: Vec<&'a [u8]>,
    piece: usize,
    at: usize,
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(pieces: Vec<&'a [u8]>) -> Self {
        Bytes { pieces, piece: 0, at: 0 }
    }

    /// Whether the current record is at its end.
    fn at_end_of_piece(&self) -> bool {
        self.pieces.get(self.piece).is_none_or(|piece| self.at >= piece.len())
    }

    fn byte(&mut self) -> Option<u8> {
        while self.at_end_of_piece() {
            self.piece += 1;
            self.at = 0;
            self.pieces.get(self.piece)?;
        }
        self.at += 1;
        self.pieces.get(self.piece)?.get(self.at - 1).copied()
    }

    fn number(&mut self, bytes: u32) -> Option<u32> {
        (0..bytes).try_fold(0, |sum, place| Some(sum | u32::from(self.byte()?) << (8 * place)))
    }

    /// Characters; a record that continues them begins with flags of its own.
    fn characters(&mut self, count: u32, mut flags: u8) -> Option<String> {
        let mut units = Vec::new();
        for index in 0..count {
            if index > 0 && self.at_end_of_piece() {
                flags = self.byte()?;
            }
            let unit = self.number(if flags & WIDE != 0 { 2 } else { 1 })?;
            units.push(u16::try_from(unit).ok()?);
        }
        Some(String::from_utf16_lossy(&units))
    }

    /// A text whose count of characters has `count_bytes`. Before Excel 97 it has no flags, and characters of one byte.
    pub(crate) fn text(&mut self, count_bytes: u32, has_flags: bool) -> Option<String> {
        let count = self.number(count_bytes)?;
        let flags = if has_flags { self.byte()? } else { 0 };
        let fonts = if flags & RICH != 0 { self.number(2)? } else { 0 };
        let phonetic = if flags & EXTENDED != 0 { self.number(4)? } else { 0 };
        let text = self.characters(count, flags)?;
        for _ in 0..4 * u64::from(fonts) + u64::from(phonetic) {
            self.byte()?;
        }
        Some(text)
    }
}

/// The texts that cells refer to, up to the first incomplete one.
pub(crate) fn shared(pieces: Vec<&[u8]>) -> Vec<Rc<str>> {
    let mut bytes = Bytes::new(pieces);
    // The number of all references, and the number of texts.
    let Some(count) = bytes.number(4).and_then(|_| bytes.number(4)) else { return Vec::new() };
    (0..count).map_while(|_| bytes.text(2, true).map(Rc::from)).collect()
}
