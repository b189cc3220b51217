//! Arbitrary bytes as a file of any format, projected if small; a manifest may follow a byte 0x1E.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| wavelume_fuzz::read_format(bytes));
