//! Addresses in settings.

use serde::de::{Deserialize, Deserializer, Error};
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
