//! The digest under which bytes are known.

/// `b3-` and the BLAKE3 digest in hex.
pub fn digest(bytes: &[u8]) -> String {
    format!("b3-{}", blake3::hash(bytes).to_hex())
}
