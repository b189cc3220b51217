//! Adelson's and Simoncelli's symmetric quadrature mirror filter of 9 taps.
//!
//! E. H. Adelson, E. Simoncelli, R. Hingorani, *Orthogonal pyramid transforms for image coding*, Proc. SPIE 845
//! (1987). Near-perfect by design: the inverse is computed, see `level.rs`.
//!
//! Machine-written by `tests/golden/make_tables.py`; edit there.

#[rustfmt::skip]
pub(in crate::transform) static QMF9: [f64; 9] = [
    0.028220367, -0.060394127, -0.07388188, 0.41394752, 0.7984298, 0.41394752, -0.07388188, -0.060394127,
    0.028220367,
];
