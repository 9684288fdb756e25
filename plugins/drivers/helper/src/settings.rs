//! Settings of a driver, and what it refuses.

use mapper_core::{BackendError, Channel};
use mapper_driver_host::protocol::{Code, Failure, write_error};
use serde::de::{Deserialize, DeserializeOwned, DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::marker::PhantomData;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Reads `127.0.0.1:5020`, for `#[serde(deserialize_with = "mapper_driver::address")]`. Host names are refused: a look-up may hang, and
/// every call of a driver must return in time.
pub fn address<'de, D: Deserializer<'de>>(from: D) -> Result<SocketAddr, D::Error> {
    let text = String::deserialize(from)?;
    text.parse().map_err(|_| D::Error::custom(remedy(&text)))
}

fn remedy(text: &str) -> String {
    let wants = "write a numeric address with its port, such as 192.168.0.7:502";
    match text.rsplit_once(':') {
        Some(("localhost", port)) => format!("`{text}` is a name; {wants}: here 127.0.0.1:{port}"),
        Some((host, port))
            if port.parse::<u16>().is_ok() && host.contains(|c: char| c.is_ascii_alphabetic()) =>
        {
            format!("`{text}` is a name; {wants} (`getent hosts {host}` shows them)")
        }
        _ => format!("`{text}` is not an address; {wants}"),
    }
}

/// Reads a map from channels, for `#[serde(deserialize_with = "mapper_driver::by_channel")]`. Its keys are read as text: otherwise
/// `serde_path_to_error` would report an error at `read.?.node`.
pub fn by_channel<'de, T, D>(from: D) -> Result<BTreeMap<Channel, T>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    struct Channels<T>(PhantomData<T>);

    /// A value at this key. An invalid key is reported at the key itself too.
    struct At<T>(String, PhantomData<T>);

    impl<'de, T: Deserialize<'de>> DeserializeSeed<'de> for At<T> {
        type Value = (Channel, T);

        fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Self::Value, D::Error> {
            let channel = self.0.parse::<Channel>().map_err(D::Error::custom)?;
            Ok((channel, T::deserialize(from)?))
        }
    }

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Channels<T> {
        type Value = BTreeMap<Channel, T>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("the place of each channel, by its symbol")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut found = BTreeMap::new();
            while let Some(symbol) = map.next_key::<String>()? {
                let (channel, value) = map.next_value_seed(At(symbol, PhantomData))?;
                if found.insert(channel, value).is_some() {
                    return Err(A::Error::custom(format!("the channel {channel} appears twice")));
                }
            }
            Ok(found)
        }
    }

    from.deserialize_map(Channels(PhantomData))
}

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
pub fn secret(setting: &Value) -> Result<Option<String>, SecretError> {
    if setting.is_null() {
        return Ok(None);
    }
    let name = setting.get("env").and_then(Value::as_str).ok_or(SecretError::Form)?;
    // An empty variable counts as not set.
    let value = std::env::var(name).ok().filter(|value| !value.is_empty());
    value.map(Some).ok_or_else(|| SecretError::NotSet(name.to_owned()))
}

/// Why a request is refused.
pub(crate) type Refusal = Box<Failure>;

pub(crate) fn refusal(code: Code, message: impl Into<String>) -> Refusal {
    Box::new(Failure::new(code, message))
}

pub(crate) fn missing_settings() -> Refusal {
    refusal(Code::OutOfOrder, "no settings were sent; send `configure` first")
}

pub(crate) fn read_params<T: DeserializeOwned>(params: &Value) -> Result<T, Refusal> {
    T::deserialize(params).map_err(|error| refusal(Code::Params, error.to_string()))
}

pub(crate) fn write_result(value: &impl serde::Serialize) -> Result<Value, Refusal> {
    serde_json::to_value(value).map_err(|error| refusal(Code::Failed, error.to_string()))
}

pub(crate) fn call_author_code<T>(call: impl FnOnce() -> Result<T, BackendError>) -> Result<T, Refusal> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(answer) => answer.map_err(|error| Box::new(write_error(&error))),
        Err(_) => Err(refusal(Code::Lost, "the driver failed; its standard error has the reason")),
    }
}

/// Time without a failure after which it is over, s: long enough that a failure of every second sample is one.
const QUIET_S: f64 = 3.0;
/// Maximum number of reported reasons: a reason may contain a number that always differs.
const MAX_REASONS: usize = 5;

/// A failure of one kind.
#[derive(Debug, Default)]
pub struct Outage {
    reasons: BTreeSet<String>,
    samples: usize,
    last_s: f64,
}

impl Outage {
    /// Takes the failure of the sample at this run time, s, or `None` without one. Returns a message that begins with `what`, if there is something to report.
    pub fn update(&mut self, what: &str, t_s: f64, failure: Option<String>) -> Option<String> {
        if let Some(reason) = failure {
            (self.samples, self.last_s) = (self.samples + 1, t_s);
            let message = format!("{what}: {reason}");
            let is_new = self.reasons.len() < MAX_REASONS && self.reasons.insert(reason);
            return is_new.then_some(message);
        }
        if self.samples == 0 || t_s - self.last_s < QUIET_S {
            return None;
        }
        let ended = std::mem::take(self);
        Some(format!(
            "{what}: over since {:.1} s; number of affected samples: {}",
            ended.last_s, ended.samples
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn an_address_is_numeric_and_a_name_is_refused_with_a_remedy() {
        let read = |value: Value| address(value).map_err(|error: serde_json::Error| error.to_string());
        assert_eq!(read(json!("127.0.0.1:5020")).unwrap(), SocketAddr::from(([127, 0, 0, 1], 5020)));
        assert!(read(json!("[::1]:5020")).unwrap().is_ipv6());
        for (text, expected) in [
            ("localhost:5021", "`localhost:5021` is a name"),
            ("localhost:5021", "here 127.0.0.1:5021"),
            ("plc.cell3:502", "`getent hosts plc.cell3`"),
            ("127.0.0.1", "`127.0.0.1` is not an address"),
            ("127.0.0.1:99999", "192.168.0.7:502"),
        ] {
            let message = read(json!(text)).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}

#[cfg(test)]
mod refusal_tests {
    use super::*;

    #[test]
    fn a_failure_that_comes_and_goes_is_reported_once() {
        let mut outage = Outage::default();
        let mut messages = Vec::new();
        for sample in 0..200_u32 {
            let failure = match sample {
                100.. => None,
                _ if sample.is_multiple_of(2) => None,
                50.. => Some(format!("late by {sample} ms")),
                _ => Some("busy".to_owned()),
            };
            messages.extend(outage.update("missing readings", 0.1 * f64::from(sample), failure));
        }
        assert_eq!(messages.len(), MAX_REASONS + 1, "{messages:?}");
        assert_eq!(messages[0], "missing readings: busy");
        assert_eq!(
            messages[MAX_REASONS],
            "missing readings: over since 9.9 s; number of affected samples: 50"
        );
    }
}
