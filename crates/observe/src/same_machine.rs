//! Checks whether a recording was made on the machine of the campaign.

use std::collections::BTreeMap;

/// A recording of a different machine from the campaign's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the recording was made on another machine: {what} `{recorded}` instead of the campaign's `{expected}`"
)]
pub struct OtherMachine {
    /// The difference: `machine` or `serial number`.
    pub what: &'static str,
    /// Value in the recording.
    pub recorded: String,
    /// Value in the campaign.
    pub expected: String,
}

/// Compares the machine of a recording (keys `machine` and `serial_number`) with the campaign's.
///
/// A missing entry is not a contradiction: recordings by other programs seldom name their machine, and a campaign without a serial number
/// applies to every machine of its name.
///
/// # Errors
/// [`OtherMachine`] if both sides name a machine or a serial number and the two differ.
pub fn same_machine(
    recorded: &BTreeMap<String, String>,
    machine_name: &str,
    serial_number: Option<&str>,
) -> Result<(), OtherMachine> {
    let pairs =
        [("machine", "machine", Some(machine_name)), ("serial_number", "serial number", serial_number)];
    for (key, what, expected) in pairs {
        let is_named = |text: &&str| !text.is_empty();
        let recorded = recorded.get(key).map(String::as_str).filter(is_named);
        if let (Some(recorded), Some(expected)) = (recorded, expected.filter(is_named))
            && recorded != expected
        {
            let (recorded, expected) = (recorded.to_owned(), expected.to_owned());
            return Err(OtherMachine { what, recorded, expected });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(machine: &str, serial_number: &str) -> BTreeMap<String, String> {
        [("machine", machine), ("serial_number", serial_number)]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into()
    }

    #[test]
    fn another_name_or_number_is_another_machine() {
        assert_eq!(same_machine(&recorded("turbo_a", "TA-1"), "turbo_a", Some("TA-1")), Ok(()));
        let other = same_machine(&recorded("turbo_b", "TA-1"), "turbo_a", Some("TA-1")).unwrap_err();
        assert_eq!((other.what, other.recorded.as_str()), ("machine", "turbo_b"));
        let other = same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", Some("TA-1")).unwrap_err();
        assert_eq!((other.what, other.expected.as_str()), ("serial number", "TA-1"));
    }

    #[test]
    fn silence_contradicts_nothing() {
        assert_eq!(same_machine(&BTreeMap::new(), "turbo_a", Some("TA-1")), Ok(()));
        assert_eq!(same_machine(&recorded("", ""), "turbo_a", Some("TA-1")), Ok(()));
        assert_eq!(same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", None), Ok(()));
        assert_eq!(same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", Some("")), Ok(()));
    }
}
