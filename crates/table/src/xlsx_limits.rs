//! Checks a workbook of Excel 2007 and later before `calamine` reads it, since the library unpacks it without limits.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::cell::Cell;
use std::io::{self, BufReader, Read, Seek};
use std::rc::Rc;

/// Maximum unpacked size of a part that is not listed here, bytes. Bound: memory; a million cells have some 40 MB.
const MAX_PART_BYTES: u64 = 128 << 20;

/// Maximum unpacked size of the part with cell formats, bytes. Bound: each format copies its strings.
const MAX_STYLES_BYTES: u64 = 8 << 20;

/// Maximum number of parts. Bound: memory; a workbook has some ten for each sheet.
const MAX_PARTS: usize = 10_000;

/// Maximum length of a tag, of a piece between two tags and of a cell, bytes. Bound: Excel's own limit of a cell is 32 767 characters.
const MAX_PIECE_BYTES: u64 = 1 << 20;

/// Maximum length of a tag among the formats of cells, bytes. Bound: Excel's own limit of a number format is 255 characters.
const MAX_STYLE_PIECE_BYTES: u64 = 1 << 12;

/// Maximum nesting of elements. Bound: a cell of rich text has ten levels.
const MAX_DEPTH: usize = 64;

/// Rows of a sheet. Source: Excel's own limit.
const MAX_ROWS: u32 = 1 << 20;

/// Minimum size of a shared string in bytes. Source: `<si/>`.
const SHARED_STRING_BYTES: u64 = 5;

/// Memory of a shared string next to its text, bytes. Bound: 24 for its place in a list that grows by doubling, 16 at least for the text.
const STRING_MEMORY_BYTES: u64 = 64;

/// Memory of a format, a name or a relation, bytes. Bound: two strings in a table that grows by doubling. Formats take 150, names 110.
const ENTRY_MEMORY_BYTES: u64 = 256;

/// What a workbook may unpack to, bytes.
#[derive(Debug, Clone, Copy)]
pub struct XlsxLimits {
    /// All parts together.
    pub unpacked_bytes: u64,
    /// What the library keeps in memory: texts, formats, names and relations.
    pub memory_bytes: u64,
}

/// Kinds of parts that are checked: calamine limits none of them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Sheet,
    SharedStrings,
    Styles,
    /// Names and relations.
    Entries,
    Other,
}

impl Kind {
    fn of(name: &str) -> Kind {
        let name = name.to_ascii_lowercase().replace('\\', "/");
        match name {
            name if name.ends_with("sharedstrings.xml") => Kind::SharedStrings,
            name if name.ends_with("styles.xml") => Kind::Styles,
            name if name.starts_with("xl/worksheets/") && name.ends_with(".xml") => Kind::Sheet,
            name if name.ends_with("workbook.xml") || name.ends_with(".rels") => Kind::Entries,
            _ => Kind::Other,
        }
    }

    fn limit(self) -> u64 {
        match self {
            Kind::Sheet => u64::MAX,
            Kind::Styles => MAX_STYLES_BYTES,
            Kind::SharedStrings | Kind::Entries | Kind::Other => MAX_PART_BYTES,
        }
    }

    fn memory_bytes(self, name: &str) -> u64 {
        match self {
            Kind::SharedStrings if name == "si" => STRING_MEMORY_BYTES,
            Kind::Styles | Kind::Entries => ENTRY_MEMORY_BYTES,
            Kind::Sheet | Kind::SharedStrings | Kind::Other => 0,
        }
    }
}

/// Refuses a workbook that would exceed these limits when unpacked.
pub fn check_xlsx(file: impl Read + Seek, limits: XlsxLimits) -> Result<(), String> {
    let wrong = |error: zip::result::ZipError| error.to_string();
    let mut archive = zip::ZipArchive::new(file).map_err(wrong)?;
    if archive.len() > MAX_PARTS {
        return Err(format!("it has {} parts; at most {MAX_PARTS} are read", archive.len()));
    }
    if archive.has_overlapping_files().map_err(wrong)? {
        return Err("its parts overlap: the same bytes are unpacked several times".to_owned());
    }
    let mut left = limits.unpacked_bytes;
    let memory = Rc::new(Cell::new(limits.memory_bytes));
    for index in 0..archive.len() {
        let part = archive.by_index(index).map_err(wrong)?;
        let name = part.name().map_err(wrong)?.into_owned();
        let kind = Kind::of(&name);
        let read = check_part(part, kind, left, &memory).map_err(|why| format!("{name} {why}"))?;
        if read > kind.limit() {
            return Err(format!("{name} unpacks to more than {} MiB", kind.limit() >> 20));
        }
        left = left.checked_sub(read).ok_or_else(|| {
            format!("its parts unpack to more than the {} MiB that are read", limits.unpacked_bytes >> 20)
        })?;
    }
    Ok(())
}

/// The unpacked size of a part in bytes, one more than its limit if it is larger; or its error.
fn check_part(part: impl Read, kind: Kind, left: u64, memory: &Rc<Cell<u64>>) -> Result<u64, String> {
    let limit = kind.limit().min(left);
    let read = Rc::new(Cell::new(0));
    let piece = Rc::new(Cell::new(0));
    let mut counted =
        LimitedReader { inner: part.take(limit.saturating_add(1)), read: read.clone(), piece: piece.clone() };
    if kind == Kind::Other {
        io::copy(&mut counted, &mut io::sink()).map_err(|error| error.to_string())?;
    } else {
        // Bytes that the buffer read ahead do not belong to a piece.
        let buffer = 1 << 13;
        let pieces =
            PieceChecker { kind, read: read.clone(), piece, buffer: buffer as u64, memory: memory.clone() };
        let found = pieces.check(Reader::from_reader(BufReader::with_capacity(buffer, counted)));
        if read.get() <= limit {
            found?;
        }
    }
    Ok(read.get())
}

/// Counts bytes, and stops reading if one piece is too long.
struct LimitedReader<R> {
    inner: R,
    read: Rc<Cell<u64>>,
    /// Maximum end of the current piece, bytes from the start; 0 for no limit.
    piece: Rc<Cell<u64>>,
}

impl<R: Read> Read for LimitedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.piece.get() > 0 && self.read.get() > self.piece.get() {
            return Err(io::Error::other("has a cell, a text or a tag that is too long"));
        }
        let count = self.inner.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

struct PieceChecker {
    kind: Kind,
    read: Rc<Cell<u64>>,
    piece: Rc<Cell<u64>>,
    buffer: u64,
    memory: Rc<Cell<u64>>,
}

impl PieceChecker {
    fn check<R: io::BufRead>(&self, mut xml: Reader<R>) -> Result<(), String> {
        let piece_limit = match self.kind {
            Kind::Sheet => MAX_PIECE_BYTES,
            Kind::Styles => MAX_STYLE_PIECE_BYTES,
            Kind::Entries => MAX_PIECE_BYTES,
            // Shared strings are truncated where they are used.
            Kind::SharedStrings | Kind::Other => MAX_PART_BYTES,
        };
        let (mut buffer, mut depth) = (Vec::new(), 0usize);
        // Depth of the current cell: texts of several pieces are joined there.
        let mut cell: Option<usize> = None;
        let (mut strings, mut rows) = (0, 0);
        loop {
            buffer.clear();
            if cell.is_none() {
                self.piece.set(self.read.get() + self.buffer + piece_limit);
            }
            let event = xml.read_event_into(&mut buffer).map_err(|error| match error {
                quick_xml::Error::Io(error) => error.to_string(),
                error => format!("is not XML: {error}"),
            })?;
            let memory_bytes = match &event {
                Event::Start(tag) | Event::Empty(tag) => {
                    rows += u32::from(self.kind == Kind::Sheet && tag.local_name().as_ref() == "row");
                    self.kind.memory_bytes(tag.local_name().as_ref())
                }
                Event::Text(text) if self.kind == Kind::SharedStrings => text.len() as u64,
                _ => 0,
            };
            let left = self.memory.get().checked_sub(memory_bytes);
            self.memory.set(left.ok_or("has more texts, formats or names than a file of this size may")?);
            if rows > MAX_ROWS {
                return Err(format!("has more than the {MAX_ROWS} rows of Excel"));
            }
            match event {
                Event::Start(tag) => {
                    depth += 1;
                    strings = self.declared_strings(&tag, strings)?;
                    if cell.is_none() && self.kind == Kind::Sheet && tag.local_name().as_ref() == "c" {
                        cell = Some(depth);
                    }
                }
                Event::Empty(tag) => strings = self.declared_strings(&tag, strings)?,
                Event::End(_) => {
                    cell = cell.filter(|of_cell| depth > *of_cell);
                    depth = depth.saturating_sub(1);
                }
                Event::Eof => break,
                _ => {}
            }
            if depth > MAX_DEPTH {
                return Err(format!("has more than {MAX_DEPTH} elements within each other"));
            }
        }
        if strings > self.read.get() / SHARED_STRING_BYTES {
            return Err(format!("claims {strings} strings in {} bytes", self.read.get()));
        }
        Ok(())
    }

    fn declared_strings(&self, tag: &BytesStart<'_>, before: u64) -> Result<u64, String> {
        if self.kind != Kind::SharedStrings || tag.local_name().as_ref() != "sst" {
            return Ok(before);
        }
        let mut count = before;
        for attribute in tag.attributes().with_checks(false) {
            let attribute = attribute.map_err(|error| format!("is not XML: {error}"))?;
            if attribute.key.local_name().as_ref() == "uniqueCount" {
                let stated = attribute.value.trim().parse();
                count =
                    count.max(stated.map_err(|_| format!("claims `{}` strings", short(&attribute.value)))?);
            }
        }
        Ok(count)
    }
}

fn short(text: &str) -> String {
    text.chars().take(40).collect()
}
