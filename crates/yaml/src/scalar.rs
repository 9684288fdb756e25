//! Plain scalars: null, booleans and numbers as YAML 1.2's core schema has them; everything else is text.

use serde_json::{Number, Value};

/// The value of a plain scalar; `None` for `.inf` and `.nan`, which nothing in a campaign may be.
pub(crate) fn resolve(text: &str) -> Option<Value> {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return Some(Value::Null),
        "true" | "True" | "TRUE" => return Some(Value::Bool(true)),
        "false" | "False" | "FALSE" => return Some(Value::Bool(false)),
        _ => {}
    }
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if matches!(digits, ".inf" | ".Inf" | ".INF") || matches!(text, ".nan" | ".NaN" | ".NAN") {
        return None;
    }
    if !digits.starts_with(|c: char| c.is_ascii_digit() || c == '.')
        || !digits.contains(|c: char| c.is_ascii_digit())
    {
        return Some(Value::String(text.to_owned()));
    }
    if digits.bytes().all(|b| b.is_ascii_digit()) {
        // A leading zero marks a name or serial number, not a quantity.
        if digits.len() > 1 && digits.starts_with('0') {
            return Some(Value::String(text.to_owned()));
        }
        let plain = text.strip_prefix('+').unwrap_or(text);
        if let Ok(value) = plain.parse::<u64>() {
            return Some(Value::Number(value.into()));
        }
        if let Ok(value) = plain.parse::<i64>() {
            return Some(Value::Number(value.into()));
        }
    }
    match text.parse::<f64>() {
        Ok(value) => Number::from_f64(value).map(Value::Number),
        Err(_) => Some(Value::String(text.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_core_schema() {
        // YAML 1.2.2, section 10.3.2, and what must stay text.
        let table = [
            ("", json!(null)),
            ("~", json!(null)),
            ("true", json!(true)),
            ("yes", json!("yes")),
            ("7", json!(7)),
            ("-7", json!(-7)),
            ("+7", json!(7)),
            ("007", json!("007")),
            ("0.5", json!(0.5)),
            (".5", json!(0.5)),
            ("1e3", json!(1000.0)),
            ("-1.5E-4", json!(-1.5e-4)),
            ("2026-09-01", json!("2026-09-01")),
            ("10 s", json!("10 s")),
            (".", json!(".")),
            ("1_000", json!("1_000")),
            ("18446744073709551615", json!(u64::MAX)),
        ];
        for (text, value) in table {
            assert_eq!(resolve(text), Some(value), "{text}");
        }
        for text in [".inf", "-.inf", ".nan", "1e999"] {
            assert_eq!(resolve(text), None, "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn a_number_is_what_rust_reads(text in "[+-]?[1-9][0-9]{0,3}(\\.[0-9]{0,3})?([eE][+-]?[0-9]{1,2})?") {
            let number = resolve(&text).unwrap();
            proptest::prop_assert_eq!(number.as_f64(), text.parse().ok(), "{}", text);
        }
    }
}
