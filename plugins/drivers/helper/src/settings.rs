//! Values that settings of several drivers contain.

use mapper_core::Channel;
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde_json::Value;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::net::SocketAddr;

/// Reads `127.0.0.1:5020`, for `#[serde(deserialize_with = "mapper_driver::address")]`. Host names are refused: a look-up may hang, and
/// every call of a driver must return in time.
///
/// # Errors
/// If it is not an address; the message shows the format.
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
///
/// # Errors
/// If a key is not a channel or is repeated, or if a value is invalid.
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
