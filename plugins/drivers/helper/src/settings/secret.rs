//! Secrets are read from the environment; settings name the variable.

use serde_json::Value;

/// Why a secret is unavailable.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SecretError {
    #[error("write `{{env: NAME}}`, the name of an environment variable that holds it")]
    Form,
    #[error("the environment variable {0} is not set")]
    NotSet(String),
}

/// The secret named by a setting `{env: NAME}`; `None` for `null`.
///
/// # Errors
/// [`SecretError`], which never contains the secret.
pub fn secret(setting: &Value) -> Result<Option<String>, SecretError> {
    if setting.is_null() {
        return Ok(None);
    }
    let name = setting.get("env").and_then(Value::as_str).ok_or(SecretError::Form)?;
    // An empty variable counts as not set.
    let value = std::env::var(name).ok().filter(|value| !value.is_empty());
    value.map(Some).ok_or_else(|| SecretError::NotSet(name.to_owned()))
}
