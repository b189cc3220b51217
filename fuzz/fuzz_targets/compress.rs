//! Any samples, target and policy through `compress`: what is written decodes, with the errors that it states.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::compress(bytes);
});
