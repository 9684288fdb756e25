//! MATLAB data of level 5 (`save`, `save -v7`): arrays of numbers, also in structures; and of version 7.3, which are HDF5, if compiled in.
//!
//! Format: MathWorks, MAT-File Format (2005-2024), chapter 1. Texts, cells, objects and complex or sparse numbers are left out.

use std::borrow::Cow;
use std::io::Read;

/// Size of the header, bytes; its last two give the byte order. Source: the format.
const HEADER: usize = 128;
/// Maximum nesting of structures. Bound: logs of Simulink have three levels.
const MAX_DEPTH: usize = 8;
/// Maximum number of elements of a structure. Bound: one for each line of a map, or each run of a day.
const MAX_ELEMENTS: usize = 1000;
/// Maximum number of arrays. Bound: ten times the columns of a wide log.
const MAX_ARRAYS: usize = 100_000;
/// Type of a data element with an array. Source: the format.
const MATRIX: u32 = 14;
/// Type of a compressed data element. Source: the format.
const COMPRESSED: u32 = 15;
/// Class of a structure. Source: the format.
const STRUCTURE: u8 = 2;
/// Classes of arrays of numbers. Source: the format.
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;
/// Flag of a complex array. Source: the format.
const COMPLEX: u8 = 8;

/// An array of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct MatArray {
    /// Name, in a structure with those of the structures around it: `log.T2`, `map(2).flow`.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// The numbers column by column.
    pub values: Vec<f64>,
}

/// The content of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MatFile {
    /// The arrays of numbers in the order of the file.
    pub arrays: Vec<MatArray>,
    /// Number of texts, cells, objects and arrays of complex numbers, which are left out.
    pub left_out: usize,
}

/// Whether a file begins as MATLAB data do: Octave and SciPy write the same words at level 5. Of version 7.3 only if HDF5 is compiled in.
pub fn is_mat5(head: &[u8]) -> bool {
    #[cfg(feature = "hdf5")]
    if hdf5::recognises(head) {
        return true;
    }
    head.starts_with(b"MATLAB 5.0 MAT-file")
}

/// Reads a file whose content takes at most `max_memory_bytes`.
pub fn read_mat5(bytes: &[u8], max_memory_bytes: u64) -> Result<MatFile, String> {
    #[cfg(feature = "hdf5")]
    if hdf5::recognises(bytes) {
        return hdf5::read(bytes, max_memory_bytes);
    }
    let is_big = bytes.get(126) == Some(&b'M');
    let mut reader = Reader { is_big, left: max_memory_bytes, file: MatFile::default() };
    reader.elements(bytes.get(HEADER..).unwrap_or_default(), "", 0)?;
    Ok(reader.file)
}

struct Reader {
    is_big: bool,
    left: u64,
    file: MatFile,
}

impl Reader {
    /// Counts memory.
    fn charge(&mut self, bytes: usize) -> Result<(), String> {
        let left = self.left.checked_sub(bytes as u64);
        self.left = left.ok_or("it unpacks to more than a file of its size may; export it in parts")?;
        Ok(())
    }

    fn elements(&mut self, mut bytes: &[u8], prefix: &str, depth: usize) -> Result<(), String> {
        while !bytes.is_empty() {
            let (kind, data, rest) = self.element(bytes)?;
            bytes = rest;
            match kind {
                COMPRESSED => {
                    let mut unpacked = Vec::new();
                    let unpacking =
                        flate2::read::ZlibDecoder::new(data).take(self.left + 1).read_to_end(&mut unpacked);
                    unpacking.map_err(|error| error.to_string())?;
                    self.charge(unpacked.len())?;
                    if depth >= MAX_DEPTH {
                        return Err("it is packed several times".to_owned());
                    }
                    self.elements(&unpacked, prefix, depth + 1)?;
                }
                MATRIX => self.matrix(data, None, prefix, depth)?,
                _ => self.file.left_out += 1,
            }
        }
        Ok(())
    }

    /// Type and data of the first element, and the bytes after it.
    fn element<'a>(&self, bytes: &'a [u8]) -> Result<(u32, &'a [u8], &'a [u8]), String> {
        let cut = || "an element is cut short".to_owned();
        let (kind, size) = (self.word(bytes, 0).ok_or_else(cut)?, self.word(bytes, 4).ok_or_else(cut)?);
        // The tag itself may contain up to four bytes of data.
        let (kind, start, size, end): (u32, usize, usize, usize) = match kind >> 16 {
            0 => {
                let size = size as usize;
                let padded = if kind == COMPRESSED { size } else { size.next_multiple_of(8) };
                (kind, 8, size, 8usize.saturating_add(padded))
            }
            small => (kind & 0xffff, 4, small as usize, 8),
        };
        let data = bytes.get(start..start.saturating_add(size)).ok_or_else(cut)?;
        Ok((kind, data, bytes.get(end..).unwrap_or_default()))
    }

    fn word(&self, bytes: &[u8], at: usize) -> Option<u32> {
        let word = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) })
    }

    /// An array: its numbers become columns, the fields of a structure are read in turn. `field`: its name in a structure.
    fn matrix(&mut self, data: &[u8], field: Option<&str>, prefix: &str, depth: usize) -> Result<(), String> {
        if data.is_empty() {
            return Ok(());
        }
        let (_, flags, rest) = self.element(data)?;
        let flags = self.word(flags, 0).ok_or("an array has no class")?;
        let (class, is_complex) = (flags.to_le_bytes()[0], flags.to_le_bytes()[1] & COMPLEX != 0);
        let (_, dimensions, rest) = self.element(rest)?;
        let dimensions: Vec<usize> = (0..dimensions.len() / 4)
            .filter_map(|at| Some(self.word(dimensions, 4 * at)? as usize))
            .collect();
        let (_, own, rest) = self.element(rest)?;
        let name = format!("{prefix}{}", field.map_or_else(|| String::from_utf8_lossy(own), Cow::Borrowed));
        match dimensions.as_slice() {
            [rows, columns] if NUMBERS.contains(&class) && !is_complex => {
                let (kind, numbers, _) = self.element(rest)?;
                let values = self.numbers(kind, numbers)?;
                if rows.checked_mul(*columns) != Some(values.len()) {
                    return Err(format!(
                        "`{name}` has {} numbers in {rows} x {columns} places",
                        values.len()
                    ));
                }
                self.add(name, values, *rows, *columns)
            }
            [rows, columns] if class == STRUCTURE => {
                let count = rows.saturating_mul(*columns);
                if depth >= MAX_DEPTH || count > MAX_ELEMENTS {
                    self.file.left_out += 1;
                    return Ok(());
                }
                self.structure(rest, &name, count, depth)
            }
            _ => {
                self.file.left_out += 1;
                Ok(())
            }
        }
    }

    fn structure(&mut self, data: &[u8], name: &str, count: usize, depth: usize) -> Result<(), String> {
        let (_, length, rest) = self.element(data)?;
        let length =
            self.word(length, 0).filter(|length| *length > 0).ok_or("a structure has no names")? as usize;
        let (_, names, mut rest) = self.element(rest)?;
        for element in 1..=count {
            let prefix = if count == 1 { format!("{name}.") } else { format!("{name}({element}).") };
            for field in names.chunks(length) {
                let field =
                    String::from_utf8_lossy(field.split(|byte| *byte == 0).next().unwrap_or_default())
                        .into_owned();
                let (_, data, after) = self.element(rest)?;
                self.matrix(data, Some(&field), &prefix, depth + 1)?;
                rest = after;
            }
        }
        Ok(())
    }

    fn add(&mut self, name: String, values: Vec<f64>, rows: usize, columns: usize) -> Result<(), String> {
        if self.file.arrays.len() >= MAX_ARRAYS {
            return Err(format!("it has more than {MAX_ARRAYS} arrays"));
        }
        self.file.arrays.push(MatArray { name, rows, columns, values });
        Ok(())
    }

    #[allow(clippy::unnecessary_cast, reason = "one of the types is f64 already")]
    fn numbers(&mut self, kind: u32, data: &[u8]) -> Result<Vec<f64>, String> {
        macro_rules! of {
            ($number:ty) => {{
                self.charge(data.len() / size_of::<$number>() * size_of::<f64>())?;
                data.chunks_exact(size_of::<$number>())
                    .filter_map(|bytes| {
                        let bytes = bytes.try_into().ok()?;
                        let value = if self.is_big {
                            <$number>::from_be_bytes(bytes)
                        } else {
                            <$number>::from_le_bytes(bytes)
                        };
                        Some(value as f64)
                    })
                    .collect()
            }};
        }
        Ok(match kind {
            1 => of!(i8),
            2 => of!(u8),
            3 => of!(i16),
            4 => of!(u16),
            5 => of!(i32),
            6 => of!(u32),
            7 => of!(f32),
            9 => of!(f64),
            12 => of!(i64),
            13 => of!(u64),
            other => return Err(format!("numbers of the unknown type {other}")),
        })
    }
}

#[cfg(feature = "hdf5")]
mod hdf5 {
    use super::{MAX_ARRAYS, MAX_DEPTH, MatArray, MatFile};
    use hdf5_pure::{AttrValue, Error, File, Group};

    /// Whether a file is HDF5, which MATLAB puts behind a header of its own. Source: the formats.
    pub(super) fn recognises(head: &[u8]) -> bool {
        head.starts_with(b"\x89HDF\r\n\x1a\n") || head.starts_with(b"MATLAB 7.3 MAT-file")
    }

    /// Reads a file whose numbers take at most `max_memory_bytes`.
    pub(super) fn read(bytes: &[u8], max_memory_bytes: u64) -> Result<MatFile, String> {
        let file = File::from_bytes(bytes.to_vec()).map_err(|error| error.to_string())?;
        let mut found = MatFile::default();
        let mut left = max_memory_bytes;
        let is_matlab = !bytes.starts_with(b"\x89HDF");
        walk(&file.root(), "", (0, is_matlab), &mut left, &mut found).map_err(|error| error.to_string())?;
        Ok(found)
    }

    fn walk(
        group: &Group,
        prefix: &str,
        (depth, is_matlab): (usize, bool),
        left: &mut u64,
        found: &mut MatFile,
    ) -> Result<(), Error> {
        for name in group.datasets()? {
            let dataset = group.dataset(&name)?;
            let shape = dataset.shape()?;
            let count = shape.iter().try_fold(1u64, |product, length| product.checked_mul(*length));
            let taken = count.and_then(|count| count.checked_mul(size_of::<f64>() as u64));
            let is_text = match dataset.attrs()?.get("MATLAB_class") {
                Some(AttrValue::String(class) | AttrValue::AsciiString(class)) => {
                    matches!(class.as_str(), "char" | "cell" | "function_handle")
                }
                _ => false,
            };
            let Some(rest) = taken.and_then(|taken| left.checked_sub(taken)).filter(|_| !is_text) else {
                found.left_out += 1;
                continue;
            };
            match dataset.read_f64() {
                Ok(values) if found.arrays.len() < MAX_ARRAYS => {
                    *left = rest;
                    found.arrays.push(array(format!("{prefix}{name}"), &shape, values, is_matlab));
                }
                _ => found.left_out += 1,
            }
        }
        // MATLAB keeps what cells refer to in groups of their own.
        for name in group.groups()?.iter().filter(|name| !name.starts_with('#') && depth < MAX_DEPTH) {
            walk(&group.group(name)?, &format!("{prefix}{name}."), (depth + 1, is_matlab), left, found)?;
        }
        Ok(())
    }

    /// MATLAB writes its columns one after the other, and others their rows.
    fn array(name: String, shape: &[u64], values: Vec<f64>, is_matlab: bool) -> MatArray {
        let length = |length: Option<&u64>| length.map_or(1, |length| *length as usize).max(1);
        if is_matlab || shape.len() < 2 {
            let rows = length(shape.last());
            return MatArray { name, rows, columns: values.len() / rows, values };
        }
        let rows = length(shape.first());
        let columns = values.len() / rows;
        let by_column =
            (0..columns).flat_map(|column| values.iter().skip(column).step_by(columns).copied()).collect();
        MatArray { name, rows, columns, values: by_column }
    }
}
