//! Keys whose values are text: in a file, or in the options of a command.

/// Maximum number of characters of a wrong key or value in a message.
const MAX_SHOWN: usize = 60;

/// One key of a description `T`.
#[derive(Debug, Clone)]
pub struct Key<T> {
    /// Name in the file, and in the options of the commands.
    pub name: &'static str,
    /// Description in one line.
    pub description: &'static str,
    /// Example of a value.
    pub example: &'static str,
    /// Stores the value of a text; `None` if the text is not a value of the key.
    pub set: fn(&mut T, &str) -> Option<()>,
}

/// An unknown key, or an invalid value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum KeyError {
    #[error("there is no key `{key}`; the keys are {known}")]
    Unknown { key: String, known: String },
    #[error("`{value}` is not a value of `{key}`; write e.g. `{example}`")]
    Value { key: &'static str, value: String, example: &'static str },
}

/// Sets the key `name` of a description.
pub fn set_key<T>(keys: &[Key<T>], description: &mut T, name: &str, value: &str) -> Result<(), KeyError> {
    let shown = |text: &str| text.chars().take(MAX_SHOWN).collect();
    let Some(key) = keys.iter().find(|key| key.name == name) else {
        let names: Vec<&str> = keys.iter().map(|key| key.name).collect();
        return Err(KeyError::Unknown { key: shown(name), known: names.join(", ") });
    };
    (key.set)(description, value).ok_or_else(|| KeyError::Value {
        key: key.name,
        value: shown(value),
        example: key.example,
    })
}

/// Stores a value that was parsed; `None` if there is none.
pub fn store<T>(field: &mut Option<T>, value: Option<T>) -> Option<()> {
    *field = Some(value?);
    Some(())
}
