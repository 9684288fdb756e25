//! Record batches of Arrow and Parquet, as the rows of one table.

use crate::clock::HEAD_ROWS;
use crate::table_head::MAX_COLUMNS;
use crate::tables::column_log::{COLUMN_OPTIONS, Chunk, Chunks, ColumnRows};
use crate::tables::table_log::{Origin, Table};
use arrow_array::cast::AsArray;
use arrow_array::temporal_conversions::MILLISECONDS;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, DurationMicrosecondType, DurationMillisecondType,
    DurationNanosecondType, DurationSecondType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type,
    Int64Type, Time32MillisecondType, Time32SecondType, Time64MicrosecondType, Time64NanosecondType,
    TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, Float64Array, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, Schema, TimeUnit};
use mapper_recording::logs::{Layout, Log, LogError, LogFile, LogFinding, LogOptions, RowSink, SampleTable};
use mapper_table::{Instant, NS_PER_DAY};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Once};

pub(crate) type Batches = Box<dyn Iterator<Item = Result<RecordBatch, ArrowError>>>;

/// Opens a file from its start: its schema and its batches.
pub(crate) type OpenBatches = fn(&LogFile) -> Result<(Schema, Batches), LogError>;

pub(crate) fn batch_of(table: &SampleTable) -> Result<RecordBatch, ArrowError> {
    let mut fields = vec![Field::new(SampleTable::TIME, DataType::Float64, false)];
    let mut columns: Vec<Arc<dyn Array>> = vec![Arc::new(Float64Array::from(table.times_s.clone()))];
    for column in &table.columns {
        fields.push(Field::new(column.heading(), DataType::Float64, true));
        let values = column.values.iter().map(|value| value.is_finite().then_some(*value));
        columns.push(Arc::new(values.collect::<Float64Array>()));
    }
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns)
}

struct BatchLog {
    file: LogFile,
    name: &'static str,
    open: OpenBatches,
    table: Table,
}

pub(crate) fn open_log(
    name: &'static str,
    file: &LogFile,
    options: &LogOptions,
    open: OpenBatches,
) -> Result<Box<dyn Log>, LogError> {
    options.allow_only(&COLUMN_OPTIONS).map_err(|why| file.content_error(name, why))?;
    let (schema, batches) = catch_panic(name, file, || open(file))?;
    let columns = schema.fields().len();
    if columns > MAX_COLUMNS {
        return Err(
            file.content_error(name, format!("it has {columns} columns; at most {MAX_COLUMNS} are read"))
        );
    }
    let chunks = BatchChunks { file, name, batches };
    let rows = ColumnRows::new(head(&schema), chunks).texts(HEAD_ROWS)?;
    let mut table =
        Table::analyse(&rows, b'.', options, Origin::Columns).map_err(|why| file.content_error(name, why))?;
    let unread = schema.fields().iter().filter(|field| !is_read(field.data_type())).count();
    if unread > 0 {
        let reason = "lists, structures, or of an unsupported type";
        table.layout.findings.push(LogFinding::left_out(unread, reason));
    }
    Ok(Box::new(BatchLog { file: file.clone(), name, open, table }))
}

/// Names, and units if the metadata of any column has one.
fn head(schema: &Schema) -> Vec<Vec<String>> {
    let unit = |field: &Field| field.metadata().get("unit").cloned().unwrap_or_default();
    let names = schema.fields().iter().map(|field| field.name().clone()).collect();
    let units: Vec<String> = schema.fields().iter().map(|field| unit(field)).collect();
    if units.iter().all(String::is_empty) { vec![names] } else { vec![names, units] }
}

impl Log for BatchLog {
    fn layout(&self) -> &Layout {
        &self.table.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let (schema, batches) = catch_panic(self.name, &self.file, || (self.open)(&self.file))?;
        let chunks = BatchChunks { file: &self.file, name: self.name, batches };
        let remark = self.table.rows(&mut ColumnRows::new(head(&schema), chunks), wanted, sink)?;
        self.table.layout.add_finding(remark);
        Ok(())
    }
}

struct BatchChunks<'a> {
    file: &'a LogFile,
    name: &'static str,
    batches: Batches,
}

impl Chunks for BatchChunks<'_> {
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError> {
        let BatchChunks { file, name, batches } = self;
        catch_panic(name, file, || {
            let Some(batch) = batches.next() else { return Ok(None) };
            let batch = batch.map_err(|error| file.content_error(name, error.to_string()))?;
            Ok(Some((
                batch.num_rows(),
                batch.columns().iter().map(|column| chunk(column.as_ref())).collect(),
            )))
        })
    }
}

thread_local! {
    /// Whether a panic of this thread becomes an error, so that nothing is printed for it.
    static CATCHES: Cell<bool> = const { Cell::new(false) };
}
static HOOK: Once = Once::new();

/// Reports a panic as an error of the file: Arrow's libraries panic on wrong sizes and offsets (one in a hundred files with flipped bytes).
/// The intermediate state is dropped, never reused.
fn catch_panic<T>(
    name: &'static str,
    file: &LogFile,
    reading: impl FnOnce() -> Result<T, LogError>,
) -> Result<T, LogError> {
    let damaged =
        || file.content_error(name, "it is damaged: a size or an offset in it is invalid; export it again");
    HOOK.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !CATCHES.get() {
                print(panic)
            }
        }));
    });
    CATCHES.set(true);
    let read = catch_unwind(AssertUnwindSafe(reading));
    CATCHES.set(false);
    read.unwrap_or_else(|_| Err(damaged()))
}

/// Whether a column contains numbers, times or texts.
fn is_read(data_type: &DataType) -> bool {
    use DataType as T;
    let number = data_type.is_integer() || matches!(data_type, T::Float32 | T::Float64 | T::Boolean);
    let time = matches!(
        data_type,
        T::Timestamp(..) | T::Date32 | T::Date64 | T::Time32(_) | T::Time64(_) | T::Duration(_)
    );
    number || time || matches!(data_type, T::Utf8 | T::LargeUtf8 | T::Utf8View)
}

/// The values of a column; null values and other types are empty.
fn chunk(array: &dyn Array) -> Chunk {
    use DataType as T;
    use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
    match array.data_type() {
        T::Float64 => numbers::<Float64Type>(array, |value| value),
        T::Float32 => numbers::<Float32Type>(array, f64::from),
        T::Int8 => numbers::<Int8Type>(array, f64::from),
        T::Int16 => numbers::<Int16Type>(array, f64::from),
        T::Int32 => numbers::<Int32Type>(array, f64::from),
        // Counts above 2^53 lose their last digit.
        T::Int64 => numbers::<Int64Type>(array, |value| value as f64),
        T::UInt8 => numbers::<UInt8Type>(array, f64::from),
        T::UInt16 => numbers::<UInt16Type>(array, f64::from),
        T::UInt32 => numbers::<UInt32Type>(array, f64::from),
        T::UInt64 => numbers::<UInt64Type>(array, |value| value as f64),
        // Seconds since the start.
        T::Duration(Second) => numbers::<DurationSecondType>(array, |value| value as f64),
        T::Duration(Millisecond) => numbers::<DurationMillisecondType>(array, |value| value as f64 / 1e3),
        T::Duration(Microsecond) => numbers::<DurationMicrosecondType>(array, |value| value as f64 / 1e6),
        T::Duration(Nanosecond) => numbers::<DurationNanosecondType>(array, |value| value as f64 / 1e9),
        T::Boolean => {
            let values = array.as_boolean();
            Chunk::Numbers(
                values
                    .iter()
                    .map(|value| value.map_or(f64::NAN, |value| f64::from(u8::from(value))))
                    .collect(),
            )
        }
        T::Timestamp(Second, _) => instants::<TimestampSecondType>(array, 1_000_000_000, true),
        T::Timestamp(Millisecond, _) => instants::<TimestampMillisecondType>(array, 1_000_000, true),
        T::Timestamp(Microsecond, _) => instants::<TimestampMicrosecondType>(array, 1_000, true),
        T::Timestamp(Nanosecond, _) => instants::<TimestampNanosecondType>(array, 1, true),
        T::Date64 => instants::<Date64Type>(array, NS_PER_DAY / (86_400 * MILLISECONDS), true),
        T::Date32 => instants::<Date32Type>(array, NS_PER_DAY, true),
        T::Time32(Second) => instants::<Time32SecondType>(array, 1_000_000_000, false),
        T::Time32(_) => instants::<Time32MillisecondType>(array, 1_000_000, false),
        T::Time64(Microsecond) => instants::<Time64MicrosecondType>(array, 1_000, false),
        T::Time64(_) => instants::<Time64NanosecondType>(array, 1, false),
        T::Utf8 => texts(array.as_string::<i32>().iter()),
        T::LargeUtf8 => texts(array.as_string::<i64>().iter()),
        T::Utf8View => texts(array.as_string_view().iter()),
        _ => Chunk::Numbers(Vec::new()),
    }
}

fn numbers<T: ArrowPrimitiveType>(array: &dyn Array, number: fn(T::Native) -> f64) -> Chunk {
    Chunk::Numbers(array.as_primitive::<T>().iter().map(|value| value.map_or(f64::NAN, number)).collect())
}

/// Dates and times, in units of this many nanoseconds since 1970 or since midnight.
fn instants<T: ArrowPrimitiveType>(array: &dyn Array, unit_ns: i64, dated: bool) -> Chunk
where
    i64: From<T::Native>,
{
    let instant = |value: T::Native| {
        let ns = i64::from(value).checked_mul(unit_ns)?;
        let day = dated.then(|| ns.div_euclid(NS_PER_DAY));
        // Dates before 1970 are invalid.
        (ns >= 0).then_some(Instant { day, ns_of_day: Some(ns.rem_euclid(NS_PER_DAY)) })
    };
    Chunk::Instants(array.as_primitive::<T>().iter().map(|value| value.and_then(instant)).collect())
}

fn texts<'a>(values: impl Iterator<Item = Option<&'a str>>) -> Chunk {
    Chunk::Texts(values.map(|value| value.unwrap_or_default().to_owned()).collect())
}
