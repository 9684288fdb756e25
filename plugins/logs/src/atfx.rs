//! ASAM ATFX: measurements of an ODS server in XML, their values in the file or in binary files next to it.
//!
//! Servers name elements and attributes differently; the application model at the start of a file maps them to the base model. Read as
//! openATFX does (github.com/peak-solution/openatfx), whose examples are ASAM's.

use crate::table_head::MAX_COLUMNS;
use crate::tables::column_log::{Chunk, ColumnTable, check_columns_file, column_log};
use mapper_recording::logs::limits::{MAX_UNPACKED_BYTES, max_memory_bytes};
use mapper_recording::logs::{Log, LogError, LogFile, LogFinding, LogFormat, LogOptions};
use mapper_table::{DateOrder, Instant, parse_instant};
use quick_xml::Reader;
use quick_xml::events::Event;
use std::collections::HashMap;
use std::io::BufReader;
use std::path::Path;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: None };

const NAME: &str = "ATFX";

/// Maximum nesting of elements: values are five levels deep.
const MAX_DEPTH: usize = 32;

/// Size of a value in memory, bytes.
const VALUE_BYTES: u64 = 8;

fn recognises(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head.get(..4096).unwrap_or(head));
    head.trim_start_matches('\u{feff}').starts_with('<') && head.contains("<atfx_file")
}

#[derive(Clone)]
enum Values {
    Numbers(Vec<f64>),
    Instants(Vec<Option<Instant>>),
    /// Tags and texts of a reference to a binary file.
    Component(HashMap<String, String>),
}

/// An instance of the file, with attributes by the names of the base model.
#[derive(Default)]
struct Instance {
    texts: HashMap<String, String>,
    values: HashMap<String, Values>,
}

impl Instance {
    fn text(&self, name: &str) -> &str {
        self.texts.get(name).map_or("", String::as_str)
    }
}

#[derive(Default)]
struct Contents {
    files: HashMap<String, String>,
    /// Type and base names of the attributes of each element of the application model.
    elements: HashMap<String, (String, HashMap<String, String>)>,
    columns: Vec<Instance>,
    matrices: HashMap<String, Instance>,
    quantities: HashMap<String, Instance>,
    units: HashMap<String, Instance>,
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    check_columns_file(file, NAME, options)?;
    let contents = contents(file).map_err(|why| file.content_error(NAME, why))?;
    let left = max_memory_bytes(file.size_bytes()?);
    let mut binaries = Binaries { file, contents: &contents, read: HashMap::new(), left };
    let (mut tables, mut problems): (Vec<(String, ColumnTable)>, Vec<LogFinding>) = (Vec::new(), Vec::new());
    for column in &contents.columns {
        let quantity = contents.quantities.get(column.text("measurement_quantity"));
        let name = Some(column.text("name")).filter(|name| !name.is_empty());
        let name = name.or(quantity.map(|quantity| quantity.text("name"))).unwrap_or_default().to_owned();
        let unit = quantity.and_then(|quantity| contents.units.get(quantity.text("unit")));
        let matrix = column.text("submatrix").to_owned();
        let rows = contents.matrices.get(&matrix).and_then(|found| found.text("number_of_rows").parse().ok());
        let chunk = match binaries.chunk(column, rows) {
            Ok(chunk) => chunk,
            Err(why) => {
                problems.push(LogFinding::skipped("column", &name, why));
                continue;
            }
        };
        let place = match tables.iter().position(|(other, _)| *other == matrix) {
            Some(place) => place,
            None => {
                let title = contents.matrices.get(&matrix).map_or("", |found| found.text("name")).to_owned();
                let head = vec![Vec::new(), Vec::new()];
                let table = ColumnTable { title, head, rows: 0, columns: Vec::new(), clock: None };
                tables.push((matrix, table));
                tables.len() - 1
            }
        };
        let Some((_, table)) = tables.get_mut(place).filter(|(_, table)| table.columns.len() < MAX_COLUMNS)
        else {
            continue;
        };
        table.rows = table.rows.max(chunk.len());
        // If several columns are independent, their names decide.
        if column.text("independent") == "1" {
            table.clock = if table.clock.is_none() { Some(name.clone()) } else { Some(String::new()) };
        }
        for (row, text) in
            table.head.iter_mut().zip([name, unit.map_or("", |unit| unit.text("name")).to_owned()])
        {
            row.push(text);
        }
        table.columns.push(chunk);
    }
    // A clock without data is not a log.
    let tables = tables.into_iter().filter(|(_, table)| table.columns.len() > 1).map(|(_, mut table)| {
        table.clock = table.clock.filter(|name| !name.is_empty());
        table.head.retain(|row| row.iter().any(|text| !text.is_empty()));
        table
    });
    column_log(file, (NAME, "submatrix"), tables.collect(), problems, options)
}

fn contents(file: &LogFile) -> Result<Contents, String> {
    let mut xml = Reader::from_reader(BufReader::new(file.open().map_err(|error| error.to_string())?));
    let (mut found, mut path, mut text) = (Contents::default(), Vec::<String>::new(), String::new());
    let mut element = Element::default();
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        match xml.read_event_into(&mut buffer).map_err(|error| format!("it is not XML: {error}"))? {
            Event::Start(tag) => {
                path.push(tag.local_name().as_ref().to_owned());
                text.clear();
                if path.len() > MAX_DEPTH {
                    return Err(format!("it has more than {MAX_DEPTH} elements within each other"));
                }
            }
            Event::Text(piece) => text.push_str(&piece),
            Event::GeneralRef(name) => text.push_str(match name.as_ref() {
                "lt" => "<",
                "gt" => ">",
                "quot" => "\"",
                "apos" => "'",
                _ => "&",
            }),
            Event::End(_) => {
                element.end(&path, text.trim(), &mut found);
                path.pop();
                text.clear();
            }
            Event::Eof => return Ok(found),
            _ => {}
        }
    }
}

#[derive(Default)]
struct Element {
    tags: HashMap<String, String>,
    /// Of an element of the application model.
    attributes: HashMap<String, String>,
    name: String,
    kind: String,
    instance: Instance,
}

impl Element {
    fn end(&mut self, path: &[String], text: &str, found: &mut Contents) {
        let path: Vec<&str> = path.iter().map(String::as_str).collect();
        match path.as_slice() {
            [_, "files", "component"] => {
                let mut tags = std::mem::take(&mut self.tags);
                found.files.extend(tags.remove("identifier").zip(tags.remove("filename")));
            }
            [
                _,
                "application_model",
                "application_element",
                "application_attribute" | "relation_attribute",
            ] => {
                let mut tags = std::mem::take(&mut self.tags);
                let base = tags.remove("base_attribute").or(tags.remove("base_relation"));
                self.attributes.extend(tags.remove("name").zip(base));
            }
            [_, "application_model", "application_element", "name"] => text.clone_into(&mut self.name),
            [_, "application_model", "application_element", "basetype"] => text.clone_into(&mut self.kind),
            [_, "application_model", "application_element"] => {
                let attributes = std::mem::take(&mut self.attributes);
                found
                    .elements
                    .insert(std::mem::take(&mut self.name), (std::mem::take(&mut self.kind), attributes));
            }
            [_, "instance_data", element] => {
                let instance = std::mem::take(&mut self.instance);
                let id = instance.text("id").to_owned();
                let kind = found.elements.get(*element).map_or("", |(kind, _)| kind.as_str());
                match kind.to_ascii_lowercase().as_str() {
                    "aolocalcolumn" => found.columns.push(instance),
                    "aosubmatrix" => _ = found.matrices.insert(id, instance),
                    "aomeasurementquantity" => _ = found.quantities.insert(id, instance),
                    "aounit" => _ = found.units.insert(id, instance),
                    _ => {}
                }
            }
            [_, "instance_data", element, attribute, rest @ ..] => {
                let base =
                    found.elements.get(*element).and_then(|(_, attributes)| attributes.get(*attribute));
                let Some(base) = base else { return };
                match rest {
                    [] if !text.is_empty() => _ = self.instance.texts.insert(base.clone(), text.to_owned()),
                    ["component"] => {
                        let tags = Values::Component(std::mem::take(&mut self.tags));
                        self.instance.values.insert(base.clone(), tags);
                    }
                    ["component", tag] => _ = self.tags.insert((*tag).to_owned(), text.to_owned()),
                    ["A_TIMESTRING"] => {
                        let values = text.split_whitespace().map(instant_of_digits).collect();
                        self.instance.values.insert(base.clone(), Values::Instants(values));
                    }
                    [kind]
                        if kind.starts_with("A_INT")
                            || kind.starts_with("A_FLOAT")
                            || kind.starts_with("A_BOOL") =>
                    {
                        self.instance.values.insert(base.clone(), Values::Numbers(numbers_in(text)));
                    }
                    _ => {}
                }
            }
            [_, "files" | "application_model", .., tag] => {
                _ = self.tags.insert((*tag).to_owned(), text.to_owned())
            }
            _ => {}
        }
    }
}

fn numbers_in(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect()
}

/// A date as `YYYYMMDDhhmmss` and further digits of the second.
fn instant_of_digits(text: &str) -> Option<Instant> {
    let part = |from: usize, to: usize| text.get(from..to);
    let (date, time) = (part(0, 8)?, part(8, 14)?);
    let (year, month, day) = (date.get(..4)?, date.get(4..6)?, date.get(6..)?);
    let (hour, minute, second) = (time.get(..2)?, time.get(2..4)?, time.get(4..)?);
    let fraction = text.get(14..).filter(|digits| !digits.is_empty()).unwrap_or("0");
    parse_instant(&format!("{year}-{month}-{day} {hour}:{minute}:{second}.{fraction}"), DateOrder::YearFirst)
}

struct Binaries<'a> {
    file: &'a LogFile,
    contents: &'a Contents,
    read: HashMap<String, Vec<u8>>,
    left: u64,
}

impl Binaries<'_> {
    fn chunk(&mut self, column: &Instance, rows: Option<usize>) -> Result<Chunk, String> {
        let written = match column.values.get("values") {
            Some(Values::Instants(instants)) => return Ok(Chunk::Instants(instants.clone())),
            Some(values) => Some(self.numbers(values)?),
            None => None,
        };
        let parameters = match column.values.get("generation_parameters") {
            Some(values) => self.numbers(values)?,
            None => numbers_in(column.text("generation_parameters")),
        };
        let given = written.as_deref().unwrap_or(&parameters);
        let mut values = match (column.text("sequence_representation"), given) {
            ("implicit_constant" | "1", [constant, ..]) => vec![*constant; self.reserve(rows)?],
            ("implicit_linear" | "2", [start, step, ..]) => {
                (0..self.reserve(rows)?).map(|row| start + row as f64 * step).collect()
            }
            ("explicit" | "external_component" | "0" | "7", _) => written.ok_or("it has no numbers here")?,
            ("raw_linear" | "raw_linear_external" | "4" | "8", _) => match parameters.as_slice() {
                [offset, factor, ..] => {
                    let raw = written.ok_or("it has no numbers here")?;
                    raw.iter().map(|raw| offset + factor * raw).collect()
                }
                _ => return Err("its offset and factor are missing".to_owned()),
            },
            (other, _) => return Err(format!("values of the form `{other}` are not read")),
        };
        // A value counts if it is both valid (1) and defined (8).
        if let Some(flags) = column.values.get("flags") {
            for (value, flag) in values.iter_mut().zip(self.numbers(flags)?) {
                if flag as i64 & 9 != 9 {
                    *value = f64::NAN;
                }
            }
        }
        Ok(Chunk::Numbers(values))
    }

    fn reserve(&mut self, rows: Option<usize>) -> Result<usize, String> {
        let rows = rows.ok_or("its number of rows is missing")?;
        let bytes = u64::try_from(rows).unwrap_or(u64::MAX).saturating_mul(VALUE_BYTES);
        self.left = self.left.checked_sub(bytes).ok_or("its rows exceed the memory of a log")?;
        Ok(rows)
    }

    fn numbers(&mut self, values: &Values) -> Result<Vec<f64>, String> {
        match values {
            Values::Numbers(values) => Ok(values.clone()),
            Values::Instants(_) => Err("it has dates instead of numbers".to_owned()),
            Values::Component(tags) => self.component(tags),
        }
    }

    /// Values in a binary file: blocks with some values at their offsets.
    fn component(&mut self, tags: &HashMap<String, String>) -> Result<Vec<f64>, String> {
        let number = |tag: &str| tags.get(tag).and_then(|text| text.parse::<usize>().ok());
        let count = self.reserve(number("length"))?;
        let datatype = tags.get("datatype").map_or("", String::as_str);
        let (start, per_block) =
            (number("inioffset").unwrap_or(0), number("valperblock").unwrap_or(1).max(1));
        let offsets: Vec<usize> = tags
            .get("valoffsets")
            .map_or("0", String::as_str)
            .split_whitespace()
            .filter_map(|text| text.parse().ok())
            .collect();
        let block = number("blocksize").ok_or("the size of its blocks is missing")?;
        let bytes = self.binary(tags.get("identifier").map_or("", String::as_str))?;
        let value = |index: usize| {
            let offset = offsets.get(index % per_block).or(offsets.first())?;
            let at = start.checked_add((index / per_block).checked_mul(block)?)?.checked_add(*offset)?;
            decode(bytes.get(at..)?, datatype)
        };
        let values: Option<Vec<f64>> = (0..count).map(value).collect();
        values.ok_or_else(|| format!("its binary file ends early, or has values of the type `{datatype}`"))
    }

    fn binary(&mut self, identifier: &str) -> Result<&[u8], String> {
        // Some programs write the file name instead of the identifier.
        let name = self.contents.files.get(identifier).map_or(identifier, String::as_str);
        if !self.read.contains_key(identifier) {
            // A path could name any file of this machine.
            if Path::new(name).file_name().is_none_or(|only| only.to_str() != Some(name)) {
                return Err(format!("its values are in `{name}`; put that file next to this one"));
            }
            let failed =
                |error: LogError| format!("its values are in `{name}`, which cannot be read: {error}");
            let file = LogFile::from_path(&self.file.path().with_file_name(name));
            let size = file.size_bytes().map_err(failed)?;
            let whole = self.left.saturating_add(max_memory_bytes(size)).min(MAX_UNPACKED_BYTES);
            self.left = whole.checked_sub(size).ok_or(format!("`{name}` exceeds the memory of a log"))?;
            let bytes = file.head(usize::try_from(size).unwrap_or(usize::MAX)).map_err(failed)?;
            self.read.insert(identifier.to_owned(), bytes);
        }
        Ok(self.read.get(identifier).map_or(&[][..], Vec::as_slice))
    }
}

fn decode(bytes: &[u8], datatype: &str) -> Option<f64> {
    let (kind, is_big) = datatype.strip_suffix("_beo").map_or((datatype, false), |kind| (kind, true));
    let integer = |size: usize| {
        let mut number = [0u8; 8];
        let found = bytes.get(..size)?;
        number.get_mut(..size)?.copy_from_slice(found);
        if is_big {
            number.get_mut(..size)?.reverse();
        }
        Some(u64::from_le_bytes(number))
    };
    Some(match kind {
        "dt_boolean" | "dt_byte" => integer(1)? as u8 as f64,
        "dt_sbyte" => integer(1)? as u8 as i8 as f64,
        "dt_short" => integer(2)? as u16 as i16 as f64,
        "dt_ushort" => integer(2)? as u16 as f64,
        "dt_long" => integer(4)? as u32 as i32 as f64,
        "dt_ulong" => integer(4)? as u32 as f64,
        "dt_longlong" => integer(8)?.cast_signed() as f64,
        "ieeefloat4" => f64::from(f32::from_bits(integer(4)? as u32)),
        "ieeefloat8" => f64::from_bits(integer(8)?),
        _ => return None,
    })
}
