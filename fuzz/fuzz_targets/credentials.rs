//! Reads any bytes as a key, an id, a token and a signed link.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| wavelume_fuzz::read_credentials(bytes));
