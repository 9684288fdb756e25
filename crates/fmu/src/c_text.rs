//! Numbers and names in C.

use crate::machine::FmuError;
use std::fmt::Write;

/// The shortest decimal that C reads back as the same number.
pub fn number(name: &str, value: f64) -> Result<String, FmuError> {
    if value.is_finite() {
        Ok(format!("{value:e}"))
    } else {
        Err(FmuError::NotFinite { name: name.to_owned(), value })
    }
}

/// The numbers of an array, comma-separated.
pub fn numbers(name: &str, values: impl IntoIterator<Item = f64>) -> Result<String, FmuError> {
    Ok(values.into_iter().map(|value| number(name, value)).collect::<Result<Vec<_>, _>>()?.join(", "))
}

/// `static const double NAME[] = {...};`
pub fn array(text: &mut String, name: &str, values: impl IntoIterator<Item = f64>) -> Result<(), FmuError> {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "static const double {name}[] = {{{}}};", numbers(name, values)?);
    Ok(())
}

/// A variable's name as part of a C identifier.
pub fn identifier(name: &str) -> String {
    name.replace('.', "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_nonsense_is_refused() {
        for value in [0.1, 29e-3, 1e300, -0.0, f64::MIN_POSITIVE] {
            assert_eq!(number("", value).unwrap().parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert!(number("flow", f64::NAN).unwrap_err().to_string().contains("flow"));
    }
}
