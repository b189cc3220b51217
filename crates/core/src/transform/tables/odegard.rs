//! Odegard's smooth 9/7 filters.
//!
//! J. E. Odegard, C. S. Burrus, *Smooth biorthogonal wavelets for applications in image compression*, Proc. DSP
//! Workshop, Loen 1996.
//!
//! Machine-written by `tests/golden/make_tables.py`; edit there.

#[rustfmt::skip]
pub(in crate::transform) static O9_7_ANALYSIS: [f64; 9] = [
    0.05286576853296052, -0.03341847327934683, -0.09306926370358272, 0.3869718638726204, 0.7875137715277921,
    0.3869718638726204, -0.09306926370358272, -0.03341847327934683, 0.05286576853296052,
];

#[rustfmt::skip]
pub(in crate::transform) static O9_7_SYNTHESIS: [f64; 7] = [
    -0.0867483161317116, -0.054836926902779436, 0.44030170672498536, 0.8167806349921064, 0.44030170672498536,
    -0.054836926902779436, -0.0867483161317116,
];
