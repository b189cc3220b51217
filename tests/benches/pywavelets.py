#!/usr/bin/env python3
"""PyWavelets' time for the separable problem that `cargo bench -p wavelume-core --bench transform` prints last.

    pip install PyWavelets==1.8.0 numpy
    python tests/benches/pywavelets.py

`fswavedecn` of 16 x 1024 x 75 float32, haar x haar x bior4.4, full depth, periodization (symmetric beside it), best of
10.
"""
import time
import warnings

import numpy as np
import pywt


def main():
    warnings.simplefilter("ignore")
    x = np.random.default_rng(0).normal(size=(16, 1024, 75)).astype(np.float32)
    for mode in ("periodization", "symmetric"):
        best = float("inf")
        for _ in range(10):
            start = time.perf_counter()
            pywt.fswavedecn(x, ["haar", "haar", "bior4.4"], mode=mode, levels=[4, 10, 7])
            best = min(best, time.perf_counter() - start)
        print(f"PyWavelets {pywt.__version__}, fswavedecn, {mode}: {best * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
