//! Arbitrary bytes as a BSDF of WINDOW or Radiance, or as the numbers of a matrix or a tensor tree in one.
#![no_main]

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| wavelume_fuzz::read_bsdf_xml(bytes));
