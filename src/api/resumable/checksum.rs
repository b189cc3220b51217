//! Checksum that a client states for one part of an upload.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ring::digest::{Algorithm, Context, SHA1_FOR_LEGACY_USE_ONLY, SHA256};

/// Names of the known checksums, separated by commas. The protocol demands sha1, which guards against damage on the
/// way, not against an attacker.
pub(super) const NAMES: &str = "sha1,sha256";

/// Checksum of an uploaded part: the value that the request states, and the running computation over the received
/// bytes.
#[derive(Clone)]
pub(super) struct Checksum {
    stated: Vec<u8>,
    computed: Context,
}

impl Checksum {
    /// Reads the name of a checksum and its bytes in Base64. The error says what was expected.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once(' ').unwrap_or((text, ""));
        let algorithm: &'static Algorithm = match name {
            "sha1" => &SHA1_FOR_LEGACY_USE_ONLY,
            "sha256" => &SHA256,
            _ => return Err(format!("expected one of {NAMES} and a checksum")),
        };
        let stated = STANDARD.decode(value).ok().filter(|stated| stated.len() == algorithm.output_len());
        let stated = stated.ok_or_else(|| format!("expected {} bytes in Base64", algorithm.output_len()))?;
        Ok(Self { stated, computed: Context::new(algorithm) })
    }

    /// Adds received bytes of an uploaded part to the computation of its checksum.
    pub(super) fn update(&mut self, bytes: &[u8]) {
        self.computed.update(bytes);
    }

    /// Returns true if the received bytes have the stated checksum.
    pub(super) fn matches(self) -> bool {
        self.computed.finish().as_ref() == self.stated
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_checksums_are_compared() {
        for (text, right) in [
            ("sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=", true),
            ("sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu4=", false),
            ("sha256 uU0nuZNNPgilLlLX2n2r+sSE7+N6U4DukIj3rOLvzek=", true),
        ] {
            let mut checksum = Checksum::read(text).unwrap();
            checksum.update(b"hello ");
            checksum.update(b"world");
            assert_eq!(checksum.matches(), right, "{text}");
        }
        for bad in ["", "sha1", "sha1 ?", "sha1 YQ==", "crc32 YQ==", "SHA1 Kq5sNclPz7QV2+lfQIuc6R7oRu0="] {
            assert!(Checksum::read(bad).is_err(), "{bad}");
        }
    }
}
