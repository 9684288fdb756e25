//! Who may see a page and press its buttons: served names, origin and token of a request; the address on the command line.

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;

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
    /// The token; `None` if none is needed.
    token: Option<String>,
    /// Accepted host names; `None`: any, because the token is required.
    hosts: Option<Vec<String>>,
    /// `http` or `https`, as used by the server's own page.
    scheme: &'static str,
    /// Name of the cookie that holds the token: cookies are those of a host, whatever its port.
    cookie: String,
    /// Path of the only button that needs no token, because it receives one.
    sign_in: Option<&'static str>,
}

/// The only value of a header. A duplicate header is ambiguous, so neither is used.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let (first, second) = (values.next(), values.next());
    first.filter(|_| second.is_none()).and_then(|value| value.to_str().ok())
}

/// Before every request: refuses another name or page, and a button without the token.
pub(crate) async fn guard(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let only_reads = request.method().is_safe();
    let needs_token = access.sign_in != Some(request.uri().path());
    let mut response = match access.refusal(only_reads, needs_token, request.headers()) {
        Some(status) => status.into_response(),
        None => next.run(request).await,
    };
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        // Stricter, and browsers name no origin when they send a form.
        (header::REFERRER_POLICY, "same-origin"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

impl Access {
    pub(crate) fn new(address: SocketAddr, token: Option<String>, encrypted: bool) -> Self {
        let port = address.port();
        let local_names = ["127.0.0.1", "localhost", "[::1]"].map(|name| format!("{name}:{port}"));
        let hosts = (!address.ip().is_unspecified()).then(|| {
            let host_name = address.to_string();
            local_names.into_iter().filter(|_| address.ip().is_loopback()).chain([host_name]).collect()
        });
        let (scheme, cookie) = (if encrypted { "https" } else { "http" }, format!("mapper_{port}"));
        Access { token, hosts, scheme, cookie, sign_in: None }
    }

    /// The same with a path at which a token is exchanged for a cookie.
    pub(crate) fn with_sign_in(self, path: &'static str) -> Self {
        Access { sign_in: Some(path), ..self }
    }

    fn refusal(&self, only_reads: bool, needs_token: bool, headers: &HeaderMap) -> Option<StatusCode> {
        let own_page = self.is_of_own_page(headers);
        let other_page = headers.contains_key(header::ORIGIN) && !own_page;
        let may_press = only_reads || (own_page && (!needs_token || self.has_token(headers)));
        (!self.has_own_host(headers) || other_page || !may_press).then_some(StatusCode::FORBIDDEN)
    }

    /// Whether the request uses the server's own host name. This rejects pages that reach the address by DNS rebinding.
    fn has_own_host(&self, headers: &HeaderMap) -> bool {
        let Some(host) = only(headers, &header::HOST) else { return false };
        self.hosts
            .as_ref()
            .is_none_or(|hosts| hosts.iter().any(|host_name| host_name.eq_ignore_ascii_case(host)))
    }

    /// Whether the request comes from the server's own page. Browsers report the origin with every request that changes something.
    fn is_of_own_page(&self, headers: &HeaderMap) -> bool {
        let host_name = only(headers, &header::HOST).map(|host| format!("{}://{host}", self.scheme));
        let origin = only(headers, &header::ORIGIN);
        origin.is_some() && origin == host_name.as_deref()
    }

    /// Whether the request has the token, if required: in its own header, or in the cookie of who has signed in.
    pub(crate) fn has_token(&self, headers: &HeaderMap) -> bool {
        let bearer = || only(headers, &header::AUTHORIZATION)?.strip_prefix("Bearer ");
        let cookie = || {
            let mut cookies =
                only(headers, &header::COOKIE)?.split(';').filter_map(|cookie| cookie.trim().split_once('='));
            cookies.find(|(name, _)| *name == self.cookie).map(|(_, value)| value)
        };
        self.token.is_none() || bearer().or_else(cookie).is_some_and(|received| self.is_token(received))
    }

    /// The comparison takes the same time for any token of the right length.
    fn is_token(&self, received: &str) -> bool {
        let Some(token) = &self.token else { return false };
        let difference = received.len() ^ token.len();
        let pairs = received.bytes().zip(token.bytes());
        pairs.fold(difference, |difference, (a, b)| difference | usize::from(a ^ b)) == 0
    }

    /// The cookie for a browser that knows the token. Other pages cannot send it, and no script can read it.
    pub(crate) fn cookie(&self, received: &str) -> Option<String> {
        let secure = if self.scheme == "https" { "; Secure" } else { "" };
        let cookie = || format!("{}={received}; Path=/; HttpOnly; SameSite=Strict{secure}", self.cookie);
        self.is_token(received).then(cookie)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(given: &[(HeaderName, &str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in given {
            headers.append(name, HeaderValue::from_str(value).unwrap());
        }
        headers
    }

    const REFUSED: Option<StatusCode> = Some(StatusCode::FORBIDDEN);

    #[test]
    fn another_name_another_page_and_another_token_are_refused() {
        let access = Access::new("127.0.0.1:7373".parse().unwrap(), None, false);
        let press = |host: &str, origin: &str| {
            access.refusal(false, true, &headers(&[(header::HOST, host), (header::ORIGIN, origin)]))
        };
        for name in ["127.0.0.1:7373", "localhost:7373", "LocalHost:7373", "[::1]:7373"] {
            assert_eq!(access.refusal(true, true, &headers(&[(header::HOST, name)])), None, "{name}");
        }
        assert_eq!(
            press("127.0.0.1:7373", "http://127.0.0.1:7373"),
            None,
            "no token is needed on this machine"
        );
        for (host, origin) in [
            ("evil.example:7373", "http://evil.example:7373"),
            ("localhost:80", "http://localhost:80"),
            ("127.0.0.1:7373", "http://evil.example"),
            ("127.0.0.1:7373", "https://127.0.0.1:7373"),
            ("127.0.0.1:7373", "null"),
        ] {
            assert_eq!(press(host, origin), REFUSED, "{host} {origin}");
        }
        let here = (header::HOST, "127.0.0.1:7373");
        assert_eq!(
            access.refusal(false, true, &headers(std::slice::from_ref(&here))),
            REFUSED,
            "a button of no page"
        );
        let eyes = headers(&[here.clone(), (header::ORIGIN, "http://evil.example")]);
        assert_eq!(access.refusal(true, true, &eyes), REFUSED, "another page's eyes");
        assert_eq!(
            access.refusal(true, true, &headers(&[here.clone(), here])),
            REFUSED,
            "two names are none"
        );
        assert_eq!(access.refusal(true, true, &HeaderMap::new()), REFUSED);

        let remote = Access::new("192.0.2.7:7373".parse().unwrap(), Some("abc".to_owned()), true);
        let host = (header::HOST, "192.0.2.7:7373");
        for (received, right) in
            [("Bearer abc", true), ("Bearer abd", false), ("Bearer ab", false), ("abc", false)]
        {
            let authorization = (header::AUTHORIZATION, received);
            let own = (header::ORIGIN, "https://192.0.2.7:7373");
            let refusal = remote.refusal(false, true, &headers(&[host.clone(), own, authorization.clone()]));
            assert_eq!(refusal.is_none(), right, "{received}");
            let clear = (header::ORIGIN, "http://192.0.2.7:7373");
            let refusal = remote.refusal(false, true, &headers(&[host.clone(), clear, authorization]));
            assert_eq!(refusal, REFUSED, "a page in clear is another one");
        }
        assert!(!remote.has_token(&headers(&[host])));
        let cookie = remote.cookie("abc").unwrap();
        assert!(cookie.ends_with("; HttpOnly; SameSite=Strict; Secure") && remote.cookie("ab").is_none());
        for (sent, right) in
            [("a=b; mapper_7373=abc", true), ("mapper_7373=abcd", false), ("mapper_80=abc", false)]
        {
            assert_eq!(remote.has_token(&headers(&[(header::COOKIE, sent)])), right, "{sent}");
        }
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
