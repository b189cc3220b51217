//! Brislawn's 10/10 filters for image coding; his 9/7 are bior4.4.
//!
//! C. M. Brislawn, *Fingerprints go digital*, Notices of the AMS 42 (1995), and the tutorial code of the same
//! author; nine decimals are published, so the identities hold to 1e-8.
//!
//! Machine-written by `tests/golden/make_tables.py`; edit there.

#[rustfmt::skip]
pub(in crate::transform) static B10_10_ANALYSIS: [f64; 10] = [
    0.026913419, -0.032303352, -0.241109818, 0.05410042, 0.899506092, 0.899506092, 0.05410042, -0.241109818,
    -0.032303352, 0.026913419,
];

#[rustfmt::skip]
pub(in crate::transform) static B10_10_SYNTHESIS: [f64; 10] = [
    0.019843545, 0.023817599, -0.02325784, 0.14557074, 0.541132748, 0.541132748, 0.14557074, -0.02325784,
    0.023817599, 0.019843545,
];
