#!/usr/bin/env python3
"""Writes crates/core/src/transform/tables/*.rs: one file a family, the low-pass filters of every basis on a line.

    pip install PyWavelets==1.8.0 numpy
    python tests/golden/make_tables.py

A table holds the weights of one low-pass filter over increasing samples, without padding zeros. Orthogonal bases have
one (the scaling filter), biorthogonal ones an analysis and a synthesis filter. The high-pass filters follow from them
(see src/transform/filters.rs), so they are not stored. Numbers are the shortest decimals that read back to the same
f64.
"""
import os
import textwrap

import numpy as np
import pywt

HERE = os.path.dirname(os.path.abspath(__file__))
OUT = os.path.join(HERE, "..", "..", "crates", "core", "src", "transform", "tables")
MADE = "//! Machine-written by `tests/golden/make_tables.py`; edit there."
PYWT = f"Digits: PyWavelets {pywt.__version__}, `pywt/_extensions/c/wavelets_coeffs.template.h`."


def write(file, charter, notes, tables):
    lines = [f"//! {charter}", "//!"]
    for note in textwrap.wrap(" ".join(notes), 112):
        lines.append(f"//! {note}")
    lines += ["//!", MADE, ""]
    for name, values in tables:
        lines.append("#[rustfmt::skip]")
        lines.append(f"pub(in crate::transform) static {name}: [f64; {len(values)}] = [")
        row = "   "
        for value in values:
            item = f" {float(value)!r},"
            if len(row) + len(item) > 116:
                lines.append(row)
                row = "   "
            row += item
        lines += [row, "];", ""]
    with open(os.path.join(OUT, file), "w", encoding="utf-8") as f:
        f.write("\n".join(lines[:-1]) + "\n")


def scaling(name):
    return pywt.Wavelet(name).rec_lo


def trimmed(values):
    nonzero = np.flatnonzero(np.asarray(values))
    return values[nonzero[0] : nonzero[-1] + 1]


def mirrored(half, odd):
    return half + (half[-2::-1] if odd else half[::-1])


def battle_lemarie(degree, taps):
    """The scaling filter of the orthonormal splines of `degree` (Lemarié 1988, Battle 1987; Mallat 1989, appendix), cut
    to `taps`; then the even and the odd weights are scaled to sum to 1/sqrt(2) each, so that constants keep no
    detail."""
    n = 1 << 14
    omega = 2 * np.pi * np.arange(n) / n
    order = 2 * degree + 1
    knots = np.arange(-order, order + 1)
    # Central B-spline of degree `order` at the integers by Cox-de Boor on [-(order+1)/2, (order+1)/2].
    values = {k: b_spline(order, k) for k in knots}

    def euler(w):
        return sum(v * np.cos(k * w) for k, v in values.items())

    m0 = np.cos(omega / 2) ** (degree + 1) * np.sqrt(euler(omega) / euler(2 * omega))
    h = np.sqrt(2) * np.real(np.fft.ifft(m0))
    half = taps // 2
    h = [float(h[abs(k)]) for k in range(-half, half + 1)]
    for parity in (0, 1):
        part = [k for k in range(taps) if (k - half) % 2 == parity]
        total = sum(h[k] for k in part)
        for k in part:
            h[k] *= np.sqrt(0.5) / total
    # Both halves to the same digits.
    return [h[min(k, taps - 1 - k)] for k in range(taps)]


def b_spline(degree, x):
    """Central B-spline of `degree` at x: sum over k of (-1)^k C(d+1, k) (x + (d+1)/2 - k)_+^d / d!."""
    from fractions import Fraction
    from math import comb, factorial

    x = Fraction(int(x)) + Fraction(degree + 1, 2)
    total = Fraction(0)
    for k in range(degree + 2):
        if x > k:
            total += (-1) ** k * comb(degree + 1, k) * (x - k) ** degree
    return float(total / factorial(degree))


def main():
    os.makedirs(OUT, exist_ok=True)
    write(
        "daubechies.rs",
        "Daubechies' orthonormal wavelets of extremal phase, db1 (Haar) to db38.",
        ["I. Daubechies, *Ten Lectures on Wavelets*, SIAM 1992, table 6.1 (N = 2..10); Haar 1910 (N = 1).", PYWT],
        [(f"DB{n}", scaling(f"db{n}")) for n in range(1, 39)],
    )
    write(
        "symlets.rs",
        "Daubechies' least asymmetric orthonormal wavelets, sym2 to sym20.",
        ["I. Daubechies, *Ten Lectures on Wavelets*, SIAM 1992, table 6.3 (N = 4..10).", PYWT],
        [(f"SYM{n}", scaling(f"sym{n}")) for n in range(2, 21)],
    )
    write(
        "coiflets.rs",
        "Coiflets, coif1 to coif17: orthonormal, 2K moments of the wavelet and 2K - 1 of the scaling function vanish.",
        ["I. Daubechies, *Orthonormal bases of compactly supported wavelets II*, SIAM J. Math. Anal. 24 (1993).", PYWT],
        [(f"COIF{n}", scaling(f"coif{n}")) for n in range(1, 18)],
    )
    names = [name for name in pywt.wavelist("bior") if name != "bior1.1"]
    tables = []
    for name in names:
        wavelet = pywt.Wavelet(name)
        label = "BIOR" + name[4:].replace(".", "_")
        tables.append((label + "_ANALYSIS", trimmed(wavelet.dec_lo)))
        tables.append((label + "_SYNTHESIS", trimmed(wavelet.rec_lo)))
    write(
        "biorthogonal.rs",
        "Symmetric biorthogonal spline wavelets and their variants of less dissimilar lengths (4.4, 5.5, 6.8).",
        [
            "A. Cohen, I. Daubechies, J.-C. Feauveau, *Biorthogonal bases of compactly supported wavelets*, Comm. Pure Appl.",
            "Math. 45 (1992); Daubechies 1992, tables 8.2 and 8.3. 4.4 is also Antonini et al. 1992. " + PYWT,
        ],
        tables,
    )
    write(
        "meyer.rs",
        "The discrete approximation of Meyer's wavelet, 61 taps.",
        [
            "Y. Meyer, *Wavelets and Operators*, Cambridge 1992; the truncation is that of Matlab's and PyWavelets' `dmey`.",
            PYWT + " Not orthonormal beyond 2.3e-3: the inverse is computed, see `level.rs`.",
        ],
        [("DMEY", trimmed(scaling("dmey")))],
    )
    write(
        "villasenor.rs",
        "Image-coding filters of Villasenor's group; those of his set that are spline wavelets are in `biorthogonal.rs`.",
        [
            "J. D. Villasenor, B. Belzer, J. Liao, *Wavelet filter evaluation for image compression*, IEEE Trans. Image",
            "Processing 4 (1995), 1053-1060. 18/10 (synthesis 18, analysis 10 taps) is unpublished work of that group; its",
            "digits are those of G. Davis, *Baseline wavelet transform coder construction kit*, 1996.",
        ],
        [
            ("V18_10_ANALYSIS", mirrored([2.885256501123136e-02, 8.244478227504624e-05, -1.575264469076351e-01,
                                          7.679048884691438e-02, 7.589077294537618e-01], False)),
            ("V18_10_SYNTHESIS", mirrored([9.544158682436510e-04, -2.727196296995984e-06, -9.452462998353147e-03,
                                           -2.528037293949898e-03, 3.083373438534281e-02, -1.376513483818621e-02,
                                           -8.566118833165798e-02, 1.633685405569902e-01, 6.233596410344172e-01], False)),
            ("V13_11_ANALYSIS", mirrored([-8.472827741318157e-03, 3.759210316686883e-03, 4.728175282882753e-02,
                                          -3.347508104780150e-02, -6.887811419061032e-02, 3.832692613243884e-01,
                                          7.672451593927493e-01], True)),
            ("V13_11_SYNTHESIS", mirrored([1.418215589126359e-02, 6.292315666859828e-03, -1.087373652243805e-01,
                                           -6.916271012030040e-02, 4.481085999263908e-01, 8.328475700934288e-01], True)),
            ("V6_10_ANALYSIS", mirrored([-1.290777652578771e-01, 4.769893003875977e-02, 7.884856164056651e-01], False)),
            ("V6_10_SYNTHESIS", mirrored([1.891422775349768e-02, 6.989495243807747e-03, -6.723693471890128e-02,
                                          1.333892255971154e-01, 6.150507673110278e-01], False)),
        ],
    )
    write(
        "brislawn.rs",
        "Brislawn's 10/10 filters for image coding; his 9/7 are bior4.4.",
        [
            "C. M. Brislawn, *Fingerprints go digital*, Notices of the AMS 42 (1995), and the tutorial code of the same author;",
            "nine decimals are published, so the identities hold to 1e-8.",
        ],
        [
            ("B10_10_ANALYSIS", mirrored([0.026913419, -0.032303352, -0.241109818, 0.054100420, 0.899506092], False)),
            ("B10_10_SYNTHESIS", mirrored([0.019843545, 0.023817599, -0.023257840, 0.145570740, 0.541132748], False)),
        ],
    )
    write(
        "odegard.rs",
        "Odegard's smooth 9/7 filters.",
        [
            "J. E. Odegard, C. S. Burrus, *Smooth biorthogonal wavelets for applications in image compression*, Proc. DSP",
            "Workshop, Loen 1996.",
        ],
        [
            ("O9_7_ANALYSIS", mirrored([5.2865768532960523e-02, -3.3418473279346828e-02, -9.3069263703582719e-02,
                                        3.8697186387262039e-01, 7.8751377152779212e-01], True)),
            ("O9_7_SYNTHESIS", mirrored([-8.6748316131711606e-02, -5.4836926902779436e-02, 4.4030170672498536e-01,
                                         8.1678063499210640e-01], True)),
        ],
    )
    write(
        "adelson.rs",
        "Adelson's and Simoncelli's symmetric quadrature mirror filter of 9 taps.",
        [
            "E. H. Adelson, E. Simoncelli, R. Hingorani, *Orthogonal pyramid transforms for image coding*, Proc. SPIE 845 (1987).",
            "Near-perfect by design: the inverse is computed, see `level.rs`.",
        ],
        [("QMF9", mirrored([0.028220367, -0.060394127, -0.07388188, 0.41394752, 0.7984298], True))],
    )
    write(
        "beylkin.rs",
        "Beylkin's orthonormal filter of 18 taps.",
        [
            "G. Beylkin, R. Coifman, V. Rokhlin, *Fast wavelet transforms and numerical algorithms I*, Comm. Pure Appl. Math. 44",
            "(1991); digits as in `MakeONFilter` of `WaveLab`, to more places.",
        ],
        [("BEYLKIN", [0.099305765374353, 0.424215360812961, 0.699825214056600, 0.449718251149468, -0.110927598348234,
                      -0.264497231446384, 0.026900308803690, 0.155538731877093, -0.017520746266529, -0.088543630622924,
                      0.019679866044322, 0.042916387274192, -0.017460408696028, -0.014365807968852, 0.010040411844631,
                      0.0014842347824723, -0.002736031626258, 0.0006404853285212])],
    )
    write(
        "vaidyanathan.rs",
        "Vaidyanathan's orthonormal filter of 24 taps, optimised for coding speech.",
        [
            "P. P. Vaidyanathan, P.-Q. Hoang, *Lattice structures for optimal design and robust implementation of two-channel",
            "perfect-reconstruction QMF banks*, IEEE Trans. ASSP 36 (1988); digits (12 decimals) as in `MakeONFilter` of `WaveLab`.",
        ],
        [("VAIDYANATHAN", [-0.000062906118, 0.000343631905, -0.000453956620, -0.000944897136, 0.002843834547,
                           0.000708137504, -0.008839103409, 0.003153847056, 0.019687215010, -0.014853448005,
                           -0.035470398607, 0.038742619293, 0.055892523691, -0.077709750902, -0.083928884366,
                           0.131971661417, 0.135084227129, -0.194450471766, -0.263494802488, 0.201612161775,
                           0.635601059872, 0.572797793211, 0.250184129505, 0.045799334111])],
    )
    write(
        "battle_lemarie.rs",
        "Orthonormal splines of Battle and Lemarié of degree 1, 3 and 5, cut to 23, 41 and 59 taps.",
        [
            "G. Battle, *A block spin construction of ondelettes I*, Comm. Math. Phys. 110 (1987); P.-G. Lemarié, *Ondelettes à",
            "localisation exponentielle*, J. Math. Pures Appl. 67 (1988); lengths as in `WaveLab`. Computed from their Fourier",
            "transform; even and odd weights then sum to 1/sqrt(2) each. Not orthonormal beyond the cut: the inverse is computed.",
        ],
        [(f"SPLINE{d}", battle_lemarie(d, taps)) for d, taps in ((1, 23), (3, 41), (5, 59))],
    )


if __name__ == "__main__":
    main()
