//! Reads the numbers of a flat JSON message exactly, without building a tree.

use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::fmt;

/// The content of a field in a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FieldValue {
    /// The field is missing.
    Absent,
    /// A number; NaN for null.
    Number(f64),
    /// Something else.
    Other,
}

/// Reads the named fields into `values`, which is resized to the number of names. Returns false if the message is
/// not a JSON object.
pub(crate) fn read_fields(message: &[u8], names: &[String], values: &mut Vec<FieldValue>) -> bool {
    let read = |message: &[u8], values: &mut Vec<FieldValue>| {
        values.clear();
        values.resize(names.len(), FieldValue::Absent);
        // Of a slice, serde_json would check the UTF-8 of each number.
        let Ok(text) = std::str::from_utf8(message) else { return false };
        if read_plain(text, names, values).is_some() {
            return true;
        }
        values.fill(FieldValue::Absent);
        let mut deserializer = serde_json::Deserializer::from_str(text);
        deserializer.deserialize_map(FieldsVisitor { names, values }).is_ok() && deserializer.end().is_ok()
    };
    // Python's json writes NaN and Infinity, which JSON does not have.
    read(message, values) || null_for_nonfinite(message).is_some_and(|message| read(&message, values))
}

/// Reads a message as our writer makes it, in half the time: plain keys and numbers without spaces. `None` for any other.
fn read_plain(message: &str, names: &[String], values: &mut [FieldValue]) -> Option<()> {
    let until = |text: &str, ends: &[u8]| text.bytes().position(|byte| ends.contains(&byte));
    let mut rest = message.strip_prefix('{')?;
    let mut expected = 0;
    loop {
        rest = rest.strip_prefix('"')?;
        let (key, after) = rest.split_at(until(rest, b"\"\\")?);
        let after = after.strip_prefix("\":")?;
        let (number, after) = after.split_at(until(after, b",}")?);
        // `parse` would also take -inf.
        let is_finite = number.ends_with(|last: char| last.is_ascii_digit());
        let value = match parse(number) {
            value @ FieldValue::Number(_) if is_finite || number == "null" => value,
            _ => return None,
        };
        if let Some(index) = position(names, expected, key) {
            values[index] = value;
            expected = index + 1;
        }
        if after == "}" {
            return Some(());
        }
        rest = after.strip_prefix(',')?;
    }
}

/// The place of a key among the names; messages usually keep the order of the names.
fn position(names: &[String], expected: usize, key: &str) -> Option<usize> {
    if names.get(expected).is_some_and(|name| name == key) {
        return Some(expected);
    }
    names.iter().position(|name| name == key)
}

struct FieldsVisitor<'a> {
    names: &'a [String],
    values: &'a mut [FieldValue],
}

impl<'de> Visitor<'de> for FieldsVisitor<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of numbers")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut expected = 0;
        while let Some(index) = map.next_key_seed(KeySeed { names: self.names, expected })? {
            match index {
                Some(index) => {
                    self.values[index] = parse(map.next_value::<&RawValue>()?.get());
                    expected = index + 1;
                }
                None => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
}

/// The standard library's parser returns the nearest number, which serde_json's own does not always.
fn parse(raw: &str) -> FieldValue {
    match raw {
        "null" => FieldValue::Number(f64::NAN),
        _ => raw.parse().map_or(FieldValue::Other, FieldValue::Number),
    }
}

/// Finds a key among the names.
struct KeySeed<'a> {
    names: &'a [String],
    expected: usize,
}

impl<'de> serde::de::DeserializeSeed<'de> for KeySeed<'_> {
    type Value = Option<usize>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Option<usize>, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for KeySeed<'_> {
    type Value = Option<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, key: &str) -> Result<Option<usize>, E> {
        Ok(position(self.names, self.expected, key))
    }
}

/// The message with null for NaN, Infinity and -Infinity outside strings; `None` if it contains none of them.
fn null_for_nonfinite(message: &[u8]) -> Option<Vec<u8>> {
    let mut rewritten = Vec::with_capacity(message.len());
    let (mut in_string, mut escaped, mut changed) = (false, false, false);
    let mut rest = message;
    while let Some((&byte, after)) = rest.split_first() {
        let token =
            [&b"NaN"[..], b"Infinity", b"-Infinity"].into_iter().find(|token| rest.starts_with(token));
        if let (false, Some(token)) = (in_string, token) {
            rewritten.extend_from_slice(b"null");
            changed = true;
            rest = &rest[token.len()..];
            continue;
        }
        if byte == b'"' && !escaped {
            in_string = !in_string;
        }
        escaped = in_string && byte == b'\\' && !escaped;
        rewritten.push(byte);
        rest = after;
    }
    changed.then_some(rewritten)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(message: &str, names: &[&str]) -> Option<Vec<FieldValue>> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut values = Vec::new();
        read_fields(message.as_bytes(), &names, &mut values).then_some(values)
    }

    #[test]
    fn numbers_are_the_nearest_ones_and_everything_else_is_distinguished() {
        use FieldValue::{Absent, Number, Other};
        let values = fields(
            r#"{"b":-0.1,"x":{"a":[9]},"a":1.7976931348623157e308,"c":"1","d":7}"#,
            &["a", "b", "c", "d", "e"],
        );
        assert_eq!(values, Some(vec![Number(f64::MAX), Number(-0.1), Other, Number(7.0), Absent]));
    }

    #[test]
    fn nan_as_python_writes_it_is_nan() {
        let values =
            fields(r#"{"s":"NaN \" NaN","a":NaN,"b":-Infinity,"c":null}"#, &["a", "b", "c", "s"]).unwrap();
        assert!(values[..3].iter().all(|v| matches!(v, FieldValue::Number(x) if x.is_nan())), "{values:?}");
        assert_eq!(values[3], FieldValue::Other);
    }

    #[test]
    fn messages_that_are_not_objects_are_refused() {
        for message in ["", "[1]", "{", "{\"a\":}", "{\"a\":1} x", "\u{fffd}"] {
            assert_eq!(fields(message, &["a"]), None, "{message}");
        }
    }
}
