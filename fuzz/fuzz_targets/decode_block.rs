//! Arbitrary bytes with their checksums made right: slices of incoming directions, and the same from the whole.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::decode_blocks(&wavelume_fuzz::sealed(bytes));
});
