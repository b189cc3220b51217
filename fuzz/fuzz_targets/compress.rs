//! Compresses arbitrary samples with any target and policy: files decode with the errors that they state.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::compress(bytes);
});
