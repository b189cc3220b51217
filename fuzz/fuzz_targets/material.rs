//! Arbitrary bytes with corrected checksums, opened and queried as a material.
#![no_main]

use wavelume_fuzz::{MOST_OPENED, announced, one_thread, sealed, use_material};

libfuzzer_sys::fuzz_target!(init: one_thread(), |bytes: &[u8]| {
    let bytes = sealed(bytes);
    let announces = wavelume_core::compress::inspect(&bytes).as_ref().map_or(0, announced);
    if announces <= MOST_OPENED {
        use_material(&bytes);
    }
});
