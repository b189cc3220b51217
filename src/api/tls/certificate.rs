//! Facts of an X.509 certificate that its operator has to know: the time in which it is valid, and its names.

use super::super::words::shown;
use super::der::{Reader, SEQUENCE};
use crate::jobs::{DAY, days};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Upper bound in characters on each host name of a certificate that messages show.
const LONGEST_NAME: usize = 100;

/// Content of the object identifier 2.5.29.17: the extension `subjectAltName`.
const ALTERNATIVE_NAMES: &[u8] = &[0x55, 0x1d, 0x11];

/// DER tag of a time whose year has two digits.
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;

const INTEGER: u8 = 0x02;
const OBJECT_IDENTIFIER: u8 = 0x06;
const OCTET_STRING: u8 = 0x04;
const BOOLEAN: u8 = 0x01;

/// Facts of a certificate, from its DER encoding. No signature is checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Certificate {
    /// Time from which the certificate is valid, in seconds since 1970.
    pub(super) begins: i64,
    /// Time until which the certificate is valid, in seconds since 1970.
    pub(super) ends: i64,
    /// Host names and addresses for which the certificate is valid, as clients compare them (`subjectAltName`).
    pub(super) names: Vec<String>,
}

impl Certificate {
    /// Reads the facts of a certificate. Returns `None` if the bytes are no certificate of X.509.
    pub(super) fn parse(der: &[u8]) -> Option<Self> {
        let mut signed = Reader::new(der).sequence()?.sequence()?;
        // The version stands only in certificates of version 2 and 3.
        let _ = signed.of(0xa0);
        signed.of(INTEGER)?;
        let (_signature, _issuer) = (signed.of(SEQUENCE)?, signed.of(SEQUENCE)?);
        let mut validity = signed.sequence()?;
        let (begins, ends) = (time(validity.element()?)?, time(validity.element()?)?);
        let (_subject, _key) = (signed.of(SEQUENCE)?, signed.of(SEQUENCE)?);
        let mut names = Vec::new();
        while !signed.is_empty() {
            let (tag, content) = signed.element()?;
            // Extensions; the other two are identifiers that nobody uses.
            if tag == 0xa3 {
                let mut extensions = Reader::new(content).sequence()?;
                while !extensions.is_empty() {
                    let mut extension = extensions.sequence()?;
                    let identifier = extension.of(OBJECT_IDENTIFIER)?;
                    let _critical = extension.of(BOOLEAN);
                    let value = extension.of(OCTET_STRING)?;
                    if identifier == ALTERNATIVE_NAMES {
                        names = alternative_names(value)?;
                    }
                }
            }
        }
        Some(Self { begins, ends, names })
    }

    /// Returns true if the certificate is valid for a host: an IP address, or a name whose first label a `*` may stand
    /// for.
    pub(super) fn covers(&self, host: &str) -> bool {
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let address = host.parse::<IpAddr>();
        self.names.iter().any(|name| match (&address, name.strip_prefix("*.")) {
            (Ok(address), _) => name.parse::<IpAddr>().is_ok_and(|known| known == *address),
            (Err(_), None) => name.eq_ignore_ascii_case(host),
            (Err(_), Some(parent)) => {
                host.split_once('.').is_some_and(|(first, rest)| !first.is_empty() && parent.eq_ignore_ascii_case(rest))
            }
        })
    }
}

/// Returns the DNS names and addresses of an extension `subjectAltName`.
fn alternative_names(value: &[u8]) -> Option<Vec<String>> {
    let mut list = Reader::new(value).sequence()?;
    let mut names = Vec::new();
    while !list.is_empty() {
        match list.element()? {
            (0x82, name) => names.push(shown(&String::from_utf8_lossy(name), LONGEST_NAME)),
            (0x87, bytes) => {
                let v4 = <[u8; 4]>::try_from(bytes).map(|bytes| Ipv4Addr::from(bytes).to_string());
                let v6 = <[u8; 16]>::try_from(bytes).map(|bytes| Ipv6Addr::from(bytes).to_string());
                names.extend(v4.or(v6));
            }
            // Names of other kinds are of no use to HTTP.
            _ => {}
        }
    }
    Some(names)
}

/// Parses a time of a certificate, and returns it in seconds since 1970.
fn time((tag, text): (u8, &[u8])) -> Option<i64> {
    let text = text.strip_suffix(b"Z")?;
    let (year, rest) = match tag {
        UTC_TIME => {
            let (year, rest) = text.split_at_checked(2)?;
            let year = number(year)?;
            // RFC 5280, section 4.1.2.5.1.
            (if year < 50 { 2000 + year } else { 1900 + year }, rest)
        }
        GENERALIZED_TIME => {
            let (year, rest) = text.split_at_checked(4)?;
            (number(year)?, rest)
        }
        _ => return None,
    };
    let parts: Vec<i64> = rest.chunks(2).map(number).collect::<Option<_>>()?;
    let [month @ 1..=12, day @ 1..=31, hour @ 0..=23, minute @ 0..=59, second @ 0..=60] = parts[..] else {
        return None;
    };
    Some(days(year, month, day) * DAY + hour * 3600 + minute * 60 + second)
}

/// Returns the number that ASCII digits stand for.
fn number(digits: &[u8]) -> Option<i64> {
    let is_number = !digits.is_empty() && digits.iter().all(u8::is_ascii_digit);
    is_number.then(|| digits.iter().fold(0, |sum, digit| sum * 10 + i64::from(digit - b'0')))
}

/// Writes a time in seconds since 1970 as date and time of day, `2026-11-26 05:30 UTC`.
pub(super) fn date(seconds: i64) -> String {
    format!("{} UTC", crate::jobs::date(seconds))
}

#[cfg(test)]
mod tests {
    use super::super::made::{made, openssl};
    use super::*;
    use proptest::prelude::*;
    use rustls::pki_types::CertificateDer;
    use rustls::pki_types::pem::PemObject;

    const NAMES: &str =
        "subjectAltName=DNS:lab.example.org,email:a@b.example,DNS:*.labs.example,IP:10.0.0.7,IP:2001:db8::1";

    /// DER of a certificate with all kinds of names, and its facts.
    fn certificate() -> (Vec<u8>, Certificate) {
        let directory = tempfile::tempdir().unwrap();
        let der = CertificateDer::from_pem_file(made(directory.path(), "a", NAMES, 90).chain).unwrap().to_vec();
        let parsed = Certificate::parse(&der).unwrap();
        (der, parsed)
    }

    #[test]
    fn times_and_names_are_those_of_the_certificate() {
        let directory = tempfile::tempdir().unwrap();
        // From 2050 on the year has four digits.
        for days in [90, 20_000] {
            let pem = made(directory.path(), "a", NAMES, days).chain;
            let parsed = Certificate::parse(&CertificateDer::from_pem_file(&pem).unwrap()).unwrap();
            assert_eq!(parsed.names, ["lab.example.org", "*.labs.example", "10.0.0.7", "2001:db8::1"]);
            assert_eq!(parsed.ends - parsed.begins, i64::from(days) * DAY);
            let args = ["x509", "-noout", "-dates", "-dateopt", "iso_8601", "-in", pem.to_str().unwrap()];
            let told = openssl(&args);
            for (seconds, line) in [parsed.begins, parsed.ends].into_iter().zip(told.lines()) {
                assert_eq!(date(seconds), format!("{} UTC", &line.split_once('=').unwrap().1[..16]));
            }
        }
    }

    #[test]
    fn hosts_are_compared_with_names_as_clients_do() {
        let (_, parsed) = certificate();
        for (host, is_covered) in [
            ("LAB.example.org", true),
            ("xlab.example.org", false),
            ("a.labs.example", true),
            ("a.b.labs.example", false),
            ("labs.example", false),
            (".labs.example", false),
            ("10.0.0.7", true),
            ("10.0.0.8", false),
            ("[2001:db8::1]", true),
            ("2001:db8:0::1", true),
        ] {
            assert_eq!(parsed.covers(host), is_covered, "{host}");
        }
        let nameless = Certificate { names: Vec::new(), ..parsed };
        assert!(!nameless.covers("lab.example.org"));
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (text, seconds) in [
            ("700101000000Z", 0),
            ("000229120000Z", 951_825_600),
            ("491231235959Z", 2_524_607_999),
            ("500101000000Z", -631_152_000),
        ] {
            assert_eq!(time((UTC_TIME, text.as_bytes())), Some(seconds), "{text}");
        }
        assert_eq!(time((GENERALIZED_TIME, b"99991231235959Z")), Some(253_402_300_799));
        assert_eq!(time((GENERALIZED_TIME, b"00000229120000Z")), Some(-62_162_078_400));
        assert_eq!(date(253_402_300_799), "9999-12-31 23:59 UTC");
        assert_eq!(date(-62_162_078_400), "0000-02-29 12:00 UTC");
        assert_eq!((date(-1).as_str(), date(951_825_600).as_str()), ("1969-12-31 23:59 UTC", "2000-02-29 12:00 UTC"));
        for wrong in ["", "Z", "7001010000Z", "701301000000Z", "700101000000", "7001010000000Z", "70010100000xZ"] {
            assert_eq!(time((UTC_TIME, wrong.as_bytes())), None, "{wrong}");
        }
    }

    #[test]
    fn a_damaged_certificate_is_refused_or_read_and_never_panics() {
        let (der, _) = certificate();
        for length in 0..der.len() {
            assert_eq!(Certificate::parse(&der[..length]), None);
        }
        for place in 0..der.len() {
            for byte in [0, 1, 0x7f, 0x80, 0x84, 0xff] {
                let mut damaged = der.clone();
                damaged[place] = byte;
                let _ = Certificate::parse(&damaged);
            }
        }
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Certificate::parse(&bytes);
        }

        #[test]
        fn a_date_is_written_as_it_was_read(year in 1950_i64..2050, day in 0_i64..365, minute in 0_i64..1440) {
            let seconds = (days(year, 1, 1) + day) * DAY + minute * 60;
            let digits: String = date(seconds).chars().filter(char::is_ascii_digit).skip(2).collect();
            prop_assert_eq!(time((UTC_TIME, format!("{digits}00Z").as_bytes())), Some(seconds));
        }
    }
}
