"""The cost of a measurement's noise for any coder: the noise that wavelume estimates, and the least bytes for it.

The noise is what `wavelume compress --json` reports: the standard deviation of a typical sample's logarithm, hence
relative. Of an array clipped at a floor it is that of the samples above the floor (`--floor`), as the others have none.

The bound. Say samples are s = m (1 + σ g), g normal and independent from sample to sample. Let coder and decoder know
every m, so that the signal costs nothing. er(L2)² is to first order the mean square error of ln s, and a normal
variable of variance σ² needs ½ log2(σ²/D²) bits for a mean square error of D² < σ² (Shannon 1959; Cover & Thomas,
section 10.3). So N samples at er(L2) D cost at least N log2(σ/D) bits. Signs, masks and the signal itself come on top,
and so do samples that are noisier than the typical one; noise that neighbours share, and an estimate of σ that is too
large, take off.

What is N. Positive, unmasked samples above the floor, each independent one once: rows of the last axis (spectra,
colours) that equal another row bit for bit are copies that a projection made of one reading. The error is a mean over
all copies, and over samples at the floor, which can be exact: with m copies of sample j and n scored samples the
optimum has m D_j² = min(m σ², θ) with a θ that spends Σ m D_j² = n D² (reverse water-filling).

Usage: rate_bound.py      # checks its own identities
"""

import json
import os
import subprocess
from dataclasses import dataclass

import numpy as np

ABOVE = 1.001  # times the floor: samples clipped to it are not above


@dataclass
class Noise:
    """The noise of an array and what carries it."""

    relative: float  # standard deviation of one sample, as a fraction; 0 where the program tells none
    uncertainty: float
    copies: np.ndarray  # of each independent sample, how often it stands in the array
    scored: int  # samples > 0

    def below(self, target):
        """Tells if a target (a fraction) lies below the noise."""
        return target < self.relative

    def bound(self, target):
        """Bytes that any coder spends on this noise alone at er(L2) `target`."""
        return least_bytes(self.copies * self.relative**2, self.scored * target**2)


def least_bytes(power, allowed):
    """Bytes for independent normal variables of these variances (each times its copies) at this sum of square
    errors."""
    power = np.sort(power[power > 0])
    if power.sum() <= allowed:
        return 0.0
    spent = np.concatenate([[0.0], np.cumsum(power)[:-1]])  # by those that are left to their own variance
    level = (allowed - spent) / np.arange(len(power), 0, -1)
    first = int(np.argmax(level < power))
    return float(np.log2(power[first:] / level[first]).sum() / 2 / 8)


def copies(values, least):
    """Number of times that each independent sample > `least` stands in an array of float32."""
    rows = np.ascontiguousarray(values).reshape(-1, values.shape[-1])
    whole = rows.view(np.dtype((np.void, rows.shape[1] * rows.itemsize))).reshape(-1)
    _, first, count = np.unique(whole, return_index=True, return_counts=True)
    return np.broadcast_to(count[:, None], (len(first), rows.shape[1]))[rows[first] > least]


def estimate(binary, path, values, floor=0.0):
    """The noise of the array in a .npy; with a floor (a fraction of the maximum) that of the samples above it."""
    material = path[:-4] + ".noise.wlm"
    command = [binary, "compress", path, "-o", material, "--no-metadata", "--json", "--er-l2", "0.05"]
    command += ["--floor", repr(floor * ABOVE)] if floor else []
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    os.remove(material)
    found = json.loads(done.stdout)["noise"] or {"relative": 0.0, "uncertainty": 0.0, "common": 0.0}
    # Noise that whole spectra share costs bytes a spectrum, which this bound leaves out.
    least = floor * ABOVE * float(np.nanmax(values)) if floor else 0.0
    scored = int(np.count_nonzero(values > 0))
    return Noise(found["relative"], found["uncertainty"], copies(values, least), scored)


def check():
    """Closed forms, a numeric water level, and a count of copies."""
    ones, pairs = np.ones(1000), np.full(500, 2)
    closed = [
        (Noise(0.03, 0, ones, 1000).bound(0.01), 1000 * np.log2(3) / 8),
        (Noise(0.03, 0, pairs, 1000).bound(0.01), 500 * np.log2(3) / 8),
        (Noise(0.03, 0, ones, 4000).bound(0.01), 1000 * np.log2(1.5) / 8),  # three quarters exact: the rest may have 2 %
        (Noise(0.03, 0, ones, 1000).bound(0.031), 0.0),
    ]
    power, low, high = np.random.default_rng(0).uniform(0, 1, 1000), 0.0, 1.0
    for _ in range(60):
        level = (low + high) / 2
        low, high = (low, level) if np.minimum(power, level).sum() > 30 else (level, high)
    closed.append((least_bytes(power, 30.0), np.log2(np.maximum(power / level, 1)).sum() / 16))
    for found, expected in closed:
        assert abs(found - expected) <= 1e-6 * max(expected, 1), (found, expected)
    rows = np.array([[1, 2], [3, 0.5], [1, 2], [0, -1]], np.float32)
    assert sorted(copies(rows, 0.0)) == [1, 1, 2, 2] and sorted(copies(rows, 0.6)) == [1, 2, 2]


if __name__ == "__main__":
    check()
    print("rate_bound.py: ok")
