//! A cell in a table with typed cells.

use crate::notation::instant::{Instant, NS_PER_DAY};
use jiff::ToSpan;
use jiff::civil::{Date, Time};

/// The contents of a cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    Empty,
    Number(f64),
    Text(String),
    Instant(Instant),
}

impl Value {
    pub(crate) fn is_empty(&self) -> bool {
        match self {
            Value::Empty => true,
            Value::Text(text) => text.is_empty(),
            _ => false,
        }
    }

    /// Size of its text, bytes.
    pub(crate) fn size(&self) -> usize {
        size_of::<Value>() + if let Value::Text(text) = self { text.len() } else { 0 }
    }

    /// Its text as in a cell of a text file.
    pub(crate) fn text(&self, decimal: u8) -> String {
        match self {
            Value::Empty => String::new(),
            Value::Number(value) if decimal == b',' => value.to_string().replace('.', ","),
            Value::Number(value) => value.to_string(),
            Value::Text(text) => text.clone(),
            Value::Instant(instant) => text_of(*instant).unwrap_or_default(),
        }
    }
}

fn text_of(instant: Instant) -> Option<String> {
    let ns = instant.ns_of_day?.rem_euclid(NS_PER_DAY);
    let second = ns / 1_000_000_000;
    let (hour, minute) = (i8::try_from(second / 3600).ok()?, i8::try_from(second / 60 % 60).ok()?);
    let time =
        Time::new(hour, minute, i8::try_from(second % 60).ok()?, i32::try_from(ns % 1_000_000_000).ok()?)
            .ok()?;
    let Some(day) = instant.day else { return Some(time.to_string()) };
    let date = Date::new(1970, 1, 1).ok()?.checked_add(day.days()).ok()?;
    Some(format!("{date} {time}"))
}
