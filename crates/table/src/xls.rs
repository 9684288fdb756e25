//! Reads the sheets of Excel 97 to 2003 workbooks (`.xls`, [MS-XLS]) within limits.
//!
//! `calamine` reads them too, but fills the rectangle around all cells of a sheet (0.4 GB for two cells in opposite corners), follows
//! endless chains of sectors and panics on short records. Here memory is at most six times the size of the file, since a cell has at least six
//! bytes in the file and 32 here.

use std::collections::HashMap;
use std::io::{Read, Seek};
use std::rc::Rc;

/// The first bytes of a compound file, which holds a workbook of Excel 97 to 2003.
pub const XLS_MAGIC: [u8; 8] = *b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1";

/// Maximum size of the stream with the sheets, bytes. Bound: 65 536 rows, the format's maximum, of 50 numbers take 59 MB.
const MAX_STREAM_BYTES: u64 = 64 << 20;

/// Days from the first day of 1900 to that of 1904, from which some programs count. Source: the calendar.
const DAYS_TO_1904: f64 = 1462.0;

/// The content of a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// Days since the end of 1899, as Excel counts; below one a time of day.
    Days(f64),
    /// A text.
    Text(Rc<str>),
}

/// A sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Its name.
    pub name: String,
    /// Whether it is hidden.
    pub is_hidden: bool,
    /// Cells with row and column from 0, by row and then by column.
    pub cells: Vec<(u16, u16, Cell)>,
}

/// The content of the records before the first sheet.
#[derive(Default)]
struct Globals {
    /// Texts have flags since Excel 97.
    has_flags: bool,
    from_1904: bool,
    strings: Vec<Rc<str>>,
    is_date: Vec<bool>,
    /// Position, name and whether it is hidden.
    sheets: Vec<(usize, String, bool)>,
}

/// Reads all sheets with cells.
pub fn read_xls(file: impl Read + Seek) -> Result<Vec<Sheet>, String> {
    let mut file = cfb::CompoundFile::open(file).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    let stream = ["/Workbook", "/Book"].iter().find(|name| file.is_stream(name));
    let stream =
        stream.ok_or("it contains no workbook of Excel 95 to 2003; it may be another Office document")?;
    let stream = file.open_stream(stream).map_err(|error| error.to_string())?;
    stream.take(MAX_STREAM_BYTES + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > MAX_STREAM_BYTES {
        return Err(format!("its sheets take more than {} MiB; save it as .xlsx", MAX_STREAM_BYTES >> 20));
    }
    let globals = globals(&bytes)?;
    // Sheets at the same offset would multiply the time.
    let mut places: Vec<usize> = globals.sheets.iter().map(|(at, ..)| *at).collect();
    places.sort_unstable();
    places.dedup();
    if places.len() < globals.sheets.len() {
        return Err("two of its sheets are at the same offset".to_owned());
    }
    let mut sheets = Vec::new();
    for (at, name, is_hidden) in &globals.sheets {
        // A sheet ends where the next begins: each byte is read once.
        let end = places.iter().find(|place| *place > at).map_or(bytes.len(), |place| *place);
        let cells = cells(bytes.get(*at..end).unwrap_or_default(), &globals);
        sheets.push(Sheet { name: name.clone(), is_hidden: *is_hidden, cells });
    }
    Ok(sheets)
}

fn globals(stream: &[u8]) -> Result<Globals, String> {
    let mut found = Globals::default();
    let mut formats: HashMap<u16, bool> = HashMap::new();
    let mut format_of_cell = Vec::new();
    let mut records = Records(stream).peekable();
    while let Some(record) = records.next() {
        match record.kind {
            BOF => found.has_flags = record.u16(0) != Some(0x0500),
            EOF => break,
            // FilePass, DateMode
            0x002F => return Err("it is encrypted; save it without a password".to_owned()),
            0x0022 => found.from_1904 = record.u16(0) == Some(1),
            // Format, XF
            0x041E => {
                let text = record.data.get(2..).map(|rest| Bytes::new(vec![rest]));
                let code = text
                    .and_then(|mut bytes| bytes.text(if found.has_flags { 2 } else { 1 }, found.has_flags));
                formats.extend(record.u16(0).zip(code.map(|code| is_date_code(&code))));
            }
            0x00E0 => format_of_cell.extend(record.u16(2)),
            // BoundSheet8
            0x0085 => {
                let name = record.data.get(6..).map(|rest| Bytes::new(vec![rest]));
                let name = name.and_then(|mut bytes| bytes.text(1, found.has_flags));
                let place = record.u32(0).and_then(|place| usize::try_from(place).ok());
                // Charts and macros are sheets, too.
                let is_table = record.u8(5) == Some(0);
                if let (Some(place), Some(state), Some(name), true) = (place, record.u8(4), name, is_table) {
                    found.sheets.push((place, name, state & 3 != 0));
                }
            }
            // SST
            0x00FC => {
                let mut pieces = vec![record.data];
                while let Some(next) = records.next_if(|next| next.kind == CONTINUE) {
                    pieces.push(next.data);
                }
                found.strings = shared(pieces);
            }
            _ => {}
        }
    }
    let is_date = |format: &u16| {
        formats.get(format).copied().unwrap_or(matches!(format, 14..=22 | 27..=36 | 45..=47 | 50..=58))
    };
    found.is_date = format_of_cell.iter().map(is_date).collect();
    Ok(found)
}

/// Whether a format's code shows parts of a date or of a time, outside quoted text and conditions in brackets.
fn is_date_code(code: &str) -> bool {
    let (mut quoted, mut bracket) = (false, false);
    let mut letters = code.chars();
    while let Some(letter) = letters.next() {
        match letter {
            '"' => quoted = !quoted,
            '\\' | '_' | '*' if !quoted => _ = letters.next(),
            '[' if !quoted => bracket = true,
            ']' if !quoted => bracket = false,
            'd' | 'D' | 'm' | 'M' | 'y' | 'Y' | 'h' | 'H' | 's' | 'S' if !quoted && !bracket => return true,
            _ => {}
        }
    }
    false
}

/// The cells of a sheet; a record that is too short for its kind holds none.
fn cells(stream: &[u8], globals: &Globals) -> Vec<(u16, u16, Cell)> {
    let mut cells = Vec::new();
    // Charts within a sheet have cells too: only those between the first start and its end belong to the sheet.
    let mut depth = 0usize;
    let mut formula = None;
    for record in Records(stream) {
        match record.kind {
            BOF => depth += 1,
            EOF if depth <= 1 => break,
            EOF => depth -= 1,
            _ if depth != 1 => {}
            // String: the text of the formula before it
            0x0207 => {
                let text = Bytes::new(vec![record.data]).text(2, globals.has_flags);
                if let (Some((row, column)), Some(text)) = (formula, text) {
                    cells.push((row, column, Cell::Text(text.into())));
                }
            }
            // MulRk
            0x00BD => {
                let (Some(row), Some(first)) = (record.u16(0), record.u16(2)) else { continue };
                let packed = record.data.get(4..record.data.len().saturating_sub(2)).unwrap_or_default();
                for (column, piece) in (first..=u16::MAX).zip(packed.as_chunks::<6>().0) {
                    let piece = Record { kind: 0, data: piece };
                    let cell = piece
                        .u16(0)
                        .zip(piece.u32(2))
                        .map(|(format, rk)| number(unpacked(rk), format, globals));
                    cells.extend(cell.map(|cell| (row, column, cell)));
                }
            }
            _ => {
                let (Some(row), Some(column), Some(format)) = (record.u16(0), record.u16(2), record.u16(4))
                else {
                    continue;
                };
                if record.kind == 0x0006 {
                    formula = Some((row, column));
                }
                cells.extend(single(record, format, globals).map(|cell| (row, column, cell)));
            }
        }
    }
    cells.sort_by_key(|(row, column, _)| (*row, *column));
    cells
}

/// The cell in a record that holds one.
fn single(record: Record<'_>, format: u16, globals: &Globals) -> Option<Cell> {
    match record.kind {
        // Number, Rk
        0x0203 => Some(number(record.f64(6)?, format, globals)),
        0x027E => Some(number(unpacked(record.u32(6)?), format, globals)),
        // Formula: its value, unless the last two bytes mark a text, a Boolean, an error or no value
        0x0006 => (record.u16(12)? != 0xFFFF).then_some(number(record.f64(6)?, format, globals)),
        // LabelSst
        0x00FD => globals.strings.get(usize::try_from(record.u32(6)?).ok()?).cloned().map(Cell::Text),
        // Label, RString
        0x0204 | 0x00D6 => {
            Some(Cell::Text(Bytes::new(vec![record.data.get(6..)?]).text(2, globals.has_flags)?.into()))
        }
        _ => None,
    }
}

fn number(value: f64, format: u16, globals: &Globals) -> Cell {
    match globals.is_date.get(usize::from(format)) {
        Some(true) if globals.from_1904 && value >= 1.0 => Cell::Days(value + DAYS_TO_1904),
        Some(true) => Cell::Days(value),
        _ => Cell::Number(value),
    }
}

/// Factor of numbers in four bytes that are stored times it. Source: the format of Excel 97 ([MS-XLS], 2.5.217).
const STORED_FACTOR: f64 = 100.0;

/// A number in four bytes: the upper half of a double or an integer of 30 bits, either of them perhaps times 100.
fn unpacked(rk: u32) -> f64 {
    let value =
        if rk & 2 != 0 { f64::from(rk.cast_signed() >> 2) } else { f64::from_bits(u64::from(rk & !3) << 32) };
    if rk & 1 != 0 { value / STORED_FACTOR } else { value }
}

const EOF: u16 = 0x000A;
const CONTINUE: u16 = 0x003C;
const BOF: u16 = 0x0809;

#[derive(Clone, Copy)]
struct Record<'a> {
    kind: u16,
    data: &'a [u8],
}

impl Record<'_> {
    fn u8(&self, at: usize) -> Option<u8> {
        self.data.get(at).copied()
    }

    fn u16(&self, at: usize) -> Option<u16> {
        Some(u16::from_le_bytes(*self.data.get(at..)?.first_chunk()?))
    }

    fn u32(&self, at: usize) -> Option<u32> {
        Some(u32::from_le_bytes(*self.data.get(at..)?.first_chunk()?))
    }

    fn f64(&self, at: usize) -> Option<f64> {
        Some(f64::from_le_bytes(*self.data.get(at..)?.first_chunk()?))
    }
}

/// The records from the start of a stream; they end at the first incomplete one.
struct Records<'a>(&'a [u8]);

impl<'a> Iterator for Records<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        let head = Record { kind: 0, data: self.0 };
        let (kind, length) = (head.u16(0)?, usize::from(head.u16(2)?));
        let data = self.0.get(4..4 + length)?;
        self.0 = self.0.get(4 + length..)?;
        Some(Record { kind, data })
    }
}

/// Set if characters have two bytes.
const WIDE: u8 = 0x01;
/// Set if a list of fonts follows the characters.
const RICH: u8 = 0x08;
/// Set if phonetic data follow the characters.
const EXTENDED: u8 = 0x04;

struct Bytes<'a> {
    pieces: Vec<&'a [u8]>,
    piece: usize,
    at: usize,
}

impl<'a> Bytes<'a> {
    fn new(pieces: Vec<&'a [u8]>) -> Self {
        Bytes { pieces, piece: 0, at: 0 }
    }

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
    fn text(&mut self, count_bytes: u32, has_flags: bool) -> Option<String> {
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
fn shared(pieces: Vec<&[u8]>) -> Vec<Rc<str>> {
    let mut bytes = Bytes::new(pieces);
    // The number of all references, and the number of texts.
    let Some(count) = bytes.number(4).and_then(|_| bytes.number(4)) else { return Vec::new() };
    (0..count).map_while(|_| bytes.text(2, true).map(Rc::from)).collect()
}
