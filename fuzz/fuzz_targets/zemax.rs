//! Arbitrary bytes as keywords and data of a Zemax BSDF file, projected if small; later lists replace the first ones.
#![no_main]

/// Lists of angles by which the format is recognised.
const HEAD: &[u8] = b"Symmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType BRDF\nSampleRotation 1\n0\n\
                      AngleOfIncidence 1\n30\nScatterAzimuth 2\n0 90\nScatterRadial 2\n0 20\n";

libfuzzer_sys::fuzz_target!(init: wavelume_fuzz::one_thread(), |bytes: &[u8]| {
    wavelume_fuzz::read_within(HEAD, bytes, b"\nDataEnd\n");
});
