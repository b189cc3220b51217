//! Arbitrary bytes with corrected checksums that are a material on grids of angles: whole, levels, slices, evaluation.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    let cut = bytes.last_chunk().map_or(0, |last| u16::from_le_bytes(*last));
    wavelume_fuzz::decode_grids(&wavelume_fuzz::sealed(bytes), cut);
});
