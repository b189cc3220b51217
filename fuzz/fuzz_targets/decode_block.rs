//! Arbitrary bytes with corrected checksums: decodes slices of incoming directions, and compares them with the whole.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::decode_blocks(&wavelume_fuzz::sealed(bytes));
});
