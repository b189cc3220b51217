//! Access by host and origin: the hosts that a request may name, and the pages of other origins that may read.
//!
//! A page can let its own host name resolve to this machine (DNS rebinding) and then has the same origin as the
//! service. Its requests still name that host. The service therefore accepts only loopback hosts and names that a
//! setting allows, and on an address other than loopback literal addresses as well, which no page can be given.

use super::problem::{Kind, Problem};
use super::words::shown;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, Version, header};
use std::net::{IpAddr, SocketAddr};

/// Request hosts and page origins that the service accepts.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    /// True if the service listens on a loopback address.
    loopback: bool,
    /// True if the service itself terminates TLS, so that clients reach it over HTTPS.
    secure: bool,
    /// Host names, besides those of the loopback interface, that requests may address: lower case, without a port.
    names: Vec<String>,
    /// Web origins whose pages may read answers, as browsers serialise origins.
    origins: Vec<String>,
}

/// Class of the web page that makes a request, by its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Page {
    /// The request comes from no page (a plain client) or from a page that this service serves.
    Own,
    /// The page has another origin, and a setting of the service allows this origin to read answers.
    Allowed(HeaderValue),
    /// The page has another origin, and no setting of the service allows this origin to read answers.
    Foreign,
}

impl Access {
    /// Builds the rules for accepted hosts and origins of a service that listens on `address`, with TLS if it is
    /// `secure`. The error names the invalid setting.
    pub(crate) fn new(address: SocketAddr, secure: bool, names: &[String], origins: &[String]) -> Result<Self, String> {
        let names = names.iter().map(|name| name.trim()).filter(|name| !name.is_empty()).map(|name| {
            let (host, port) = split(name).unwrap_or_default();
            if host.is_empty() || port.is_some() || name.ends_with(':') {
                let found = shown(name, 80);
                return Err(format!(
                    "--name: found `{found}`, expected a host without a port, for example lab.example.org"
                ));
            }
            Ok(host)
        });
        let origins = origins.iter().map(|origin| origin.trim()).filter(|origin| !origin.is_empty()).map(|text| {
            Origin::parse(text).map(|origin| origin.text()).ok_or_else(|| {
                let found = shown(text, 80);
                format!("--origin: found `{found}`, expected SCHEME://HOST or SCHEME://HOST:PORT, for example https://app.example.org")
            })
        });
        Ok(Self {
            loopback: address.ip().to_canonical().is_loopback(),
            secure,
            names: names.collect::<Result<_, _>>()?,
            origins: origins.collect::<Result<_, _>>()?,
        })
    }

    /// Returns true if answers depend on the origin of the requesting page (`Vary: origin`).
    pub(crate) fn varies(&self) -> bool {
        !self.origins.is_empty()
    }

    /// Checks the host that `request` names, and returns its text unchanged. Follows RFC 9112 section 3.2 (exactly one
    /// `Host` header in HTTP/1) and RFC 9113 section 8.3.1 (`:authority` in HTTP/2).
    pub(crate) fn host(&self, request: &Request) -> Result<Option<HeaderValue>, Problem> {
        let bad = |detail: &str| Problem::new(Kind::BadHeader, detail);
        let mut fields = request.headers().get_all(header::HOST).iter();
        let field = fields.next();
        if fields.next().is_some() {
            return Err(bad("found more than one header Host, expected one"));
        }
        if field.is_none() && request.version() == Version::HTTP_11 {
            return Err(bad("found no header Host, expected one in a request of HTTP/1.1"));
        }
        let field =
            field.map(|value| value.to_str().map_err(|_| bad("Host: expected a host name, with or without a port")));
        let field = field.transpose()?;
        let authority = request.uri().authority().map(axum::http::uri::Authority::as_str);
        if let (Some(field), Some(authority)) = (field, authority)
            && !field.eq_ignore_ascii_case(authority)
        {
            return Err(bad("Host and the authority of the request differ, expected the same"));
        }
        let Some(named) = authority.or(field) else {
            return match request.version() {
                Version::HTTP_10 if !self.loopback && self.names.is_empty() => Ok(None),
                Version::HTTP_10 => Err(self.misdirected("no host")),
                _ => Err(bad("found neither :authority nor a header Host, expected one of them")),
            };
        };
        let (host, _) = split(named).ok_or_else(|| {
            bad(&format!("Host: found `{}`, expected a host name, with or without a port", shown(named, 80)))
        })?;
        if !self.answers(&host) {
            return Err(self.misdirected(&format!("`{}`", shown(&host, 80))));
        }
        Ok(HeaderValue::from_str(named).ok())
    }

    /// Returns true if the service accepts `host` (lower case, without a port).
    fn answers(&self, host: &str) -> bool {
        // DNS rebinding needs a name, so a literal address is safe. It need not be one of this machine: behind a
        // published port of a container clients name the address of its host.
        is_loopback(host)
            || self.names.iter().any(|name| name == host)
            || (!self.loopback && address_of(host).is_some())
    }

    fn misdirected(&self, found: &str) -> Problem {
        let address = if self.loopback { "a loopback address" } else { "an IP address" };
        let detail = format!(
            "the request names {found}, expected localhost, {address} or a host that --name or WAVELUME_NAMES allows"
        );
        Problem::new(Kind::Misdirected, detail)
    }

    /// Returns true if an answer may tell browsers to reach `host` over TLS only (HSTS, RFC 6797). Excludes names of
    /// the loopback interface, because a browser would apply the rule to every other program on them.
    pub(crate) fn is_secure_only(&self, host: Option<&HeaderValue>) -> bool {
        let names_machine =
            |host: &HeaderValue| host.to_str().ok().and_then(split).is_some_and(|(host, _)| !is_loopback(&host));
        self.secure && host.is_some_and(names_machine)
    }

    /// Classifies the web page that makes a request with `headers` to `host`. Browsers send `Origin` with every request
    /// except plain reads, and `Sec-Fetch-Site` with requests to URLs that they consider trustworthy.
    pub(crate) fn page(&self, headers: &HeaderMap, host: Option<&HeaderValue>) -> Page {
        let mut origins = headers.get_all(header::ORIGIN).iter();
        let Some(origin) = origins.next() else {
            let site = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
            return if matches!(site, None | Some(b"same-origin" | b"none")) { Page::Own } else { Page::Foreign };
        };
        let Some(parsed) = origin.to_str().ok().and_then(Origin::parse).filter(|_| origins.next().is_none()) else {
            return Page::Foreign;
        };
        let host = host.and_then(|host| host.to_str().ok()).and_then(split);
        // A page without TLS may come from whoever is between the browser and the network.
        let own = (!self.secure || parsed.scheme == "https")
            && host.is_some_and(|(host, port)| {
                host == parsed.host && port.or(parsed.default_port()) == parsed.port.or(parsed.default_port())
            });
        if own {
            Page::Own
        } else if self.origins.contains(&parsed.text()) {
            Page::Allowed(origin.clone())
        } else {
            Page::Foreign
        }
    }
}

/// Parses a host (without a port) as an IP address, with or without brackets. Returns `None` for a name.
fn address_of(host: &str) -> Option<IpAddr> {
    host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host).parse().ok()
}

fn is_loopback(host: &str) -> bool {
    address_of(host).is_some_and(|address| address.to_canonical().is_loopback()) || host == "localhost"
}

/// A web origin, serialised as in RFC 6454. The opaque origin `null` is not represented.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Origin {
    scheme: String,
    host: String,
    port: Option<u16>,
}

impl Origin {
    fn parse(text: &str) -> Option<Self> {
        let (scheme, authority) = text.split_once("://")?;
        let letters = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.');
        if !scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            || !scheme.bytes().all(letters)
            || authority.ends_with(':')
        {
            return None;
        }
        let (host, port) = split(authority)?;
        Some(Self { scheme: scheme.to_ascii_lowercase(), host, port })
    }

    fn default_port(&self) -> Option<u16> {
        match self.scheme.as_str() {
            "http" => Some(80),
            "https" => Some(443),
            _ => None,
        }
    }

    /// Serialises a web origin as a browser does: the default port of the scheme is omitted.
    fn text(&self) -> String {
        let Self { scheme, host, port } = self;
        match port.filter(|port| Some(*port) != self.default_port()) {
            Some(port) => format!("{scheme}://{host}:{port}"),
            None => format!("{scheme}://{host}"),
        }
    }
}

/// Splits `host[:port]` into the lower-case host and the port. Returns `None` for any other text.
fn split(authority: &str) -> Option<(String, Option<u16>)> {
    let end = if authority.starts_with('[') {
        authority.find(']')? + 1
    } else {
        authority.find(':').unwrap_or(authority.len())
    };
    let (host, port) = authority.split_at(end);
    let known = match host.strip_prefix('[').and_then(|host| host.strip_suffix(']')) {
        Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
        None => host.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'-' | b'_')),
    };
    let port = match port.strip_prefix(':') {
        None | Some("") => None,
        Some(digits) if digits.bytes().all(|b| b.is_ascii_digit()) => Some(digits.parse().ok()?),
        Some(_) => return None,
    };
    (known && !host.is_empty() && (end == authority.len() || authority[end..].starts_with(':')))
        .then(|| (host.to_ascii_lowercase(), port))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn access(listen: &str, names: &[&str], origins: &[&str]) -> Access {
        let owned = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        Access::new(listen.parse().unwrap(), false, &owned(names), &owned(origins)).unwrap()
    }

    fn status(access: &Access, version: Version, uri: &str, hosts: &[&str]) -> u16 {
        let mut request = Request::builder().version(version).uri(uri);
        for host in hosts {
            request = request.header(header::HOST, *host);
        }
        match access.host(&request.body(Body::empty()).unwrap()) {
            Ok(_) => 200,
            Err(problem) => problem.body().status,
        }
    }

    #[test]
    fn a_loopback_listener_answers_loopback_hosts() {
        for listen in ["127.0.0.1:80", "[::1]:80", "[::ffff:127.0.0.1]:80"] {
            let access = access(listen, &[], &[]);
            for host in ["localhost", "LocalHost:8080", "127.0.0.1", "127.9.8.7:1", "[::1]", "[::1]:8080", "localhost:"]
            {
                assert_eq!(status(&access, Version::HTTP_11, "/", &[host]), 200, "{host}");
            }
            for host in [
                "evil.example",
                "localhost.evil.example",
                "localhost.",
                "127.0.0.1.evil.example",
                "xlocalhost",
                "0.0.0.0",
                "10.0.0.1:8080",
                "[::]",
                "127.1",
                "2130706433",
            ] {
                assert_eq!(status(&access, Version::HTTP_11, "/", &[host]), 421, "{host}");
            }
            for host in
                ["", "a b", "user@localhost", "localhost:x", "localhost:99999", "[::1", "[::1]x", "é", "local/host"]
            {
                assert_eq!(status(&access, Version::HTTP_11, "/", &[host]), 400, "{host:?}");
            }
        }
    }

    #[test]
    fn names_are_allowed_by_a_setting() {
        let local = access("127.0.0.1:80", &["Lab.Example.org", "", "10.0.0.7"], &[]);
        for host in ["lab.example.org", "lab.example.org:8443", "10.0.0.7", "localhost"] {
            assert_eq!(status(&local, Version::HTTP_11, "/", &[host]), 200, "{host}");
        }
        assert_eq!(status(&local, Version::HTTP_11, "/", &["xlab.example.org"]), 421);
        for listen in ["0.0.0.0:80", "[::]:80", "192.168.1.5:80"] {
            let open = access(listen, &[], &[]);
            let named = access(listen, &["lab.example.org"], &[]);
            for access in [&open, &named] {
                for host in ["localhost:8080", "127.0.0.1:8080", "192.168.1.5", "10.0.0.1", "[2001:db8::1]:80"] {
                    assert_eq!(status(access, Version::HTTP_11, "/", &[host]), 200, "{host}");
                }
                for host in ["anything.example", "192.168.1.5.nip.io", "node", "2130706433"] {
                    assert_eq!(status(access, Version::HTTP_11, "/", &[host]), 421, "{host}");
                }
            }
            assert_eq!(status(&open, Version::HTTP_11, "/", &["lab.example.org"]), 421);
            assert_eq!(status(&named, Version::HTTP_11, "/", &["lab.example.org"]), 200);
        }
    }

    #[test]
    fn one_host_is_named_once() {
        let local = access("127.0.0.1:80", &[], &[]);
        assert_eq!(status(&local, Version::HTTP_11, "/", &[]), 400);
        assert_eq!(status(&local, Version::HTTP_11, "/", &["localhost", "localhost"]), 400);
        assert_eq!(status(&local, Version::HTTP_11, "http://evil.example/", &["localhost"]), 400);
        assert_eq!(status(&local, Version::HTTP_11, "http://evil.example/", &["evil.example"]), 421);
        assert_eq!(status(&local, Version::HTTP_2, "http://localhost:1/", &[]), 200);
        assert_eq!(status(&local, Version::HTTP_2, "http://evil.example/", &[]), 421);
        assert_eq!(status(&local, Version::HTTP_2, "/", &[]), 400);
        assert_eq!(status(&local, Version::HTTP_10, "/", &[]), 421);
        assert_eq!(status(&access("0.0.0.0:80", &[], &[]), Version::HTTP_10, "/", &[]), 200);
    }

    #[test]
    fn over_tls_a_page_without_it_is_foreign_and_names_are_for_tls_only() {
        let plain = access("0.0.0.0:80", &[], &[]);
        let secure = Access { secure: true, ..plain.clone() };
        let page = |access: &Access, origin: &'static str, host: &'static str| {
            let headers = HeaderMap::from_iter([(header::ORIGIN, HeaderValue::from_static(origin))]);
            access.page(&headers, Some(&HeaderValue::from_static(host)))
        };
        for (origin, host, expected) in [
            ("https://lab.example.org", "lab.example.org", Page::Own),
            ("https://lab.example.org:8443", "lab.example.org:8443", Page::Own),
            ("http://lab.example.org", "lab.example.org", Page::Foreign),
            ("http://lab.example.org:8443", "lab.example.org:8443", Page::Foreign),
        ] {
            assert_eq!(page(&secure, origin, host), expected, "{origin}");
            // A proxy may end TLS before the service.
            assert_eq!(page(&plain, origin, host), Page::Own, "{origin}");
        }
        for (host, expected) in [
            ("lab.example.org", true),
            ("10.0.0.7:8443", true),
            ("localhost:8443", false),
            ("127.0.0.1", false),
            ("[::1]:1", false),
        ] {
            assert_eq!(secure.is_secure_only(Some(&HeaderValue::from_static(host))), expected, "{host}");
            assert!(!plain.is_secure_only(Some(&HeaderValue::from_static(host))));
        }
    }

    #[test]
    fn wrong_settings_are_told() {
        let address: SocketAddr = "127.0.0.1:80".parse().unwrap();
        for name in ["http://x", "x:80", "a b", "*"] {
            assert!(
                Access::new(address, false, &[name.to_owned()], &[]).unwrap_err().starts_with("--name: found"),
                "{name}"
            );
        }
        for origin in ["*", "null", "example.org", "https://example.org/", "https://a b", "https://example.org:"] {
            let error = Access::new(address, false, &[], &[origin.to_owned()]).unwrap_err();
            assert!(error.starts_with("--origin: found"), "{origin}");
        }
    }

    #[test]
    fn pages_of_other_origins_are_told_from_our_own() {
        let access = access("127.0.0.1:80", &[], &["https://App.example.org:443", "http://localhost:3000"]);
        let page = |host: &'static str, headers: &[(&'static str, &'static [u8])]| {
            let mut map = HeaderMap::new();
            for (name, value) in headers {
                map.append(*name, HeaderValue::from_bytes(value).unwrap());
            }
            access.page(&map, Some(&HeaderValue::from_static(host)))
        };
        let here = "localhost:8080";
        for own in [&b"http://localhost:8080"[..], b"HTTP://LOCALHOST:8080"] {
            assert_eq!(page(here, &[("origin", own)]), Page::Own);
        }
        assert_eq!(page("lab.example.org", &[("origin", b"https://lab.example.org")]), Page::Own);
        assert_eq!(page("lab.example.org:443", &[("origin", b"https://lab.example.org")]), Page::Own);
        assert_eq!(page("lab.example.org", &[("origin", b"https://lab.example.org:8443")]), Page::Foreign);
        for foreign in
            [&b"https://example.org"[..], b"null", b"", b"http://localhost:8081", b"http://localhost", b"\xff"]
        {
            assert_eq!(page(here, &[("origin", foreign)]), Page::Foreign, "{foreign:?}");
        }
        assert_eq!(page(here, &[("origin", b"http://localhost:8080"), ("origin", b"null")]), Page::Foreign);
        for allowed in ["https://app.example.org", "http://localhost:3000"] {
            assert_eq!(page(here, &[("origin", allowed.as_bytes())]), Page::Allowed(HeaderValue::from_static(allowed)));
        }
        assert_eq!(page(here, &[]), Page::Own);
        for (site, expected) in [
            (&b"none"[..], Page::Own),
            (b"same-origin", Page::Own),
            (b"same-site", Page::Foreign),
            (b"cross-site", Page::Foreign),
        ] {
            assert_eq!(page(here, &[("sec-fetch-site", site)]), expected);
        }
    }
}
