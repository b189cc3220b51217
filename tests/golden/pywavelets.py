#!/usr/bin/env python3
"""Writes pywavelets.json beside itself: coefficients of PyWavelets for every basis it shares with this project.

    pip install PyWavelets==1.8.0 numpy
    python tests/golden/pywavelets.py

`periodic`: `wavedec(x[:96], name, "periodization", level=5)`, smooth coefficients first, then details from coarse to
fine. `inner`: details of x[:1021], far from the ends, of the first three levels: [level, index, value]. Other modes
than periodization place the filters of even half-length one sample earlier, so such a level is fed from its second
sample on. `standard`: `fswavedecn` of a 16 x 12 x 24 tensor with a basis for each axis, as one flat array with its
blocks in place: along each axis smooth coefficients first, then details from coarse to fine.
"""
import json
import os

import numpy as np
import pywt

HERE = os.path.dirname(os.path.abspath(__file__))


def signal(n):
    i = np.arange(n, dtype=np.int64)
    return ((i * i * 7) % 31 - 15).astype(float)


def rounded(values):
    return [float(f"{v:.10g}") for v in np.ravel(values)]


def inner(name):
    wavelet = pywt.Wavelet(name)
    half = wavelet.dec_len // 2
    x = signal(1021)
    # `first`: the index of the first sample that is left, all of which are free of any end.
    first, found = 0, []
    for level in (1, 2, 3):
        # Coefficient o reads samples 2o + 1 - half .. 2o + half.
        smooth, detail = pywt.dwt(x[1:] if (first + half) % 2 == 0 else x, wavelet, "zero")
        start = first + (1 if (first + half) % 2 == 0 else 0)
        # Entry i reads start + 2i + 1 - j, j = 0 .. 2 half - 1: o = (start + 2i + 1 - half) / 2.
        assert (start + 1 - half) % 2 == 0
        shift = (start + 1 - half) // 2
        last = first + len(x) - 1
        valid = [i for i in range(len(smooth)) if 2 * (i + shift) + 1 - half >= start and 2 * (i + shift) + half <= last]
        middle = valid[len(valid) // 2]
        for i in (middle - 1, middle, middle + 1):
            if i in valid:
                found.append([level, i + shift, float(f"{detail[i]:.10g}")])
        x, first = smooth[valid[0] : valid[-1] + 1], valid[0] + shift
    return found


def standard():
    bases, levels, shape = ["bior1.3", "db2", "bior4.4"], [3, 2, 3], (16, 12, 24)
    x = signal(16 * 12 * 24).reshape(shape)
    result = pywt.fswavedecn(x, bases, mode="periodization", levels=levels)
    return {"bases": bases, "levels": levels, "shape": shape, "coefficients": rounded(result.coeffs)}


def main():
    names = pywt.wavelist(kind="discrete")
    golden = {
        "pywavelets": pywt.__version__,
        "periodic": {n: rounded(np.concatenate(pywt.wavedec(signal(96), n, "periodization", level=5))) for n in names},
        "inner": {n: inner(n) for n in names},
        "standard": standard(),
    }
    with open(os.path.join(HERE, "pywavelets.json"), "w", encoding="utf-8") as f:
        json.dump(golden, f, separators=(",", ":"))
        f.write("\n")


if __name__ == "__main__":
    main()
