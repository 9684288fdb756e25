//! Reads one request from an untrusted client, and decides what it may do: served addresses, access control for page and buttons.

use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

/// Maximum size of a request head, bytes.
const MAX_HEAD_BYTES: usize = 8192;
/// Maximum number of headers.
const MAX_HEADERS: usize = 64;
/// Maximum time for a request to arrive.
pub(crate) const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: String,
    pub(crate) path: String,
    host: Option<String>,
    pub(crate) origin: Option<String>,
    authorization: Option<String>,
}

/// Reads the head of a request; the body is ignored. `None` if it is invalid, too long, or too slow.
pub(crate) fn read_request(stream: &mut impl Read) -> Option<Request> {
    let deadline = Instant::now() + REQUEST_TIMEOUT;
    let (mut head, mut piece) = (Vec::new(), [0; 1024]);
    loop {
        let count = stream.read(&mut piece).ok().filter(|count| *count > 0)?;
        head.extend_from_slice(&piece[..count]);
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        if parsed.parse(&head).ok()?.is_complete() {
            return convert_request(&parsed);
        }
        if head.len() > MAX_HEAD_BYTES || Instant::now() > deadline {
            return None;
        }
    }
}

fn convert_request(parsed: &httparse::Request<'_, '_>) -> Option<Request> {
    // A duplicate header is ambiguous, so neither is used.
    let header = |name: &str| {
        let mut values = parsed.headers.iter().filter(|header| header.name.eq_ignore_ascii_case(name));
        let (first, second) = (values.next(), values.next());
        first.filter(|_| second.is_none()).and_then(|header| String::from_utf8(header.value.to_vec()).ok())
    };
    Some(Request {
        method: parsed.method?.to_owned(),
        path: parsed.path?.to_owned(),
        host: header("host"),
        origin: header("origin"),
        authorization: header("authorization"),
    })
}

/// An address with its port, `localhost` with a port, or a port of this computer, from a command line.
pub fn parse_address(text: &str) -> Result<SocketAddr, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or(("localhost", text));
    let address = if host.eq_ignore_ascii_case("localhost") {
        port.parse().map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port))).ok()
    } else {
        text.parse().ok()
    };
    address.ok_or_else(|| {
        "write a port, e.g. 7373, or localhost:7373, or 0.0.0.0:7373 for other computers too".to_owned()
    })
}

#[derive(Debug, Clone)]
pub(crate) struct Access {
    /// The token, required on every address except the loopback address.
    token: Option<String>,
    /// Accepted host names; `None`: any, because the token is required.
    hosts: Option<Vec<String>>,
    /// `http` or `https`, as used by the server's own page.
    scheme: &'static str,
}

impl Access {
    pub(crate) fn new(address: SocketAddr, token: Option<String>, encrypted: bool) -> Self {
        let port = address.port();
        let local_names = ["127.0.0.1", "localhost", "[::1]"].map(|name| format!("{name}:{port}"));
        let hosts = (!address.ip().is_unspecified()).then(|| {
            let host_name = address.to_string();
            local_names.into_iter().filter(|_| address.ip().is_loopback()).chain([host_name]).collect()
        });
        Access { token, hosts, scheme: if encrypted { "https" } else { "http" } }
    }

    /// Whether the request uses the server's own host name. This rejects pages that reach the address by DNS rebinding.
    pub(crate) fn has_own_host(&self, request: &Request) -> bool {
        let Some(host) = &request.host else { return false };
        self.hosts
            .as_ref()
            .is_none_or(|hosts| hosts.iter().any(|host_name| host_name.eq_ignore_ascii_case(host)))
    }

    /// Whether the request comes from the server's own page. Browsers report the origin with every request that changes something.
    pub(crate) fn is_of_own_page(&self, request: &Request) -> bool {
        let host_name = request.host.as_ref().map(|host| format!("{}://{host}", self.scheme));
        request.origin.is_some() && request.origin == host_name
    }

    pub(crate) fn is_of_another_page(&self, request: &Request) -> bool {
        request.origin.is_some() && !self.is_of_own_page(request)
    }

    /// Whether the request has the token, if required. The comparison takes the same time for any token of the right length.
    pub(crate) fn has_token(&self, request: &Request) -> bool {
        let Some(token) = &self.token else { return true };
        let received =
            request.authorization.as_deref().and_then(|text| text.strip_prefix("Bearer ")).unwrap_or("");
        let difference = received.len() ^ token.len();
        let difference =
            received.bytes().zip(token.bytes()).fold(difference, |d, (a, b)| d | usize::from(a ^ b));
        difference == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_read_and_what_is_none_is_refused() {
        let read = |text: &[u8]| read_request(&mut &text[..]);
        let request = read(b"GET /events HTTP/1.1\r\nHost: a:1\r\nOrigin: http://a:1\r\n\r\n").unwrap();
        assert_eq!((request.method.as_str(), request.path.as_str()), ("GET", "/events"));
        assert_eq!((request.host.as_deref(), request.origin.as_deref()), (Some("a:1"), Some("http://a:1")));
        let twice = read(b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n").unwrap();
        assert_eq!(twice.host, None);
        assert_eq!(read(b""), None);
        assert_eq!(read(b"GET / HTTP/1.1\r\nHost"), None, "the head never ends");
        assert_eq!(read(&[0xff; 64]), None);
        assert_eq!(read(&[b'a'; 100_000]), None);
        let many = [b"GET / HTTP/1.1\r\n".as_slice(), &b"a: b\r\n".repeat(100), b"\r\n"].concat();
        assert_eq!(read(&many), None);
    }

    fn request(host: &str, origin: Option<&str>, authorization: Option<&str>) -> Request {
        Request {
            method: "POST".to_owned(),
            path: "/ask/hold".to_owned(),
            host: Some(host.to_owned()),
            origin: origin.map(str::to_owned),
            authorization: authorization.map(str::to_owned),
        }
    }

    #[test]
    fn another_name_another_page_and_another_token_are_refused() {
        let local_names = Access::new("127.0.0.1:7373".parse().unwrap(), None, false);
        assert!(local_names.has_own_host(&request("localhost:7373", None, None)));
        assert!(!local_names.has_own_host(&request("evil.example:7373", None, None)));
        assert!(!local_names.has_own_host(&request("localhost:80", None, None)));
        let from = |origin| request("127.0.0.1:7373", origin, None);
        assert!(local_names.is_of_own_page(&from(Some("http://127.0.0.1:7373"))));
        assert!(!local_names.is_of_own_page(&from(Some("http://evil.example"))));
        assert!(!local_names.is_of_own_page(&from(Some("null"))) && !local_names.is_of_own_page(&from(None)));
        assert!(local_names.has_token(&from(None)), "none is needed on this machine");

        let remote_server = Access::new("192.0.2.7:7373".parse().unwrap(), Some("abc".to_owned()), true);
        assert!(!remote_server.has_own_host(&request("localhost:7373", None, None)));
        for (received, right) in
            [("Bearer abc", true), ("Bearer abd", false), ("Bearer ab", false), ("abc", false)]
        {
            assert_eq!(
                remote_server.has_token(&request("192.0.2.7:7373", None, Some(received))),
                right,
                "{received}"
            );
        }
        assert!(!remote_server.has_token(&request("192.0.2.7:7373", None, None)));
        let from = |origin| request("192.0.2.7:7373", Some(origin), None);
        assert!(remote_server.is_of_own_page(&from("https://192.0.2.7:7373")));
        assert!(
            !remote_server.is_of_own_page(&from("http://192.0.2.7:7373")),
            "a page in clear is another one"
        );
    }

    #[test]
    fn an_address_is_a_port_the_name_of_this_computer_or_a_number() {
        for (text, address) in [
            ("7373", "127.0.0.1:7373"),
            ("localhost:7373", "127.0.0.1:7373"),
            ("LocalHost:0", "127.0.0.1:0"),
            ("[::1]:7373", "[::1]:7373"),
            ("0.0.0.0:80", "0.0.0.0:80"),
        ] {
            assert_eq!(parse_address(text).unwrap(), address.parse().unwrap(), "{text}");
        }
        for text in ["", "localhost", "localhost:", "localhost:99999", "99999", "1.2.3", "1.2.3.4", "a b:1"] {
            assert!(parse_address(text).is_err(), "{text}");
        }
    }
}
