//! Beylkin's orthonormal filter of 18 taps.
//!
//! G. Beylkin, R. Coifman, V. Rokhlin, *Fast wavelet transforms and numerical algorithms I*, Comm. Pure Appl. Math.
//! 44 (1991); digits as in `MakeONFilter` of `WaveLab`, to more places.
//!
//! Machine-written by `tests/golden/make_tables.py`; edit there.

#[rustfmt::skip]
pub(in crate::transform) static BEYLKIN: [f64; 18] = [
    0.099305765374353, 0.424215360812961, 0.6998252140566, 0.449718251149468, -0.110927598348234,
    -0.264497231446384, 0.02690030880369, 0.155538731877093, -0.017520746266529, -0.088543630622924,
    0.019679866044322, 0.042916387274192, -0.017460408696028, -0.014365807968852, 0.010040411844631,
    0.0014842347824723, -0.002736031626258, 0.0006404853285212,
];
