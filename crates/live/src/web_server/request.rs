//! Reads one request from an untrusted client.

use std::io::Read;
use std::time::{Duration, Instant};

/// Maximum size of a request head, bytes.
const MAX_HEAD_BYTES: usize = 8192;
/// Maximum number of headers.
const MAX_HEADERS: usize = 64;
/// Maximum time for a request to arrive.
pub(crate) const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);

/// The fields of a request that are used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: String,
    pub(crate) path: String,
    pub(crate) host: Option<String>,
    pub(crate) origin: Option<String>,
    pub(crate) authorization: Option<String>,
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
}
