//! Headers of the protocol of resumable uploads.

use super::checksum::Checksum;
use super::part::Asked;
use crate::api::extract::declared_length;
use crate::api::problem::{Kind, Problem};
use axum::http::{HeaderMap, HeaderName, header};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

pub(super) const RESUMABLE: HeaderName = HeaderName::from_static("tus-resumable");
pub(super) const VERSION: HeaderName = HeaderName::from_static("tus-version");
pub(super) const MAX_SIZE: HeaderName = HeaderName::from_static("tus-max-size");
pub(super) const OFFSET: HeaderName = HeaderName::from_static("upload-offset");
pub(super) const LENGTH: HeaderName = HeaderName::from_static("upload-length");
pub(super) const DEFER_LENGTH: HeaderName = HeaderName::from_static("upload-defer-length");
pub(super) const METADATA: HeaderName = HeaderName::from_static("upload-metadata");
pub(super) const EXPIRES: HeaderName = HeaderName::from_static("upload-expires");
pub(super) const CHECKSUM: HeaderName = HeaderName::from_static("upload-checksum");

/// Media type of a body that is a part of an upload.
const MEDIA_TYPE: &str = "application/offset+octet-stream";

/// Upper bound in bytes on the metadata of an upload. They are stored and sent back with each question for progress.
const LONGEST_METADATA: usize = 4096;

/// Returns the text of a header that occurs at most once.
fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Result<Option<&'a str>, Problem> {
    let mut values = headers.get_all(name).iter();
    let Some(value) = values.next() else { return Ok(None) };
    let text = value.to_str().ok().filter(|_| values.next().is_none());
    text.map(Some).ok_or_else(|| bad(name, "expected this header once, as ASCII text"))
}

/// Returns the whole number in a header, if the header is there.
fn number(headers: &HeaderMap, name: &HeaderName) -> Result<Option<u64>, Problem> {
    let Some(text) = text(headers, name)? else { return Ok(None) };
    // Larger numbers do not fit the database.
    let digits = text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten();
    digits.filter(|number| i64::try_from(*number).is_ok()).map(Some).ok_or_else(|| bad(name, "expected a whole number"))
}

fn bad(name: &HeaderName, reason: &str) -> Problem {
    Problem::new(Kind::BadHeader, format!("{name}: {reason}"))
}

/// Returns the size of an upload that begins; `None` if it will be stated later.
pub(super) fn length_to_begin(headers: &HeaderMap) -> Result<Option<u64>, Problem> {
    match (number(headers, &LENGTH)?, text(headers, &DEFER_LENGTH)?) {
        (Some(length), None) => Ok(Some(length)),
        (None, Some("1")) => Ok(None),
        (None, Some(_)) => Err(bad(&DEFER_LENGTH, "expected 1")),
        (Some(_), Some(_)) => Err(bad(&DEFER_LENGTH, "found Upload-Length as well, expected one of the two headers")),
        (None, None) => {
            Err(bad(&LENGTH, "found none, expected the size of the upload in bytes, or Upload-Defer-Length: 1"))
        }
    }
}

/// Returns the metadata of an upload as they were sent, after checking them; empty if there are none.
pub(super) fn metadata(headers: &HeaderMap) -> Result<String, Problem> {
    let text = text(headers, &METADATA)?.unwrap_or_default().trim();
    if text.len() > LONGEST_METADATA {
        let reason = format!("found {} bytes, expected at most {LONGEST_METADATA}", text.len());
        return Err(bad(&METADATA, &reason));
    }
    let mut names = Vec::new();
    for pair in text.split(',').filter(|_| !text.is_empty()) {
        let (name, value) = pair.trim().split_once(' ').unwrap_or((pair.trim(), ""));
        if name.is_empty() || names.contains(&name) {
            return Err(bad(&METADATA, "expected a name in each pair, and no name twice"));
        }
        if STANDARD.decode(value).is_err() {
            return Err(bad(&METADATA, "expected each value in Base64"));
        }
        names.push(name);
    }
    Ok(text.to_owned())
}

/// Returns the text under `name` in the metadata of an upload, if there is one.
pub(super) fn stated(metadata: &str, name: &str) -> Option<String> {
    let value = metadata.split(',').find_map(|pair| pair.trim().split_once(' ').filter(|(found, _)| *found == name))?;
    String::from_utf8(STANDARD.decode(value.1).ok()?).ok()
}

/// Returns true if a request to begin an upload brings the first bytes.
pub(super) fn has_bytes(headers: &HeaderMap) -> bool {
    let is_part = headers.get(header::CONTENT_TYPE).is_some_and(|value| value == MEDIA_TYPE);
    is_part && declared_length(headers) != Some(0)
}

/// Reads the headers of a request with bytes. The offset is 0 if the request begins the upload.
pub(super) fn asked(headers: &HeaderMap) -> Result<Asked, Problem> {
    if headers.get(header::CONTENT_TYPE).is_none_or(|value| value != MEDIA_TYPE) {
        let detail = format!("expected Content-Type {MEDIA_TYPE}");
        return Err(Problem::new(Kind::UnsupportedMediaType, detail));
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|value| value != "identity") {
        let detail = "found Content-Encoding, expected none on the bytes of an upload: send it with the request that uses the upload";
        return Err(Problem::new(Kind::UnsupportedEncoding, detail));
    }
    let begins = headers.contains_key(LENGTH) || headers.contains_key(DEFER_LENGTH);
    let offset = match number(headers, &OFFSET)? {
        Some(offset) => offset,
        None if begins => 0,
        None => return Err(bad(&OFFSET, "found none, expected the number of bytes that the upload has received")),
    };
    let checksum = text(headers, &CHECKSUM)?.map(Checksum::read).transpose();
    let checksum = checksum.map_err(|reason| bad(&CHECKSUM, &reason))?;
    Ok(Asked { offset, length: number(headers, &LENGTH)?, declared: declared_length(headers), checksum, begins: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        let mut map = HeaderMap::new();
        for (name, value) in pairs {
            map.append(*name, HeaderValue::from_static(value));
        }
        map
    }

    #[test]
    fn lengths_are_stated_or_deferred() {
        let length = |pairs: &[(&'static str, &'static str)]| length_to_begin(&headers(pairs)).ok();
        assert_eq!(length(&[("upload-length", "12")]), Some(Some(12)));
        assert_eq!(length(&[("upload-defer-length", "1")]), Some(None));
        for bad in [
            &[][..],
            &[("upload-length", "-1")],
            &[("upload-length", "+1")],
            &[("upload-length", "")],
            &[("upload-length", "9223372036854775808")],
            &[("upload-length", "1"), ("upload-length", "1")],
            &[("upload-defer-length", "2")],
            &[("upload-length", "1"), ("upload-defer-length", "1")],
        ] {
            assert_eq!(length(bad), None, "{bad:?}");
        }
    }

    #[test]
    fn metadata_are_checked_and_read() {
        let read = |text: &'static str| metadata(&headers(&[("upload-metadata", text)])).ok();
        let known = read("filename w7xiZXIuaWVz,empty , name YQ==").unwrap();
        assert_eq!(stated(&known, "filename").as_deref(), Some("über.ies"));
        assert_eq!((stated(&known, "name").as_deref(), stated(&known, "file")), (Some("a"), None));
        assert_eq!(metadata(&HeaderMap::new()).ok().as_deref(), Some(""));
        for bad in ["a YQ==,a YQ==", "a ?", ",", "a YQ==,"] {
            assert_eq!(read(bad), None, "{bad}");
        }
        assert_eq!(read("x".repeat(LONGEST_METADATA + 1).leak()), None);
    }

    #[test]
    fn a_part_says_where_it_begins() {
        let kind = ("content-type", MEDIA_TYPE);
        let part = asked(&headers(&[kind, ("upload-offset", "7"), ("content-length", "3")])).unwrap();
        assert_eq!((part.offset, part.length, part.declared), (7, None, Some(3)));
        assert_eq!(asked(&headers(&[kind, ("upload-length", "7")])).unwrap().offset, 0);
        for bad in [
            &[("upload-offset", "7")][..],
            &[kind],
            &[kind, ("upload-offset", "x")],
            &[kind, ("upload-offset", "0"), ("content-encoding", "gzip")],
            &[kind, ("upload-offset", "0"), ("upload-checksum", "sha1 ?")],
        ] {
            assert!(asked(&headers(bad)).is_err(), "{bad:?}");
        }
    }
}
