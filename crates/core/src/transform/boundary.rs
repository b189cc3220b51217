//! Boundary rules of line transforms: the treatment of filters that reach beyond the ends of an axis.

use crate::domain::named;

/// Boundary rule of a wavelet transform at both ends of an axis. Under every rule, one level of n samples gives exactly
/// n coefficients: ⌈n/2⌉ smooth ones and ⌊n/2⌋ details. It is inverted exactly, without padding.
///
/// * **Symmetric filters under the extension of their own symmetry** (whole-sample for odd, half-sample for even filter
///   lengths) are critically sampled by the extension itself (Brislawn 1996, *Classification of nonexpansive symmetric
///   extension transforms for multirate filter banks*). This includes odd n: a filter of even length then mirrors
///   smooth coefficients at the last one. The details are antisymmetric there and need no extra coefficient.
/// * **All other pairs of basis and rule** keep every filter that lies wholly inside. The remaining rows come from the
///   orthogonal complement of the inner ones and are split into smooth and detail rows according to the rule (Herley &
///   Vetterli 1994, *Orthogonal time-varying filter banks*; Cohen, Daubechies & Vial 1993, *Wavelets on the interval*).
///   For an orthogonal basis, a level is then an orthogonal matrix at every n, even if n is shorter than the filter.
///   Extensions cannot achieve this: they need n + L − 2 coefficients (L taps) or an ill-conditioned inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Boundary {
    /// Periodic extension, `x[n + i] = x[i]`. It has no critically sampled form at odd lengths. From the first level of
    /// odd length on, the default rule of the basis ([`super::LineBasis::boundary`]) takes over.
    Periodic,
    /// Symmetric extension about a point between two samples: `x[−1] = x[0]`.
    HalfSample,
    /// Symmetric extension about a sample: `x[−1] = x[1]`.
    WholeSample,
    /// Samples beyond the ends count as 0, so that filters are truncated there.
    Zero,
    /// Special filters at the ends, which preserve polynomials. Details of polynomials vanish up to the ends and at all
    /// levels, for degrees below 4 and below the number of vanishing moments of the basis.
    Fitted,
}
named!(Boundary, "boundary rule", {
    Periodic = "periodic",
    HalfSample = "half-sample",
    WholeSample = "whole-sample",
    Zero = "zero",
    Fitted = "fitted",
});

/// Maps index `i`, which may lie outside of n samples, to the sample inside that a periodic or symmetric extension
/// repeats there.
pub(super) fn folded(i: i64, n: usize, rule: Boundary) -> usize {
    let n = n as i64;
    let folded = match rule {
        Boundary::HalfSample => {
            let at = i.rem_euclid(2 * n);
            if at < n { at } else { 2 * n - 1 - at }
        }
        Boundary::WholeSample if n > 1 => {
            let at = i.rem_euclid(2 * n - 2);
            if at < n { at } else { 2 * n - 2 - at }
        }
        _ => i.rem_euclid(n),
    };
    folded as usize
}
