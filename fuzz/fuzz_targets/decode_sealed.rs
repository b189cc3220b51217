//! Arbitrary bytes with corrected checksums, through `inspect`, `decode` and `payload_digest`.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::decode(&wavelume_fuzz::sealed(bytes));
});
