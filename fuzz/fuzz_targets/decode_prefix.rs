//! Arbitrary bytes with corrected checksums: decodes every level from the whole file, from its prefix, and from a cut
//! file.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    let cut = bytes.last_chunk().map_or(0, |last| u16::from_le_bytes(*last));
    wavelume_fuzz::decode_prefixes(&wavelume_fuzz::sealed(bytes), cut);
});
