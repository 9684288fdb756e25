//! Secrets are read from the environment only.

use crate::find::DriverError;
use serde_json::Value;

/// A setting is secret if its key contains one of these, without regard to capitals and separators.
const SECRET_KEYS: [&str; 12] = [
    "password",
    "passwd",
    "passphrase",
    "passcode",
    "pwd",
    "secret",
    "token",
    "credential",
    "apikey",
    "accesskey",
    "privatekeytext",
    "authorization",
];
/// What comes before `pass` in the name of a filter or a valve.
const NOT_SECRET_BEFORE_PASS: [&str; 5] = ["low", "high", "band", "all", "by"];
const PLACEHOLDER: &str = "[secret]";
/// Shorter secrets are hidden only as whole words, because replacing them inside other words would remove whole sentences.
const MIN_REPLACED_LENGTH: usize = 6;
/// Maximum nesting of settings that is searched; the YAML reader allows less.
const MAX_DEPTH: usize = 64;

#[derive(Default)]
pub(crate) struct Secrets(Vec<String>);

impl Secrets {
    /// Collects the values that `settings` refer to; `variable` reads an environment variable. `needed`: every variable must be set.
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
                Some(secret) if !secret.is_empty() => {
                    // A driver may report only the password of an address.
                    self.0.extend(url_password(&secret).map(str::to_owned));
                    self.0.push(secret);
                }
                _ if needed => return Err((path.join("."), DriverError::NotSet(name.to_owned()))),
                _ => {}
            }
            return Ok(());
        }
        let has_secret_key = path.last().is_some_and(|key| is_secret_key(key)) && !value.is_null();
        if has_secret_key || value.as_str().is_some_and(contains_secret) {
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

fn is_secret_key(key: &str) -> bool {
    let key: String = key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let is_pass = key
        .strip_suffix("pass")
        .is_some_and(|before| !NOT_SECRET_BEFORE_PASS.iter().any(|word| before.ends_with(word)));
    is_pass || SECRET_KEYS.iter().any(|secret| key.contains(secret))
}

/// Whether a text contains a secret: an address with a password, or a pair `key=value` with a secret key.
fn contains_secret(text: &str) -> bool {
    let mut pairs = text.split(['?', '&', ';', ',', ' ', '#']).filter_map(|pair| pair.split_once('='));
    url_password(text).is_some() || pairs.any(|(key, value)| !value.trim().is_empty() && is_secret_key(key))
}

/// The password in an address such as `opc.tcp://user:password@host`.
fn url_password(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once("://")?;
    let authority = rest.split(['/', '?', '#']).next().unwrap_or(rest);
    let (user, _) = authority.rsplit_once('@')?;
    let (_, password) = user.split_once(':')?;
    (!password.is_empty()).then_some(password)
}

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
        for refused in [
            json!({"pwd": "hunter2"}),
            json!({"Pass": "hunter2"}),
            json!({"user_pass": 1234}),
            json!({"userPwd": "hunter2"}),
            json!({"api_key": "hunter2"}),
            json!({"apiKey": "hunter2"}),
            json!({"API-KEY": "hunter2"}),
            json!({"headers": {"Authorization": "Bearer hunter2"}}),
            json!({"address": "opc.tcp://lab:hunter2@plc:4840"}),
            json!({"urls": ["http://plc/?x=1&access_token=hunter2"]}),
            json!({"connection": "Server=plc;Uid=lab;Pwd=hunter2"}),
        ] {
            let (_, error) = read(refused.clone()).err().unwrap_or_else(|| panic!("{refused} is accepted"));
            assert!(matches!(error, DriverError::Secret), "{refused}");
        }
        for plain in [
            json!({"low_pass": "10 Hz", "bypass": "open", "passes": 3, "pin": 4, "monkey": "x"}),
            json!({"address": "opc.tcp://lab@plc:4840/path", "private_key": "keys/plc.pem"}),
            json!({"address": "http://plc:80/a@b", "node": "ns=2;s=acknowledge"}),
        ] {
            assert!(read(plain.clone()).is_ok(), "{plain}");
        }
        let address = |_: &str| Some("opc.tcp://lab:hunter2@plc".to_owned());
        let secrets = Secrets::of(&json!({"address": {"env": "A"}}), &address, true).ok().unwrap();
        assert_eq!(secrets.hide("login of lab with hunter2 failed"), "login of lab with [secret] failed");
        // For a driver with its own environment, variables known here are hidden and missing ones are not an error.
        let both = json!([{"env": "PLC"}, {"env": "NOT_THERE"}]);
        let secrets = Secrets::of(&both, &variable, false).ok().unwrap();
        assert_eq!(secrets.hide("with hunter2"), "with [secret]");
    }
}
