//! Name of bytes: `b3-` and the 64 hexadecimal digits of their BLAKE3 hash.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// BLAKE3 digest; written as `b3-` and 64 lower-case hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Digest([u8; 32]);

/// Hexadecimal digits by their values.
const DIGITS: &[u8; 16] = b"0123456789abcdef";

/// Text that is not a digest.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no digest, expected `b3-` and 64 lower-case hexadecimal digits")]
pub struct NotADigest(String);

impl PartialSchema for Digest {
    fn schema() -> RefOr<Schema> {
        let text = ObjectBuilder::new().schema_type(Type::String).pattern(Some("^b3-[0-9a-f]{64}$"));
        text.description(Some("`b3-` and the 64 lower-case hexadecimal digits of a BLAKE3 hash.")).into()
    }
}

impl ToSchema for Digest {}

impl Digest {
    /// Computes the BLAKE3 digest of `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        Self::from(blake3::hash(bytes))
    }
}

impl From<blake3::Hash> for Digest {
    fn from(hash: blake3::Hash) -> Self {
        Self(*hash.as_bytes())
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = *b"b3-0000000000000000000000000000000000000000000000000000000000000000";
        for (pair, byte) in text[3..].chunks_exact_mut(2).zip(self.0) {
            pair.copy_from_slice(&[DIGITS[usize::from(byte >> 4)], DIGITS[usize::from(byte & 15)]]);
        }
        f.write_str(std::str::from_utf8(&text).unwrap_or_default())
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Digest {
    type Err = NotADigest;

    /// Parses the text of a digest. Upper-case digits are refused, so that no digest has two spellings.
    fn from_str(text: &str) -> Result<Self, NotADigest> {
        // The text that is echoed to the user is bounded.
        let refused = || NotADigest(text.chars().take(80).collect());
        let hex = text.strip_prefix("b3-").ok_or_else(refused)?;
        if hex.len() != 64 || !hex.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
            return Err(refused());
        }
        blake3::Hash::from_hex(hex).map(Self::from).map_err(|_| refused())
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_round_trips_and_nothing_else_is_a_digest() {
        let digest = Digest::of(b"wavelume");
        let text = digest.to_string();
        assert_eq!(text.parse(), Ok(digest));
        assert_eq!(serde_json::from_str::<Digest>(&serde_json::to_string(&digest).unwrap()).unwrap(), digest);
        let hex = &text[3..];
        for bad in
            ["", "b3-", hex, &text.to_uppercase(), &format!("{text}0"), &text[..66], &format!("b3-{}é", &hex[2..])]
        {
            assert!(bad.parse::<Digest>().is_err(), "{bad}");
        }
    }
}
