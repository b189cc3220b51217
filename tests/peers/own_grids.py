"""Measurements' own grids of angles as other compressors get them, and the bytes a file may have beside the best.

A peer gets the samples as an array [incoming…, polar, azimuth, channels]. It writes neither axes nor units nor which
samples are missing: slices that repeat an earlier one bit for bit are left out, and samples that are not scored are
filled smoothly or with the least scored one ("clipped"), whichever gives fewer bytes. It codes values or logarithms.

Its error er(L2) is taken over the scored samples, those > 0 and not below a floor, each as often as the file states
it. A direction stated several times counts with each of its values. search.py says how the knob is searched.

Usage: own_grids.py      # checks itself
"""

import os
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "acceptance")]
import gridded  # noqa: E402
import others  # noqa: E402
import search  # noqa: E402

CHANNELS = "channels"
AXES = ["theta_i", "phi_i", "theta_o", "phi_o", CHANNELS]
# Scored samples: with more than MANY a file is to be smaller than a peer's, with fewer than FEW it may be larger.
MANY, FEW = 2000, 500
# Largest share of the best peer's bytes with many samples, at targets from the stated noise on and below it.
RATIO, RATIO_BELOW = 2 / 3, 0.83
# Bytes more than the best peer's that a file with few samples may have: it writes axes, classes and units.
EXTRA = 80
# Sweeps of the relaxation at each resolution; more make fillings smoother. Of 4, 16, 64 and 256 sweeps 16 gave the best
# peer of a car paint with a floor the fewest bytes.
SWEEPS = 16


class Grid(search.Truth):
    """The samples of a file as peers get them. `count` of them are scored; in a `whole` grid all are.

    `clipped`: samples that are not scored become the least scored one, and are filled smoothly otherwise.
    """

    encodings, near = 16, 0.99  # more than of run_peers.py: these arrays are small

    def __init__(self, name, samples, floor=None, clipped=False):
        self.clipped = clipped
        stated, names = shaped(samples)
        values, weights = distinct(stated)
        names = [name for name, n in zip(names, values.shape) if n > 1]
        shape = [n for n in values.shape if n > 1]
        self.angles = [k for k, name in enumerate(names) if name != CHANNELS]
        axes = [others.Axis(kind(name, samples.spectral)) for name in names]
        least = (floor or 0.0) * np.nanmax(samples.values)
        super().__init__(name, values.reshape(shape), axes, least, weights.reshape(shape))
        self.count = int(self.weights.sum())
        self.whole = self.scored.size == self.values.size

    def filled(self, known):
        """Values and logarithms of the grid without gaps."""
        if self.clipped:
            values = np.where(known, self.values, self.values[known].min())
            return values, np.log(values)
        values = np.where(known, self.values, np.float32(1)).astype(np.float64)
        both = smooth(values, known, self.angles), smooth(np.log(values), known, self.angles)
        return tuple(one.astype(np.float32) for one in both)


def kind(axis, spectral):
    """The kind of an axis, as others.py names it."""
    if axis != CHANNELS:
        return axis
    return "wavelength" if isinstance(spectral, list) else "rgb"


def shaped(samples):
    """The samples as one array, and the names of its axes; the sides of a surface lie side by side in azimuth."""
    blocks, first = [], 0
    for grid in samples.grids:
        rows = np.prod(list(grid.values()))
        names = [*grid, CHANNELS]
        block = samples.values[first : first + rows].reshape(*grid.values(), -1)
        order = [name for name in AXES if name in names]
        blocks.append(block.transpose([names.index(name) for name in order]))
        first += rows
    return np.concatenate(blocks, axis=-2), order


def distinct(values):
    """The array without slices that repeat an earlier one bit for bit, and how many each sample left stands for."""
    weights = np.ones((1,) * values.ndim)
    for axis in range(values.ndim):
        numbers = {}
        slices = np.moveaxis(values, axis, 0)
        index = [numbers.setdefault(one.tobytes(), len(numbers)) for one in slices]
        _, first, counts = np.unique(index, return_index=True, return_counts=True)
        values = np.take(values, first, axis)
        weights = weights * counts.reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    return values, np.broadcast_to(weights, values.shape)


# ---- filling


def smooth(values, known, axes):
    """The values, those that are not known near the mean of their neighbours along `axes`."""
    weights = known.astype(np.float64)
    everywhere = (values * weights).sum() / weights.sum()
    return spread(values * weights, weights, axes, everywhere)


def spread(sums, weights, axes, otherwise):
    """Means of blocks whose sums and weights are given.

    A block without weight gets the mean of the block twice as large around it, relaxed towards those of its neighbours,
    and `otherwise` where the largest has no weight either.
    """
    known = weights > 0
    means = np.where(known, sums, otherwise) / np.where(known, weights, 1.0)
    longer = [axis for axis in axes if means.shape[axis] > 1]
    if known.all() or not longer:
        return means
    coarse = spread(halved(sums, longer), halved(weights, longer), axes, otherwise)
    for axis in longer:
        coarse = np.repeat(coarse, 2, axis).take(range(means.shape[axis]), axis)
    guess = coarse
    for _ in range(SWEEPS):
        guess = (guess + beside(np.where(known, means, guess), longer)) / 2
    return np.where(known, means, guess)


def halved(values, axes):
    """Sums of pairs along each axis; the last of an odd length stays alone."""
    for axis in axes:
        values = np.add.reduceat(values, range(0, values.shape[axis], 2), axis)
    return values


def beside(values, axes):
    """The mean of the neighbours of each entry; at an end it is its own neighbour."""
    total = np.zeros_like(values)
    for axis in axes:
        ends = [(1, 1) if k == axis else (0, 0) for k in range(values.ndim)]
        wide, n = np.pad(values, ends, mode="edge"), values.shape[axis]
        total += wide.take(range(n), axis) + wide.take(range(2, n + 2), axis)
    return total / (2 * len(axes))


# ---- the best peers


def entries(grid, samples, floor, targets, peers, missing, log):
    """A row of each peer at each target in %, as search.run gives it, with the better of the fillings."""
    rows = named(search.run(grid, targets, peers, missing, log), "")
    if not grid.whole:
        clipped = Grid(grid.name, samples, floor, clipped=True)
        rows += named(search.run(clipped, targets, peers, {}, log), ", clipped")
    best = {}
    for row in rows:
        key = row["peer"], row["target"]
        best[key] = min(best.get(key, row), row, key=lambda one: (one["bytes"] == "", one["bytes"]))
    return list(best.values())


def named(rows, filling):
    """Rows whose settings tell the filling, and not the layout, of which there is one."""
    return [row | {"setting": row["setting"].removeprefix("array ") + filling} for row in rows]


# ---- the demand


def allowed(count, is_below, best):
    """The most bytes that a file may have beside the best peer's.

    `count`: scored samples; `is_below`: the target lies below the noise that the file states.
    """
    if count > MANY:
        return best * (RATIO_BELOW if is_below else RATIO)
    return best if count >= FEW else best + EXTRA


def check():
    """Shapes, copies, errors and the filling of a luminaire whose plane at 360° repeats that at 0°."""
    stated = np.outer([1.0, 2.0, 1.0], [1.0, 2.0, 4.0, 8.0])  # three planes of four elevations
    stated[1, 2] = 0.0
    samples = gridded.Samples(None, np.zeros((12, 2)), stated.reshape(-1), grids=[{"phi_o": 3, "theta_o": 4}])
    grid = Grid("lamp", samples)
    assert grid.values.tolist() == [[1, 2], [2, 4], [4, 0], [8, 16]] and grid.count == 11
    assert grid.weights.tolist() == [2, 1, 2, 1, 2, 2, 1]
    assert abs(grid.errors(grid.values * [1.1, 1.0])[1] - 0.1 * (8 / 11) ** 0.5) < 1e-6
    assert 4 < grid.for_peers["linear"][2, 1] < 16 and np.isclose(np.exp(grid.for_peers["log"]), grid.values)[:2].all()
    assert not grid.whole and Grid("lamp", samples, clipped=True).for_peers["linear"][2, 1] == 1
    assert Grid("floor", samples, 0.25).count == 6
    assert allowed(2001, False, 300) == 200 and allowed(2001, True, 300) == 249
    assert allowed(2000, False, 300) == allowed(500, True, 300) == 300 and allowed(499, False, 300) == 380


if __name__ == "__main__":
    check()
    print("own_grids.py: ok")
