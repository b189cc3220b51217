//! Arbitrary bytes as the content of a TM-33 luminaire, projected if small.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::read_within(b"<IESTM33-22>", bytes, b"</IESTM33-22>");
});
