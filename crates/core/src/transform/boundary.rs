//! What a line transform takes for granted beyond the ends of its axis.

use crate::domain::named;

/// The rule at both ends of a line. Whatever the rule, a level of n samples has exactly n coefficients, ⌈n/2⌉ smooth ones
/// and ⌊n/2⌋ details, at every n, and is inverted exactly: nothing is padded.
///
/// * **Symmetric filters under the extension of their own symmetry** (whole-sample for odd, half-sample for even lengths)
///   are critically sampled by the extension itself (Brislawn 1996, *Classification of nonexpansive symmetric extension
///   transforms for multirate filter banks*), at odd n too: an even filter then mirrors smooth coefficients at their last
///   one and its details, odd there, need none.
/// * **All other pairs of basis and rule** keep every filter that lies wholly inside and complete the rest: rows from the
///   orthogonal complement of the inner ones, split into smooth and detail rows by what the rule asks for (Herley & Vetterli
///   1994, *Orthogonal time-varying filter banks*; Cohen, Daubechies & Vial 1993, *Wavelets on the interval*). For an
///   orthogonal basis the level is then an orthogonal matrix at every n, shorter than its filter too, which extensions
///   cannot give: they need n + L − 2 coefficients, or an ill-conditioned inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Boundary {
    /// `x[n + i] = x[i]`. Of an odd number of samples no such level is critically sampled: from the first odd length on,
    /// the basis' own rule (see [`super::LineBasis::boundary`]) goes on.
    Periodic,
    /// Mirrored between samples: `x[−1] = x[0]`.
    HalfSample,
    /// Mirrored at samples: `x[−1] = x[1]`.
    WholeSample,
    /// Nothing beyond the ends: filters are cut there.
    Zero,
    /// Rows of their own at the ends, which keep polynomials: details of polynomials vanish up to the ends and at all
    /// levels, for degrees below the basis' vanishing moments and below 4.
    Fitted,
}
named!(Boundary, "boundary rule", {
    Periodic = "periodic",
    HalfSample = "half-sample",
    WholeSample = "whole-sample",
    Zero = "zero",
    Fitted = "fitted",
});

/// Sample `i` of the extension of n samples.
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
