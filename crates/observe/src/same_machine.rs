//! Whether a recording was made on the machine that a campaign names.

use std::collections::BTreeMap;

/// A recording of another machine than the campaign's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the recording was made on another machine: {what} `{recorded}`, the campaign names `{expected}`")]
pub struct OtherMachine {
    /// What differs: `machine` or `serial number`.
    pub what: &'static str,
    /// As the recording has it.
    pub recorded: String,
    /// As the campaign has it.
    pub expected: String,
}

/// Compares what a recording says of its machine (keys `machine` and `serial_number`) with the campaign's.
///
/// An absent or empty entry says nothing, on either side, so it contradicts nothing: recordings made by other programs
/// seldom name their machine, and a campaign without a serial number is for every machine of its name. Whether two
/// recordings are of one machine is another question, which their fingerprints answer.
///
/// # Errors
/// [`OtherMachine`] where both sides name a machine or a serial number and the two differ.
pub fn same_machine(
    recorded: &BTreeMap<String, String>,
    machine_name: &str,
    serial_number: Option<&str>,
) -> Result<(), OtherMachine> {
    let pairs =
        [("machine", "machine", Some(machine_name)), ("serial_number", "serial number", serial_number)];
    for (key, what, expected) in pairs {
        let said = |text: &&str| !text.is_empty();
        let recorded = recorded.get(key).map(String::as_str).filter(said);
        if let (Some(recorded), Some(expected)) = (recorded, expected.filter(said))
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
