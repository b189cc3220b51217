//! Vaidyanathan's orthonormal filter of 24 taps, optimised for coding speech.
//!
//! P. P. Vaidyanathan, P.-Q. Hoang, *Lattice structures for optimal design and robust implementation of two-channel
//! perfect-reconstruction QMF banks*, IEEE Trans. ASSP 36 (1988); digits (12 decimals) as in `MakeONFilter` of
//! `WaveLab`.
//!
//! Machine-written by `tests/golden/make_tables.py`; edit there.

#[rustfmt::skip]
pub(in crate::transform) static VAIDYANATHAN: [f64; 24] = [
    -6.2906118e-05, 0.000343631905, -0.00045395662, -0.000944897136, 0.002843834547, 0.000708137504,
    -0.008839103409, 0.003153847056, 0.01968721501, -0.014853448005, -0.035470398607, 0.038742619293,
    0.055892523691, -0.077709750902, -0.083928884366, 0.131971661417, 0.135084227129, -0.194450471766,
    -0.263494802488, 0.201612161775, 0.635601059872, 0.572797793211, 0.250184129505, 0.045799334111,
];
