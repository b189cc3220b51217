//! Address to listen on: numbers, or the name of a host, which is resolved when the service starts.

use super::failure::Failure;
use std::net::SocketAddr;
use std::str::FromStr;

/// Address to listen on, as an option gives it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Listen {
    /// IP address and port.
    Address(SocketAddr),
    /// Name of a host of this machine, and port.
    Named(String, u16),
}

impl FromStr for Listen {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(address) = text.parse() {
            return Ok(Self::Address(address));
        }
        let plain = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
        let named = text.rsplit_once(':').filter(|(host, port)| {
            host.chars().any(|c| c.is_ascii_alphabetic()) && host.chars().all(plain) && !port.starts_with('+')
        });
        let named = named.and_then(|(host, port)| Some(Self::Named(host.to_owned(), port.parse().ok()?)));
        named.ok_or_else(|| {
            "expected an address and a port, such as 127.0.0.1:8080 or [::1]:8080, or a name and a port".to_owned()
        })
    }
}

impl Listen {
    /// Returns the address to bind. A name with several addresses stands for the first loopback address, of IPv4 if
    /// there is one, which clients try after one of IPv6 that refuses; without a loopback address, for the first one.
    pub(crate) async fn address(&self) -> Result<SocketAddr, Failure> {
        let (host, port) = match self {
            Self::Address(address) => return Ok(*address),
            Self::Named(host, port) => (host, *port),
        };
        let found = tokio::net::lookup_host((host.as_str(), port)).await;
        let reason = match found.map(preferred) {
            Ok(Some(address)) => return Ok(address),
            Ok(None) => "it has no address".to_owned(),
            Err(error) => error.to_string(),
        };
        let detail = format!(
            "cannot find the host {host} of --listen {host}:{port}: {reason}; give an address of this machine, such as \
             127.0.0.1:{port}"
        );
        Err(Failure::failed(detail))
    }
}

fn preferred(addresses: impl Iterator<Item = SocketAddr>) -> Option<SocketAddr> {
    addresses.min_by_key(|address| (!address.ip().to_canonical().is_loopback(), address.is_ipv6()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_names_are_read() {
        for (text, listen) in [
            ("127.0.0.1:8080", Listen::Address(([127, 0, 0, 1], 8080).into())),
            ("localhost:8080", Listen::Named("localhost".to_owned(), 8080)),
            ("lab-2.example.org:0", Listen::Named("lab-2.example.org".to_owned(), 0)),
        ] {
            assert_eq!(text.parse(), Ok(listen), "{text}");
        }
        for bad in ["", "nowhere", "localhost", ":80", "127.0.0.1", "127.0.0.1:99999", "::1:0", "1.2.3:80", "a:+8"] {
            assert!(bad.parse::<Listen>().is_err(), "{bad}");
        }
        assert!("unix:/tmp/x".parse::<Listen>().is_err() && "a b:80".parse::<Listen>().is_err());
    }

    #[test]
    fn loopback_comes_first_and_the_order_of_others_stays() {
        let first = |texts: &[&str]| preferred(texts.iter().map(|text| text.parse().unwrap())).map(|a| a.to_string());
        assert_eq!(first(&["[::1]:80", "127.0.0.1:80"]).as_deref(), Some("127.0.0.1:80"));
        assert_eq!(first(&["10.0.0.5:80", "[::1]:80"]).as_deref(), Some("[::1]:80"));
        assert_eq!(first(&["10.0.0.5:80", "10.0.0.4:80"]).as_deref(), Some("10.0.0.5:80"));
        assert_eq!(first(&[]), None);
    }

    #[tokio::test]
    async fn a_name_becomes_an_address_of_this_machine() {
        let local = Listen::Named("localhost".to_owned(), 8080).address().await.unwrap();
        assert!(local.ip().is_loopback() && local.port() == 8080);
        let Err(Failure::Failed(reason)) = Listen::Named("nowhere.invalid".to_owned(), 80).address().await else {
            panic!("nobody may have this name");
        };
        assert!(reason.contains("nowhere.invalid") && reason.contains("127.0.0.1:80"), "{reason}");
    }
}
