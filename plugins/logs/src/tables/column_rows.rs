//! Columns stored one after the other, presented as rows of a table.

use crate::notation::instant::{Instant, parse_instant};
use crate::notation::number::{NO_READING, number_in, parse_number};
use crate::notation::table_row::{Cells, Rows};
use crate::notation::typed_cell::Value;
use mapper_recording::logs::{DateOrder, LogError};

/// Rows of a column; rows after its end are empty.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "parquet"), allow(dead_code, reason = "MATLAB data have numbers only"))]
pub(crate) enum Chunk {
    Numbers(Vec<f64>),
    Instants(Vec<Option<Instant>>),
    Texts(Vec<String>),
}

impl Chunk {
    fn value(&self, row: usize) -> Value {
        let found = match self {
            Chunk::Numbers(values) => {
                values.get(row).filter(|value| value.is_finite()).map(|value| Value::Number(*value))
            }
            Chunk::Instants(values) => values.get(row).copied().flatten().map(Value::Instant),
            Chunk::Texts(values) => values.get(row).map(|text| Value::Text(text.trim().to_owned())),
        };
        found.unwrap_or(Value::Empty)
    }
}

/// A source of columns, some rows at a time.
pub(crate) trait Chunks {
    /// The next rows of each column, and their number; `None` at the end.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be read further.
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError>;
}

/// Presents columns as rows of a table, after the header as rows of text.
pub(crate) struct ColumnRows<C> {
    chunks: C,
    head: Vec<Vec<String>>,
    /// Header rows returned so far, including the present one.
    head_at: usize,
    chunk: Vec<Chunk>,
    count: usize,
    /// The current row of the chunk, from 1; 0 before the first.
    at: usize,
}

impl<C: Chunks> ColumnRows<C> {
    /// `head`: names above the columns, and units if any is known.
    pub(crate) fn new(head: Vec<Vec<String>>, chunks: C) -> Self {
        ColumnRows { chunks, head, head_at: 0, chunk: Vec::new(), count: 0, at: 0 }
    }

    /// Up to this many rows as text, from here on.
    pub(crate) fn texts(&mut self, rows: usize) -> Result<Vec<Vec<String>>, LogError> {
        let mut found = Vec::new();
        while found.len() < rows && self.advance()? {
            found.push(match self.head_row() {
                Some(head) => head.clone(),
                None => self.chunk.iter().map(|chunk| chunk.value(self.at - 1).text(b'.')).collect(),
            });
        }
        Ok(found)
    }

    fn head_row(&self) -> Option<&Vec<String>> {
        if self.at > 0 { None } else { self.head.get(self.head_at.checked_sub(1)?) }
    }

    fn row(&self) -> Option<usize> {
        self.at.checked_sub(1)
    }
}

impl<C: Chunks> Cells for ColumnRows<C> {
    fn number(&self, column: usize) -> f64 {
        let found = self.row().zip(self.chunk.get(column)).and_then(|(row, chunk)| match chunk {
            Chunk::Numbers(values) => values.get(row).copied().filter(|value| value.abs() < NO_READING),
            Chunk::Texts(values) => parse_number(values.get(row)?.trim().as_bytes(), b'.'),
            Chunk::Instants(_) => None,
        });
        found.unwrap_or(f64::NAN)
    }

    fn number_in(&self, column: usize, unit: &str) -> f64 {
        let found = self.row().zip(self.chunk.get(column)).and_then(|(row, chunk)| match chunk {
            Chunk::Texts(values) => Some(number_in(values.get(row)?, b'.', unit)),
            _ => None,
        });
        found.unwrap_or(f64::NAN)
    }

    fn instant(&self, column: usize, order: DateOrder) -> Option<Instant> {
        match self.chunk.get(column)? {
            Chunk::Instants(values) => values.get(self.row()?).copied().flatten(),
            Chunk::Texts(values) => parse_instant(values.get(self.row()?)?, order),
            Chunk::Numbers(_) => None,
        }
    }
}

impl<C: Chunks> Rows for ColumnRows<C> {
    fn advance(&mut self) -> Result<bool, LogError> {
        if self.at == 0 && self.head_at < self.head.len() {
            self.head_at += 1;
            return Ok(true);
        }
        while self.at >= self.count {
            let Some((count, chunk)) = self.chunks.next_chunk()? else { return Ok(false) };
            (self.count, self.chunk, self.at) = (count, chunk, 0);
        }
        self.at += 1;
        Ok(true)
    }
}
