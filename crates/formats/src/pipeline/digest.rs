//! Digests that identify files.

/// Returns `b3-` followed by the BLAKE3 digest of `bytes` in hex.
pub fn digest(bytes: &[u8]) -> String {
    format!("b3-{}", blake3::hash(bytes).to_hex())
}
