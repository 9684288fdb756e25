//! Secrets are read from the environment only.

use crate::error::DriverError;
use serde_json::Value;

/// A setting is secret if its key contains one of these.
const SECRET_KEYS: [&str; 5] = ["password", "passphrase", "secret", "token", "private_key_text"];
const PLACEHOLDER: &str = "[secret]";
/// Shorter secrets are hidden only as whole words, because replacing them inside other words would remove whole sentences.
const MIN_REPLACED_LENGTH: usize = 6;
/// Maximum nesting of settings that is searched; the YAML reader allows less.
const MAX_DEPTH: usize = 64;

/// Environment values that settings refer to.
#[derive(Default)]
pub(crate) struct Secrets(Vec<String>);

impl Secrets {
    /// Collects the values that `settings` refer to; `variable` reads an environment variable. `needed`: every variable must be set.
    ///
    /// # Errors
    /// The key path and [`DriverError::Secret`] if the settings contain a secret, [`DriverError::NotSet`] for a missing variable.
    pub(crate) fn of(
        settings: &Value,
        variable: &dyn Fn(&str) -> Option<String>,
        needed: bool,
    ) -> Result<Secrets, (String, DriverError)> {
        let mut secrets = Secrets::default();
        secrets.collect(settings, &mut Vec::new(), variable, needed)?;
        // Longest first: otherwise a secret that is a prefix of another would leave the remainder visible.
        secrets.0.sort_by_key(|secret| std::cmp::Reverse(secret.len()));
        Ok(secrets)
    }

    fn collect(
        &mut self,
        value: &Value,
        path: &mut Vec<String>,
        variable: &dyn Fn(&str) -> Option<String>,
        needed: bool,
    ) -> Result<(), (String, DriverError)> {
        if let Some(name) = env_variable(value) {
            match variable(name) {
                Some(secret) if !secret.is_empty() => self.0.push(secret),
                _ if needed => return Err((path.join("."), DriverError::NotSet(name.to_owned()))),
                _ => {}
            }
            return Ok(());
        }
        let key = path.last().map(|key| key.to_ascii_lowercase()).unwrap_or_default();
        if SECRET_KEYS.iter().any(|secret| key.contains(secret)) && !value.is_null() {
            return Err((path.join("."), DriverError::Secret));
        }
        if path.len() >= MAX_DEPTH {
            return Ok(());
        }
        let inside: Vec<(String, &Value)> = match value {
            Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), value)).collect(),
            Value::Array(list) => list.iter().enumerate().map(|(i, value)| (i.to_string(), value)).collect(),
            _ => Vec::new(),
        };
        for (key, value) in inside {
            path.push(key);
            self.collect(value, path, variable, needed)?;
            path.pop();
        }
        Ok(())
    }

    /// Replaces the secrets in a driver's text.
    pub(crate) fn hide(&self, text: &str) -> String {
        self.0.iter().fold(text.to_owned(), |text, secret| {
            if secret.chars().count() < MIN_REPLACED_LENGTH {
                hide_word(&text, secret)
            } else {
                text.replace(secret.as_str(), PLACEHOLDER)
            }
        })
    }
}

/// Replaces a word in a text.
fn hide_word(text: &str, word: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut from = 0;
    for (at, found) in text.match_indices(word) {
        let end = at + found.len();
        let before = text[..at].chars().next_back().is_some_and(char::is_alphanumeric);
        let after = text[end..].chars().next().is_some_and(char::is_alphanumeric);
        out.push_str(&text[from..at]);
        out.push_str(if before || after { found } else { PLACEHOLDER });
        from = end;
    }
    out.push_str(&text[from..]);
    out
}

/// The variable in `{env: NAME}`.
fn env_variable(value: &Value) -> Option<&str> {
    let map = value.as_object().filter(|map| map.len() == 1)?;
    map.get("env")?.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn secrets_are_read_from_the_environment_and_hidden() {
        let variable = |name: &str| (name == "PLC").then(|| "hunter2".to_owned());
        let read = |settings: Value| Secrets::of(&settings, &variable, true);
        let secrets = read(json!({"user": "lab", "security": {"password": {"env": "PLC"}}})).ok().unwrap();
        assert_eq!(secrets.hide("login of lab with hunter2 failed"), "login of lab with [secret] failed");
        let two = |name: &str| Some(if name == "A" { "hunter" } else { "hunter2" }.to_owned());
        let secrets = Secrets::of(&json!([{"env": "A"}, {"env": "B"}]), &two, true).ok().unwrap();
        assert_eq!(secrets.hide("hunter2, hunter"), "[secret], [secret]");
        let short = |_: &str| Some("me".to_owned());
        let secrets = Secrets::of(&json!({"env": "A"}), &short, true).ok().unwrap();
        assert_eq!(
            secrets.hide("message for me: (me) meets me"),
            "message for [secret]: ([secret]) meets [secret]"
        );
        let (path, error) = read(json!({"security": [{"Password": "hunter2"}]})).err().unwrap();
        assert_eq!(path, "security.0.Password");
        assert!(!error.to_string().contains("hunter2"));
        let (path, error) = read(json!({"token": {"env": "NOT_THERE"}})).err().unwrap();
        assert_eq!((path.as_str(), error.to_string().contains("NOT_THERE")), ("token", true));
        assert!(read(json!({"password": null, "host": "x"})).is_ok());
        // For a driver with its own environment, variables known here are hidden and missing ones are not an error.
        let both = json!([{"env": "PLC"}, {"env": "NOT_THERE"}]);
        let secrets = Secrets::of(&both, &variable, false).ok().unwrap();
        assert_eq!(secrets.hide("with hunter2"), "with [secret]");
    }
}
