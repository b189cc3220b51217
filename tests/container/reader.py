#!/usr/bin/env python3
"""An independent reader of materials of version 1, beside docs/container.md: numpy, and nothing of the project's.

Usage:
  reader.py --check            decodes the golden files beside this file and compares every bit; compares the dump in
                               docs/container.md with that of its file
  reader.py --dump FILE.wlm    every byte of a file, explained
  reader.py FILE.wlm [OUT.npy] decodes a file

It favours being read over speed: about 100,000 decisions of the range decoder a second. It covers everything but the
wavelets on a line other than Haar, 5/3 and 9/7 under their own boundary rules.
"""
import json
import math
import os
import struct
import sys

import numpy as np

F = np.float32
HERE = os.path.dirname(os.path.abspath(__file__))
DOCUMENT = os.path.join(HERE, "..", "..", "docs", "container.md")
DUMPED = "luminaire"

MAX_SAMPLES, MAX_AXES, MAX_LEVEL = 1 << 28, 8, 8
MAX_WAVELENGTHS, MAX_ENTRIES, MAX_METADATA = 1 << 16, 1 << 20, 1 << 24


class Refused(Exception):
    """These bytes are no material, or one that this reader must not guess at."""


def require(holds, why):
    if not holds:
        raise Refused(why)


# ---------------------------------------------------------------------------------------------------------------------
# Fields


class Fields:
    """Reads fields of `data[at:end]`; notes what each byte is, if asked."""

    def __init__(self, data, at=0, end=None, trace=None):
        self.data, self.start, self.at, self.end = data, at, at, len(data) if end is None else end
        self.trace = trace

    def note(self, start, text):
        if self.trace is not None:
            self.trace.append((start, self.at, text))

    def take(self, count, text=None):
        require(self.at + count <= self.end, f"byte {self.at}: the bytes end too early")
        start, self.at = self.at, self.at + count
        if text is not None:
            self.note(start, text)
        return self.data[start : self.at]

    def left(self):
        return self.end - self.at

    def unsigned(self, count):
        return int.from_bytes(self.take(count), "little")

    def number(self, code):
        value = struct.unpack("<" + code, self.take(struct.calcsize(code)))[0]
        require(math.isfinite(value), "a number that is not finite")
        return value

    def varint(self, limit=(1 << 64) - 1):
        value, shift = 0, 0
        while True:
            byte = self.unsigned(1)
            require(not (byte == 0 and shift > 0) and shift <= 63, "not the shortest form of an integer")
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
            shift += 7
        require(value <= limit, f"{value} is more than {limit}")
        return value


# ---------------------------------------------------------------------------------------------------------------------
# BLAKE3 (O'Connor, Aumasson, Neves & Wilcox-O'Hearn 2020), hashing only

IV = [0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A, 0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19]
PERMUTATION = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8]
MASK = 0xFFFFFFFF


def blake3_compress(chaining, words, counter, length, flags):
    v = list(chaining) + IV[:4] + [counter & MASK, counter >> 32, length, flags]
    turn = lambda x, n: (x >> n | x << (32 - n)) & MASK

    def mix(a, b, c, d, x, y):
        v[a] = (v[a] + v[b] + x) & MASK
        v[d] = turn(v[d] ^ v[a], 16)
        v[c] = (v[c] + v[d]) & MASK
        v[b] = turn(v[b] ^ v[c], 12)
        v[a] = (v[a] + v[b] + y) & MASK
        v[d] = turn(v[d] ^ v[a], 8)
        v[c] = (v[c] + v[d]) & MASK
        v[b] = turn(v[b] ^ v[c], 7)

    m = list(words)
    for _ in range(7):
        mix(0, 4, 8, 12, m[0], m[1])
        mix(1, 5, 9, 13, m[2], m[3])
        mix(2, 6, 10, 14, m[4], m[5])
        mix(3, 7, 11, 15, m[6], m[7])
        mix(0, 5, 10, 15, m[8], m[9])
        mix(1, 6, 11, 12, m[10], m[11])
        mix(2, 7, 8, 13, m[12], m[13])
        mix(3, 4, 9, 14, m[14], m[15])
        m = [m[i] for i in PERMUTATION]
    return [v[i] ^ v[i + 8] for i in range(8)]


def blake3(data):
    def chunk(piece, number, root):
        chaining = IV
        blocks = [piece[i : i + 64] for i in range(0, len(piece), 64)] or [b""]
        for i, block in enumerate(blocks):
            words = struct.unpack("<16I", block.ljust(64, b"\0"))
            flags = (i == 0) * 1 | (i + 1 == len(blocks)) * (2 | root * 8)
            chaining = blake3_compress(chaining, words, number, len(block), flags)
        return chaining

    def tree(first, last, root):
        if last - first == 1:
            return chunk(data[first * 1024 : last * 1024], first, root)
        left = 1 << ((last - first - 1).bit_length() - 1)
        words = tree(first, first + left, 0) + tree(first + left, last, 0)
        return blake3_compress(IV, words, 0, 64, 4 | root * 8)

    return struct.pack("<8I", *tree(0, max(1, -(-len(data) // 1024)), 1))


# ---------------------------------------------------------------------------------------------------------------------
# The range decoder and the model


class Decoder:
    def __init__(self, data):
        self.data, self.at = data, 0
        self.range, self.code = MASK, 0
        for _ in range(4):
            self.code = self.code << 8 | self.next()

    def next(self):
        self.at += 1
        return self.data[self.at - 1] if self.at <= len(self.data) else 0

    def bit(self, p1):
        bound = (self.range >> 16) * p1
        bit = self.code < bound
        if bit:
            self.range = bound
        else:
            self.code -= bound
            self.range -= bound
        while self.range < 1 << 24:
            self.range = self.range << 8 & MASK
            self.code = (self.code << 8 | self.next()) & MASK
        return int(bit)

    def even(self):
        return self.bit(1 << 15)

    def bits(self, count):
        value = 0
        for _ in range(count):
            value = value << 1 | self.even()
        return value


def nearest(x):
    """The nearest integer, halves away from 0."""
    return int(math.copysign(math.floor(abs(x) + 0.5), x))


ODDS = 3072
STRETCH = [nearest(256 * math.log(p / (1 - p))) for p in ((i + 0.5) / 4096 for i in range(4096))]
SQUASH = [min(max(nearest(65536 / (1 + math.exp(-x / 256))), 1), 65535) for x in range(-ODDS, ODDS + 1)]
RATE = [nearest(65536 / (n + 1.6)) for n in range(255)]


class Model:
    """Adaptive probabilities by context, made when they are first asked for, and sets of mixing weights."""

    def __init__(self, prior=lambda context: 32768):
        self.slots, self.weights, self.prior = {}, {}, prior

    def slot(self, context):
        slot = self.slots.get(context)
        if slot is None:
            p = self.prior(context)
            slot = self.slots[context] = [min(max(p, 64), 65472) << 6, 0]
        return slot

    @staticmethod
    def update(slot, bit):
        p, count = slot
        rate = RATE[count]
        if bit:
            slot[0] = p + ((((1 << 22) - 1 - p) * rate) >> 16)
        else:
            slot[0] = p - ((p * rate) >> 16)
        slot[1] = min(count + 1, 254)

    def one(self, coder, context):
        slot = self.slot(context)
        bit = coder.bit(min(max(slot[0] >> 6, 1), 65535))
        self.update(slot, bit)
        return bit

    def mixed(self, coder, contexts, name):
        slots = [self.slot(context) for context in contexts]
        weights = self.weights.setdefault(name, [26214 if len(slots) == 3 else 15728] * len(slots))
        stretched = [STRETCH[slot[0] >> 10] for slot in slots]
        odds = sum(s * w for s, w in zip(stretched, weights)) >> 16
        p1 = SQUASH[min(max(odds, -ODDS), ODDS) + ODDS]
        bit = coder.bit(p1)
        error = (bit << 16) - p1
        for i, s in enumerate(stretched):
            product = error * s
            part = abs(product) // 16 * (1 if product >= 0 else -1)
            weights[i] = min(max(weights[i] + (part * 5 >> 12), -(1 << 20)), 1 << 20)
        for slot in slots:
            self.update(slot, bit)
        return bit


FINE_BOUNDS = [0, 1, 2, 4, 8, 13, 19, 32, 56, 96, 192]
COARSE_BOUNDS = [0, 1, 2, 4, 9]
LARGER = [5243, 5243, 5243, 6554, 9830, 16384, 23593, 32768, 42598, 51118, 57672, 62259]
NONZERO = [1311, 3277, 6554, 13107, 22938, 32768, 42598, 52429, 58982, 62259, 63570, 64225]


def fine(sixteenths):
    return sum(sixteenths > bound for bound in FINE_BOUNDS)


def coarse(magnitude):
    return sum(magnitude > bound for bound in COARSE_BOUNDS)


def golomb(coder, model, name):
    doublings = 0
    while doublings < 30 and model.one(coder, (name, "more", doublings)):
        doublings += 1
    if doublings == 0:
        return 0
    top = model.one(coder, (name, "top", doublings))
    return ((2 | top) << (doublings - 1) | coder.bits(doublings - 1)) - 1


def magnitude(coder, model, first, second, level):
    for s in range(13):
        contexts = [("first", s, first), ("second", s, second), ("third", s, level)]
        if not model.mixed(coder, contexts, ("larger", s)):
            return s + 1
    return min(14 + golomb(coder, model, "escape"), (1 << 31) - 1)


# ---------------------------------------------------------------------------------------------------------------------
# Axes

QUANTITIES = ["spectrum", "reflectance", "edf", "brdf", "btdf", "bsdf", "phase"]
DIRECTIONS = [0, 1, 1, 2, 2, 2, 2]
UNITS = ["relative", "1", "1/sr", "cd", "cd/klm", "W/sr", "mW/sr", "uW/sr", "umol/s/sr"]
UNITS += ["W/sr/nm", "mW/sr/nm", "uW/sr/nm", "umol/s/sr/nm", "relative/nm"]
HEMISPHERE, LOWER, SPHERE = 0, 1, 2
DOMAINS = ["hemisphere", "lower hemisphere", "sphere"]


class Axis:
    def __init__(self, kind, count, values=None, domain=None, level=None):
        self.kind, self.count, self.values, self.domain, self.level = kind, count, values, domain, level

    def __repr__(self):
        if self.kind == "triangles":
            return f"{self.count} triangles of the {DOMAINS[self.domain]}, level {self.level}"
        if self.kind == "grid":
            polar, azimuths, frame, _ = self.values
            around = f" x {len(azimuths)} azimuths" if azimuths else ""
            return f"{len(polar)} polar angles{around}, {FRAMES[frame]}"
        if self.kind in ("wavelength", "elevation"):
            unit = "nm" if self.kind == "wavelength" else "degrees"
            return f"{self.count} {self.kind}s, {self.values[0]:g} to {self.values[-1]:g} {unit}"
        return f"{self.kind}, {self.count} entries"


FRAMES = ["surface", "type C", "type B", "type A"]
SECTOR = 2
EXTENTS = [(-720, 720)] * 3 + [(0, 180), (90, 270), (0, 90)]


def increases(v, low, high):
    require(all(a < b for a, b in zip(v, v[1:])), "an axis that does not increase")
    require(v and low <= v[0] and v[-1] <= high, "values out of range")


def read_grid(r, form):
    polar = read_list(r, form, MAX_ENTRIES)
    flags = r.unsigned(1)
    require(flags < 128, "unknown flags of a grid of directions")
    frame = flags & 3
    low, high = (0, 180) if frame < 2 else (-90, 90)
    increases(polar, low, high)
    least = r.number("d") if flags & 32 else polar[0]
    most = r.number("d") if flags & 64 else polar[-1]
    require(low <= least <= polar[0] and polar[-1] <= most <= high, "a range covered that is not around its angles")
    require(not flags & 8 or frame > 1 and polar[0] >= 0, "mirrored angles that are no latitudes from 0 on")
    azimuths = []
    if flags & 16:
        first = r.unsigned(1)
        require(first & 7 == 6 and first >> 3 in [13, 14, 15] + list(range(10)), "no azimuths after polar angles")
        azimuths = read_list(r, first >> 3, MAX_ENTRIES)
        extent = r.unsigned(1)
        require(extent < len(EXTENTS), "an unknown extent of azimuths")
        increases(azimuths, *EXTENTS[extent])
        span = azimuths[-1] - azimuths[0]
        require(span == 360 if extent == 1 else span < 360 if extent == 0 else span <= 360, "azimuths of another extent")
        require(len(polar) * len(azimuths) <= MAX_SAMPLES, "too many directions")
    return Axis("grid", len(polar) * max(len(azimuths), 1), (polar, azimuths, frame, extent if azimuths else None))


def triangles(domain, level):
    return Axis("triangles", (8 if domain == SPHERE else 4) << 2 * level, None, domain, level)


def read_axis(r):
    start = r.at
    first = r.unsigned(1)
    if first >= 128:
        domain, level = first >> 5 & 3, first & 31
        require(domain < 3 and level <= MAX_LEVEL, "triangles of an unknown domain or level")
        axis = triangles(domain, level)
        r.note(start, f"axis: {axis}")
        return axis
    kind, form = first & 7, first >> 3
    forms = {0: [15], 1: [13, 14, 15], 2: [13, 14, 15], 5: [13, 14, 15]}.get(kind)
    require(form in forms + list(range(10)) if forms else kind in (3, 4) and form == 0, "an unknown axis")
    if kind == 0:
        number = lambda: r.number("d") if form == 15 else float(r.varint()) / power(form)
        at, step, count = number(), number(), r.varint(MAX_WAVELENGTHS)
        axis = Axis("wavelength", count, [at + i * step for i in range(count)])
    elif kind == 3:
        axis = Axis("index", r.varint(MAX_ENTRIES))
    elif kind == 4:
        axis = Axis("rgb", 3)
    elif kind == 5:
        axis = read_grid(r, form)
    else:
        values = read_list(r, form, MAX_WAVELENGTHS if kind == 1 else MAX_ENTRIES)
        axis = Axis("wavelength" if kind == 1 else "elevation", len(values), values)
    require(axis.count > 0, "an empty axis")
    if axis.values and kind != 5:
        v = axis.values
        require(all(a < b for a, b in zip(v, v[1:])), "an axis that does not increase")
        require(v[0] > 0 and math.isfinite(v[-1]) if kind < 2 else v[0] >= 0 and v[-1] <= 90, "values out of range")
    r.note(start, f"axis: {axis}")
    return axis


def power(decimals):
    scale = 1.0
    for _ in range(decimals):
        scale *= 10.0
    return scale


def read_list(r, form, limit):
    count = r.varint(limit)
    if form == 15:
        return [r.number("d") for _ in range(count)]
    if form == 13:
        return spaced(r, count)
    terms = r.unsigned(1)
    require(terms <= 13, "too long a polynomial")
    terms = [r.number("d") for _ in range(terms)]
    coder, model = Decoder(r.take(r.varint())), Model()
    integers, last, difference = [], 0, 0
    for i in range(count):
        guess = 0 if terms else last + difference
        name = min(i, 2)
        high = golomb(coder, model, name)
        low = coder.bits(30) if high else golomb(coder, model, name)
        residual = high << 30 | low
        value = guess + (residual >> 1 ^ -(residual & 1))
        difference, last = (0 if i == 0 else value - last), value
        integers.append(value)
    for i in range(count if terms else 0):
        t = 2.0 * i / (count - 1) - 1.0 if count > 1 else 0.0
        after, following = 0.0, 0.0
        for c in reversed(terms[1:]):
            after, following = c + 2.0 * t * after - following, after
        value = terms[0] + t * after - following
        if form == 14:
            integers[i] += struct.unpack("<I", struct.pack("<f", F(value)))[0]
        else:
            integers[i] += int(min(max(nearest(value * power(form)), -(1 << 28)), 1 << 28))
    if form == 14:
        return [struct.unpack("<f", struct.pack("<I", k))[0] for k in integers]
    return [k / power(form) for k in integers]


def spaced(r, count):
    first = r.unsigned(1)
    rule, form = first & 15, first >> 4
    require(rule < 3 and (form < 10 or form == 15), "an unknown spacing")
    ends = []
    for _ in range(2):
        z = None if form == 15 else r.varint()
        ends.append(r.number("d") if form == 15 else (z >> 1 ^ -(z & 1)) / power(form))
    start, end = ends
    last = max(count - 1, 1)
    if rule == 1:
        step = (end - start) / last
        return [end if i == last else start + i * step for i in range(count)]
    values = [end if i == last else start + i * (end - start) / last for i in range(count)]
    if rule == 2:
        require(all(-1 <= value <= 1 for value in values), "no cosines")
        values = [nearest(math.degrees(math.acos(value)) * 1e9) / 1e9 for value in values]
    return values


def check_layout(quantity, axes):
    kinds = [axis.kind for axis in axes]
    i = 0
    while i < len(kinds) and kinds[i] == "index":
        i += 1
    first = i
    while i < len(kinds) and kinds[i] in ("triangles", "elevation", "grid"):
        i += 1
    directions = i - first
    i += i < len(kinds) and kinds[i] in ("wavelength", "rgb")
    require(i == len(kinds), "axes out of order")
    require(directions in (0, DIRECTIONS[quantity]), "directions that do not fit the quantity")
    outgoing = directions == 2 or quantity == 2 and directions == 1
    require(not outgoing or kinds[first + directions - 1] != "elevation", "elevations of outgoing directions")
    require(not {"triangles", "grid"} <= set(kinds), "triangles beside a grid of directions")


# ---------------------------------------------------------------------------------------------------------------------
# The header

RD, CONVENTIONAL, LOSSLESS, GENERIC, ADAPTIVE = range(5)
POLICIES = ["rate-distortion", "conventional", "lossless", "generic", "adaptive"]
KLT, PREDICTED, CLASSES, FLOOR, CORRECTIONS, UNSCORED, COUNTS, LINEAR, LIGHT, GRIDDED, STRAIGHT, LEVELS, FACTOR, BETWEEN, LOBE, WIDE = (
    1 << k for k in range(16)
)
FIXED = ["identity", "bio-haar", "orthonormal-area", "orthonormal-count"]


class Header:
    pass


def read_header(r):
    h = Header()
    first = r.unsigned(1)
    h.quantity, h.sampling, axes = first & 7, first >> 3 & 1, first >> 4
    require(h.quantity < len(QUANTITIES) and axes <= MAX_AXES, "an unknown quantity, or too many axes")
    r.note(r.at - 1, f"quantity {QUANTITIES[h.quantity]}, samples are {['averages', 'points'][h.sampling]}, {axes} axes")
    second = r.unsigned(1)
    h.unit, h.policy = second & 31, second >> 5
    require(h.unit < len(UNITS) and h.policy < len(POLICIES), "an unknown unit or policy")
    r.note(r.at - 1, f"unit {UNITS[h.unit]}, policy {POLICIES[h.policy]}")
    start, h.flags = r.at, r.varint()
    others = CLASSES | FLOOR | COUNTS | STRAIGHT | BETWEEN | LOBE | WIDE
    allowed = {RD: 4095 | BETWEEN | LOBE | WIDE, LOSSLESS: others | FACTOR}.get(h.policy, others | UNSCORED)
    require(h.flags & ~allowed == 0, "unknown flags, or flags that do not fit the policy")
    r.note(start, f"flags {h.flags:#05x}")
    h.axes = [read_axis(r) for _ in range(axes)]
    h.shape = [axis.count for axis in h.axes]
    h.count = math.prod(h.shape)
    require(h.count <= MAX_SAMPLES, "too many samples")
    check_layout(h.quantity, h.axes)
    kinds = {axis.kind for axis in h.axes}
    require("triangles" in kinds or not h.flags & PREDICTED, "a pyramid without triangles")
    require(kinds & {"triangles", "grid"} or not h.flags & LIGHT, "light without directions")
    h.grid = GridShape.of(h.axes)
    require(not h.flags & GRIDDED or h.grid and not h.flags & PREDICTED, "a predicted grid without one, or with a pyramid")
    require(not h.flags & LEVELS or h.flags & GRIDDED, "levels of a grid chunk without one")
    h.straight_lines = 0
    if h.flags & STRAIGHT:
        directions = [axis.kind for axis in h.axes if axis.kind in ("triangles", "grid")]
        require(directions and directions[-1] == "grid", "straight lines between directions that are not on a grid")
        h.straight_lines = r.unsigned(1)
        require(h.straight_lines > 0, "a share of straight lines that is 0")
        r.note(r.at - 1, f"{h.straight_lines} of 255 parts are straight lines")
    require(not h.flags & LIGHT or not h.flags & LINEAR, "light of what are no logarithms")
    require(not h.flags & KLT or h.axes, "a spectral basis without an axis")
    h.transforms = ["identity"] * axes
    if h.policy != LOSSLESS and not h.flags & (PREDICTED | GRIDDED):
        for i in range(axes - bool(h.flags & KLT)):
            start, code = r.at, r.varint()
            require(code < 4 or 16 <= code < 139, "an unknown transform")
            h.transforms[i] = FIXED[code] if code < 4 else (code - 16, r.unsigned(1))
            require(code < 4 or h.transforms[i][1] < 5, "an unknown boundary rule")
            require(code == 0 or (code < 4) == (h.axes[i].kind == "triangles"), "a transform that does not fit")
            r.note(start, f"transform of axis {i}: {h.transforms[i]}")
    h.pyramid_length = None
    if h.flags & (PREDICTED | LEVELS):
        start, h.pyramid_length = r.at, r.varint()
        r.note(start, f"length of chunk {'P' if h.flags & PREDICTED else 'G'} {h.pyramid_length}")
    h.step = h.light_step = h.correction_step = h.floor = F(0)
    h.negative_bound = None
    if h.policy == RD:
        h.step = np.array([r.unsigned(2) << 16], np.uint32).view(F)[0]
        require(h.step > 0 and np.isfinite(h.step), "a step that is no positive number")
        r.note(r.at - 2, f"step {h.step:.9g}")
    for flag, name in [(LIGHT, "light_step"), (CORRECTIONS, "correction_step"), (FLOOR, "floor")]:
        if h.flags & flag:
            setattr(h, name, F(r.number("f")))
            signed = flag == LIGHT and h.flags & GRIDDED and h.flags & (CLASSES | WIDE)
            size = abs(getattr(h, name)) if signed else getattr(h, name)
            require(size > 0, f"a {name} that is no positive number")
            r.note(r.at - 4, f"{name.replace('_', ' ')} {getattr(h, name):.9g}")
    h.factor = 1.0
    if h.flags & FACTOR:
        h.factor = r.number("d")
        require(h.factor > 0, "a factor that is no positive number")
        r.note(r.at - 8, f"factor of the samples {h.factor!r}")
    h.errors = []
    if h.policy != LOSSLESS:
        start, h.kept = r.at, r.varint()
        r.note(start, f"{h.kept} coefficients are not zero")
        names = ["er(L1)", "er(L2)", "largest relative error", "relative RMSE", "largest absolute error"]
        for name in names + ["largest absolute error of unscored samples"] * bool(h.flags & UNSCORED):
            error = np.array([r.unsigned(3) << 8], np.uint32).view(F)[0]
            require(error >= 0 and np.isfinite(error), "an error that is no number")
            h.errors.append(error)
            r.note(r.at - 3, f"{name} {error:.6g}")
    h.counts = [0] * 4
    if h.flags & COUNTS:
        start = r.at
        h.counts = [r.varint() for _ in range(4)]
        require(sum(h.counts) <= h.count, "more unscored samples than samples")
        r.note(start, "zero, negative, below-floor and masked samples: " + ", ".join(map(str, h.counts)))
    require(r.left() == 0, "bytes after the end of the header")
    return h


def announced(h):
    letters = [("V", h.flags & BETWEEN), ("A", h.flags & LOBE), ("C", h.flags & CLASSES), ("D", h.flags & WIDE), ("B", h.flags & KLT), ("P", h.flags & PREDICTED), ("G", h.flags & GRIDDED)]
    letters += [("Q", h.policy != LOSSLESS and not h.flags & (PREDICTED | GRIDDED))]
    letters += [("L", h.flags & LIGHT), ("R", h.flags & CORRECTIONS), ("X", h.policy == LOSSLESS)]
    return [letter for letter, there in letters if there]


# ---------------------------------------------------------------------------------------------------------------------
# Between incidences

# The polynomial of section 17, and ln 2 in two parts.
LOGARITHM = [7.0376836e-2, -1.151461e-1, 1.1676999e-1, -1.2420141e-1, 1.4249323e-1, -1.6668058e-1, 2.0000715e-1]
LOGARITHM = [F(c) for c in LOGARITHM + [-2.4999994e-1, 3.333333e-1]]
LN_2_HIGH, LN_2_LOW = F(0.6933594), F(-2.1219444e-4)


def logarithm(x):
    """ln of positive normal f32, in f32 steps; see section 17."""
    bits = x.view(np.uint32)
    m = (bits & 0x007FFFFF | 0x3F000000).astype(np.uint32).view(F)
    low = m < F(0.70710677)
    e = ((bits >> 23).astype(np.int32) - 126 - low).astype(F)
    r = np.where(low, m + m - F(1), m - F(1)).astype(F)
    rr, p = r * r, np.full(r.shape, LOGARITHM[0])
    for c in LOGARITHM[1:]:
        p = p * r + c
    tail = p * r * rr + e * LN_2_LOW - F(0.5) * rr
    return (r + tail) + e * LN_2_HIGH


DIVISORS = ["nothing", "the cosines", "projected areas", "masking", "a microfacet model"]
NUMBERS = [("roughness", 2.0**-10, 4), ("reflectance", 2.0**-13, 1), ("base", 0, 2**20)]


class Between:
    """Chunk V: what logarithms are divided by before they are interpolated between incidences, and the curve."""

    def __init__(self, r, h):
        first = r.unsigned(1)
        self.divisor, self.cubic, self.retro = first & 7, bool(first & 8), bool(first & 16)
        require(0 < first < 32, "an unknown interpolation between incidences")
        require(self.divisor < len(DIVISORS), "an unknown divisor")
        order = "cubic" if self.cubic else "linear"
        r.note(r.at - 1, f"{order}, divided by {DIVISORS[self.divisor]}{', about the way back' * self.retro}")
        self.numbers = []
        for name, low, high in NUMBERS[: [0, 0, 1, 1, 3][self.divisor]]:
            number = np.array([r.unsigned(2) << 16], np.uint32).view(F)[0]
            require(not np.signbit(number) and low <= number <= high, f"a {name} out of bounds")
            self.numbers.append(float(number))
            r.note(r.at - 2, f"{name} {number:.9g}")
        require(r.left() == 0, "bytes after the end of chunk V")
        directions = [axis.kind for axis in h.axes if axis.kind in ("triangles", "elevation", "grid")]
        require(len(directions) == 2, "incidences that are none")
        require(not self.divisor and not self.retro or h.quantity == 3, "a divisor of what is no BRDF")

    def logarithms(self, incoming, outgoing):
        """ln V for all pairs of directions as f32, in the steps of section 17."""
        (ix, iy, iz), (ox, oy, oz) = np.array(incoming).astype(F).T[:, :, None], np.array(outgoing).astype(F).T[:, None]
        one, least = F(1), F(1e-3)
        ci, co = np.maximum(np.abs(iz), least), np.maximum(np.abs(oz), least)
        aa = F(self.numbers[0]) * F(self.numbers[0]) if self.numbers else F(0)
        r = lambda c: np.sqrt(c * c + aa * (one - c * c))
        if self.divisor == 1:
            return logarithm(one / (ci + co))
        if self.divisor == 2:
            return logarithm(one / ((ci + r(ci)) * (co + r(co))))
        masking = co * r(ci) + ci * r(co)
        if self.divisor == 3:
            return logarithm(one / masking)
        x, y, z = ix + ox, iy + oy, iz + oz
        across = x * x + y * y
        s = np.maximum(across + z * z, F(1e-12))
        spread = (across + aa * z * z) / s
        away = np.maximum(one - F(0.5) * np.sqrt(s), F(0))
        reflectance, base = map(F, self.numbers[1:])
        fresnel = reflectance + (one - reflectance) * ((away * away) * (away * away) * away)
        return logarithm(base + fresnel * aa / (spread * spread * masking))

    def value(self, wi, wo):
        """V for unit vectors above the horizon, f64; see section 17."""
        (ci, co), aa = (wi[2], wo[2]), self.numbers[0] ** 2 if self.numbers else 0
        r = lambda c: math.sqrt(c * c + aa * (1 - c * c))
        masking = co * r(ci) + ci * r(co)
        if self.divisor < 4:
            return [lambda: 1, lambda: 1 / (ci + co), lambda: 1 / ((ci + r(ci)) * (co + r(co))), lambda: 1 / masking][self.divisor]()
        h = [a + b for a, b in zip(wi, wo)]
        length = math.sqrt(sum(x * x for x in h))
        d = aa / ((h[0] ** 2 + h[1] ** 2 + aa * h[2] ** 2) / length**2) ** 2
        reflectance, base = self.numbers[1:]
        return base + (reflectance + (1 - reflectance) * (1 - length / 2) ** 5) * d / masking


# ---------------------------------------------------------------------------------------------------------------------
# A lobe beside the cells

CENTRES = ["the mirror direction", "the mirror direction, in half vectors", "the direction back to the source"]
OF_LOBE = [("p0", -1024, 1024), ("p1", -1024, 1024), ("p2", -1024, 1024), ("t0", 0, 8), ("t1", 0, 8)]
WIDTH, ANGLE, TAIL = ("half-width", 1e-5, 1), ("angle", -3.2, 3.2), ("tail", 0, 0.5)


class Lobe:
    """Chunk A: an analytic lobe that is added to the function of the cells."""

    def __init__(self, r, h):
        first = r.unsigned(1)
        self.centre, two = first & 3, bool(first & 4)
        require(first < 8 and self.centre < len(CENTRES), "an unknown lobe")
        r.note(r.at - 1, f"a lobe about {CENTRES[self.centre]}, {'two widths' if two else 'one width'}")
        fields = OF_LOBE + [WIDTH] + [WIDTH, ANGLE] * two + [TAIL]
        numbers = []
        for name, low, high in fields:
            number = float(r.number("f"))
            # Bounds are those of the f32 nearest to them.
            require(F(low) <= number <= F(high), f"a {name} of a lobe out of bounds")
            numbers.append(number)
            r.note(r.at - 4, f"{name} {number:.9g}")
        self.peak, self.range, self.tail = numbers[:3], numbers[3:5], numbers[-1]
        self.widths, self.angle = (numbers[5:7], numbers[7]) if two else ([numbers[5]] * 2, 0.0)
        require(self.range[0] <= self.range[1], "incidences of a lobe out of order")
        require(not two or self.widths[0] != self.widths[1], "two widths that are one")
        kinds = [axis.kind for axis in h.axes]
        require(h.quantity == 3 and kinds[:1] in (["elevation"], ["triangles"]), "a lobe without incidences of a BRDF")
        require(kinds[1:2] == ["triangles"] and h.axes[1].domain == HEMISPHERE, "a lobe without triangles above")
        require(len(kinds) == 2 or len(kinds) == 3 and kinds[2] in ("wavelength", "rgb"), "a lobe beside other axes")
        require(h.axes[0].count <= 4096, "a lobe beside too many incidences")
        require(not two or kinds[0] == "triangles", "a lobe that turns with the surface beside elevations")
        count = h.axes[2].count if len(kinds) == 3 else 1
        start, self.colours = r.at, np.ones(count)
        if count > 1:
            raw = [r.unsigned(3) << 8 for _ in range(count)]
            self.colours = np.array(raw, np.uint32).view(F).astype(np.float64)
            require(((self.colours >= 0) & (self.colours <= 65536)).all(), "a colour of a lobe out of bounds")
            r.note(start, "colours: " + ", ".join(f"{colour:.6g}" for colour in self.colours))
        require(r.left() == 0, "bytes after the end of chunk A")

    def value(self, wi, wo):
        """The spectrum of the lobe for unit vectors, f64; see section 18."""
        if not (wi[2] > 0 and wo[2] >= 0):
            return 0 * self.colours
        t = min(max(-math.log(wi[2]), self.range[0]), self.range[1])
        masking, d = 1, -math.log(wi[2]) - t
        beyond = 0 if self.centre != 1 else 2 * d if d < 0 else min(2 * d, d + math.log(1.5))
        if self.centre == 1:
            x, y, z = (a + b for a, b in zip(wi, wo))
            a, b = x / z, y / z
            rr = 1.5537739740300373**2 * self.widths[0] * self.widths[1]
            m = lambda c: c + math.sqrt(rr + (1 - rr) * c * c)
            masking = m(wi[2]) / m(wo[2]) * (1 + a * a + b * b) ** 2
        else:
            c = (-wi[0], -wi[1], wi[2]) if self.centre == 0 else wi
            s = 1 / (1 + c[2])
            u, v = (1 - c[0] ** 2 * s, -c[0] * c[1] * s, -c[0]), (-c[0] * c[1] * s, 1 - c[1] ** 2 * s, -c[1])
            scale = math.sqrt(2 / (1 + sum(x * y for x, y in zip(wo, c))))
            a, b = (sum(x * y for x, y in zip(wo, axis)) * scale for axis in (u, v))
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        x = ((a * cos + b * sin) / self.widths[0]) ** 2 + ((b * cos - a * sin) / self.widths[1]) ** 2
        fall = 2**-x if self.tail == 0 else (1 + (2**self.tail - 1) * x) ** (-1 / self.tail)
        peak = math.exp(min(self.peak[0] + t * (self.peak[1] + t * self.peak[2]) + beyond, 40))
        return self.colours * min(peak * fall * masking, 1e25)


# ---------------------------------------------------------------------------------------------------------------------
# Classes, coefficients, exact samples, text

POSITIVE, NEGATIVE, ZERO, MASKED = range(4)


def decode_classes(data, count, lanes):
    coder, model = Decoder(data), Model()
    rows, above, further, repeats = [], [POSITIVE] * lanes, [POSITIVE] * lanes, 0
    for _ in range(count // lanes):
        repeat = model.one(coder, ("repeat", repeats))
        repeats = (repeats << 1 | repeat) & 3
        row = list(above) if repeat else []
        while len(row) < lanes:
            j = len(row)
            left, left2 = (row[j - 1] if j > 0 else 0), (row[j - 2] if j > 1 else 0)
            up, up2, following = above[j], further[j], (above[j + 1] if j + 1 < lanes else 0)
            kind, code = 0, [POSITIVE, NEGATIVE]
            for kind in range(3):
                contexts = [("near", kind, left, up, following), ("far", kind, up, up2, left), ("left", kind, left, left2)]
                bit = model.mixed(coder, contexts, kind)
                if kind < 2 and not bit:
                    row.append(code[kind])
                    break
                if kind == 2:
                    row.append(MASKED if bit else ZERO)
        rows += row
        further, above = above, row
    return np.array(rows, np.uint8)


def decode_grid_classes(data, shape):
    coder, model = Decoder(data), Model()
    classes = np.zeros((shape.incoming, shape.polar, shape.around, shape.length), np.uint8)
    nothing, other_lane, sames = [POSITIVE] * shape.around, None, 0
    for lane in lanes_of(shape.length):
        if other_lane is not None:
            same = model.one(coder, ("lane", sames))
            sames = (sames << 1 | same) & 3
            if same:
                classes[:, :, :, lane] = classes[:, :, :, other_lane]
                other_lane = lane
                continue
        repeats = 0
        for i in range(shape.incoming):
            for p in range(shape.polar):
                back = list(classes[i - 1, p, :, lane]) if i > 0 else nothing
                up = list(classes[i, p - 1, :, lane]) if p > 0 else nothing
                other = nothing if other_lane is None else list(classes[i, p, :, other_lane])
                repeat = model.one(coder, ("repeat", repeats))
                repeats = (repeats << 1 | repeat) & 3
                row = list(back if i > 0 else up) if repeat else []
                at = lambda line, j: line[j] if 0 <= j < len(line) else POSITIVE
                while len(row) < shape.around:
                    j = len(row)
                    left, u, b, o = at(row, j - 1), up[j], back[j], other[j]
                    for kind, code in enumerate([POSITIVE, NEGATIVE, ZERO]):
                        contexts = [("near", kind, left, u, b, o)]
                        contexts += [("ahead", kind, left, at(up, j + 1), at(back, j + 1), at(other, j + 1))]
                        contexts += [("along", kind, left, at(row, j - 2), u, o)]
                        if not model.mixed(coder, contexts, (kind, o)):
                            row.append(code)
                            break
                    else:
                        row.append(MASKED)
                classes[i, p, :, lane] = row
        other_lane = lane
    return classes.reshape(-1)


def decode_wide_classes(data, shape):
    coder, lane_model, row_model, model = Decoder(data), Model(), Model(), Model()
    incoming, polar, around = shape.incoming, shape.polar, shape.around
    nothing = np.zeros((incoming, polar, around), np.uint8)
    planes, sames = [nothing, nothing], 0
    classes = np.zeros((incoming, polar, around, shape.length), np.uint8)
    for number, lane in enumerate(lanes_of(shape.length)):
        if number > 0:
            same = lane_model.one(coder, ("lane", sames))
            sames = (sames << 1 | same) & 3
            if same:
                classes[:, :, :, lane] = planes[-1]
                planes = [planes[-1], planes[-1]]
                continue
        own, repeats = nothing.copy(), 0
        further, other = planes

        def line(plane, i, p):
            return [int(c) for c in plane[i, p]] if 0 <= i and 0 <= p < polar else [POSITIVE] * around

        for i in range(incoming):
            for p in range(polar):
                up, up2, back, back2 = line(own, i, p - 1), line(own, i, p - 2), line(own, i - 1, p), line(own, i - 2, p)
                over, under = line(own, i - 1, p - 1), line(own, i - 1, p + 1)
                o, o2 = line(other, i, p), line(further, i, p)
                o_over, o_under = line(other, i, p - 1), line(other, i, p + 1)
                alike = back if i > 0 else up
                pair = (o == (line(other, i - 1, p) if i > 0 else o_over), o == alike)
                even, steady = all(c == alike[0] for c in alike), back == back2
                share = 4 * sum(c != POSITIVE for c in alike) // around
                contexts = [("first", repeats, pair), ("second", even, steady, up == over, pair), ("third", share, repeats, even, steady)]
                repeat = row_model.mixed(coder, contexts, pair)
                repeats = (repeats << 1 | repeat) & 3
                row = list(alike) if repeat else []
                there = lambda row, *places: tuple(0 <= j < len(row) and row[j] != POSITIVE for j in places)
                count = lambda rows, *places: sum(sum(there(row, *places)) for row in rows)
                while len(row) < around:
                    j = len(row)
                    near = (row[j - 1] if j > 0 else POSITIVE, up[j], back[j], o[j])
                    left = there(row, j - 1)
                    cross = there(row, j - 1, j - 2, j - 3) + there(up, j - 1, j, j + 1) + there(up2, j) + there(back, j - 1, j, j + 1) + there(o, j)
                    behind = there(back, j - 1, j, j + 1) + there(back2, j) + there(over, j) + there(under, j) + left + there(up, j) + there(o, j)
                    aside = there(o, j - 1, j, j + 1) + there(o_under, j) + there(o_over, j) + there(o2, j) + left + there(up, j)
                    counts = (
                        count([up, up2], j - 2, j - 1, j, j + 1, j + 2), count([back, over, under], j - 1, j, j + 1),
                        count([o, o_over, o_under], j - 1, j, j + 1), there(row, j - 1, j - 2),
                    )
                    for kind, code in enumerate([POSITIVE, NEGATIVE, ZERO]):
                        contexts = [("near", kind, near), ("cross", kind, cross), ("behind", kind, behind), ("aside", kind, aside), ("counts", kind, counts)]
                        if not model.mixed(coder, contexts, (kind, o[j])):
                            row.append(code)
                            break
                    else:
                        row.append(MASKED)
                own[i, p] = row
        classes[:, :, :, lane] = own
        planes = [other, own]
    return classes.reshape(-1)


class Rows:
    """Coding order and neighbours: None where there is no such row or lane."""

    def __init__(self, order, level, neighbours, lane_order, lane_level, lane_neighbours):
        self.order, self.level, self.neighbours = order, level, neighbours
        self.lane_order, self.lane_level, self.lane_neighbours = lane_order, lane_level, lane_neighbours


def natural(rows, lanes):
    before = lambda i: [i - 1 if i > 0 else None, i - 2 if i > 1 else None]
    row_neighbours = [before(i) + [None] for i in range(rows)]
    return Rows(range(rows), [0] * rows, row_neighbours, range(lanes), [0] * lanes, [before(j) for j in range(lanes)])


def coefficient_prior(context):
    table = context[0]
    if table == "rows":
        return NONZERO[context[3]]
    if table == "lanes":
        return (NONZERO[context[1]] + NONZERO[context[2]]) // 2
    if table == "each":
        return NONZERO[min(4 + sum(context[1:]), 11)]
    return LARGER[context[2]] if table in ("first", "second") else 32768


def decode_coefficients(data, rows, floats=False):
    coder, model = Decoder(data), Model(coefficient_prior)
    lanes = len(rows.lane_level)
    values = np.zeros((len(rows.level), lanes), np.int64)
    activity = [256] * lanes
    size = lambda v: int(v != 0) if floats else min(abs(int(v)), 1 << 16)
    zeros = [0] * lanes
    for at in rows.order:
        level = min(rows.level[at], 7)
        near = [zeros if n is None else values[n].tolist() for n in rows.neighbours[at]]
        if lanes > 1:
            a, b, c = (min((sum(v != 0 for v in n) + 1) // 2, 2) for n in near)
            contexts = [("row0", a, b, c, level), ("row1", a, b, level), ("row2", c, a, level)]
            if not model.mixed(coder, contexts, ("row", level)):
                continue
        row = [0] * lanes
        for j in rows.lane_order:
            a, b, c = (size(n[j]) for n in near)
            up, before = (0 if n is None else size(row[n]) for n in rows.lane_neighbours[j])
            by_rows, by_lanes = 8 * a + 4 * b + 4 * c, 6 * up + 10 * before
            active = fine(activity[j] >> 4)
            contexts = [
                ("rows", level, min(rows.lane_level[j], 7), fine(by_rows)),
                ("lanes", active, fine(by_lanes)),
                ("each", coarse(a), coarse(b), coarse(c)),
            ]
            if model.mixed(coder, contexts, ("zero", level)):
                if floats:
                    sign, node = coder.even(), 1
                    for _ in range(8):
                        node = node << 1 | model.one(coder, ("exponent", level, node))
                    row[j] = sign << 31 | (node & 255) << 23 | coder.bits(23)
                else:
                    negative = coder.even()
                    row[j] = magnitude(coder, model, fine(max(by_rows, by_lanes)), active, level)
                    row[j] = -row[j] if negative else row[j]
            activity[j] = (activity[j] * 7 + (size(row[j]) << 8)) // 8
        values[at] = row
    return values


def decode_steps(data, count, lanes):
    """Small integers in rows."""
    coder, model = Decoder(data), Model(lambda context: 13107 if context[0] == "zero" else 32768)
    steps = [0] * count
    for at in range(count):
        beside = steps[at - 1] if at % lanes else None
        above = steps[at - lanes] if at >= lanes else None
        state = lambda v: 2 if v is None else int(v != 0)
        if model.one(coder, ("zero", state(beside), state(above))):
            sign = ((beside or 0) > 0) - ((beside or 0) < 0)
            negative = model.one(coder, ("sign", sign))
            size = golomb(coder, model, "size") + 1
            steps[at] = -size if negative else size
    return steps


def decode_exact(data, count, lanes):
    coder, model = Decoder(data), Model()
    samples, above, above_lengths = [], [0] * lanes, [0] * lanes
    top = (1 << 32) - 1
    for row in range(count // lanes):
        left = above_left = left_length = 0
        for j in range(lanes):
            up = above[j]
            guess = left if row == 0 else up if j == 0 else left + up - above_left
            guess = min(max(guess, 0), top)
            far = coarse(abs(above_lengths[j] - left_length))
            length = 0
            while length < 33:
                contexts = [("both", length, left_length, far), ("left", length, left_length), ("up", length, above_lengths[j])]
                if not model.mixed(coder, contexts, 0):
                    break
                length += 1
            residual = 0
            if length:
                negative, residual = coder.even(), 1
                for k in range(length - 1):
                    residual = residual << 1 | (model.one(coder, ("top", length)) if k == 0 else coder.even())
                residual = -residual if negative else residual
            value = min(max(guess + residual, 0), top)
            samples.append(value & 0x7FFFFFFF if value >> 31 else ~value & MASK)
            above_left, left, left_length = up, value, length
            above[j], above_lengths[j] = value, length
    return np.array(samples, np.uint32).view(F)


TYPICAL = (
    '{"generator":"wavelume 0.1.0","labels":{"0":["1","2","3"]},"request":{"basis":"auto","metadata":true,"policy":"r'
    'd","target":{"max_relative_error":0.05}},"source":{"content_digest":"b3-6e340b9cffb37a989ca544e6bb780a2c78901d3f'
    'b33738768511a30617afa01d","dialect":"LM-63-2002, type C, no symmetry","format":"spectral-table","metadata":{"nam'
    'e":"","description":"","manufacturer":"","date":"","notes":""},"notes":["the header names no quantity, taken as '
    'spectrum in relative values","no unit stated, taken as 1/sr"],"spectrum_digest":"b3-4bf5122f344554c53bde2ebb8cd2'
    'b7e3d1600ad631c385a5d7cce23c7785459a"}}{"generator":"wavelume 0.1.0","request":{"basis":"auto","metadata":true,"'
    'policy":"rd","target":{"er_l2":0.01}},"source":{"content_digest":"b3-dbc1b4c900ffe48d575b5da5c638040125f65db0fe3'
    'e24494b76ea986457d986","dialect":"","format":"npy","metadata":{},"notes":[],"spectrum_digest":null}}'
)


# Provenance of measurements on grids of angles; byte 1 stands for a digest.
TYPICAL_PROVENANCE = (
    '{"generator":"wavelume 0.1.0","request":{"basis":"auto","metadata":true,"policy":"rd","target":{"er_'
    'l2":0.01}},"source":{"content_digest":"\x01","dialect":"reflection scalar 2 x 3, transmission rgb 4 x 4'
    '","format":"mbsdf","metadata":[["theta","90"],["phi","91"]],"notes":[],"spectrum_digest":null}}{"gen'
    'erator":"wavelume 0.1.0","request":{"albedo_error":0.01,"basis":"auto","domain":"triangles","floor":'
    '0.001,"metadata":true,"outgoing_level":5,"policy":"rd","random_access":true,"target":"lossless"},"so'
    'urce":{"content_digest":"\x01","dialect":"long, isotropic, wide","format":"radiometric-csv","metadata":'
    '[["instrument",""],["operator",""],["date","2026-01-01"],["sample",""],["description",""],["licence"'
    ',"CC0-1.0"]],"notes":[{"kind":"assumed","message":"no unit stated, taken as 1/sr"},{"kind":"assumed"'
    ',"message":"the header names no quantity, taken as spectrum in relative values"}],"spectrum_digest":'
    '"\x01"}}{"generator":"wavelume 0.1.0","request":{"basis":"auto","metadata":true,"policy":"rd","target":'
    '{"er_l2":0.01}},"source":{"content_digest":"\x01","dialect":"EULUMDAT, symmetric about C0-C180","format'
    '":"eulumdat","metadata":[["company","GmbH"],["luminaire_type","1"],["symmetry","1"],["c_planes","1"]'
    ',["c_step","0"],["gamma_angles","37"],["gamma_step","2.5"],["report",""],["luminaire","LED"],["lumin'
    'aire_number","000"],["file_name",".ldt"],["date",""],["luminaire_length_mm","600"],["luminaire_width'
    '_mm","0"],["luminaire_height_mm","0"],["luminous_length_mm","0"],["luminous_width_mm","0"],["luminou'
    's_height_c0_mm","0"],["luminous_height_c90_mm","0"],["luminous_height_c180_mm","0"],["luminous_heigh'
    't_c270_mm","0"],["downward_flux_percent","100"],["light_output_ratio_percent","100"],["conversion_fa'
    'ctor","1"],["tilt_degrees","0"],["lamps","1"],["lamp","LED"],["lumens","1000"],["colour","3000K"],["'
    'colour_rendering","80"],["watts","10"],["direct_ratio_k0.6","0.5"],["direct_ratio_k0.8","0.6"],["dir'
    'ect_ratio_k1","0.7"],["direct_ratio_k1.25","0.75"],["direct_ratio_k1.5","0.8"],["direct_ratio_k2","0'
    '.85"],["direct_ratio_k2.5","0.9"],["direct_ratio_k3","0.92"],["direct_ratio_k4","0.95"],["direct_rat'
    'io_k5","0.97"],["flux_of_the_intensities_lm","100"]],"notes":[{"kind":"warning","message":"the inten'
    'sities make 100 lm, 90 % of the 1000 lm stated; kept as they are"},{"kind":"skipped","message":"lamp'
    ' sets after the first are kept as keywords"}],"spectrum_digest":null}}{"generator":"wavelume 0.1.0",'
    '"request":{"basis":"auto","metadata":true,"policy":"rd","target":{"er_l2":0.01}},"source":{"content_'
    'digest":"\x01","dialect":"LM-63-2002, type C, quadrants","format":"lm-63","metadata":[["TEST",""],["TES'
    'TLAB",""],["ISSUEDATE","January 1, 2020"],["TESTDATE",""],["NEARFIELD",""],["MANUFAC",""],["LUMCAT",'
    '""],["LUMINAIRE",""],["LAMPCAT",""],["LAMP","LED"],["BALLASTCAT",""],["BALLAST",""],["DISTRIBUTION",'
    '""],["FLASHAREA",""],["COLORCONSTANT",""],["LAMPPOSITION","0,0"],["OTHER",""],["SEARCH",""],["MORE",'
    '""],["FILEGENINFO",""],["_ABSOLUTE",""],["tilt","NONE"],["lamps","1"],["lumens_per_lamp","-1"],["can'
    'dela_multiplier","1"],["photometric_type","C"],["luminous_opening","rectangle"],["luminous_width","0'
    '.1 m"],["luminous_length","0.1 m"],["luminous_height","0 m"],["luminous_diameter","0 m"],["ballast_f'
    'actor","1"],["ballast_lamp_factor","1"],["field_12","1"],["input_watts","10"]],"notes":[{"kind":"war'
    'ning","message":"near-field photometry: intensities hold at the distances of [NEARFIELD] only"},{"ki'
    'nd":"warning","message":"relative photometry: the intensities are for the stated 1000 lumens"}],"spe'
    'ctrum_digest":null}}'
)


class Known:
    """Says the bits of a known text instead of reading them."""

    def __init__(self, data):
        self.bits_left = [byte >> shift & 1 for byte in reversed(data) for shift in range(8)]

    def bit(self, _):
        return self.bits_left.pop()


def decode_text(r, typical=TYPICAL):
    length = r.varint(MAX_METADATA)
    least = length // 1024
    require(r.left() >= least, "much text in few bytes")
    model, before, out = Model(), 0, bytearray()
    typical = typical.encode()
    coder = Known(typical)
    for i in range(len(typical) + length):
        if i == len(typical):
            coder = Decoder(r.take(r.left()))
        node = 1
        for shift in range(7, -1, -1):
            contexts = []
            for k, order in enumerate((before & 0xFF, before & 0xFFFF, before)):
                mixed = (((order + k) * 0x9E3779B1 & MASK) ^ (node * 0x85EBCA77 & MASK)) * 0xC2B2AE3D & MASK
                contexts.append((k, mixed >> 16))
            node = node << 1 | model.mixed(coder, contexts, shift)
        before = (before << 8 | node & 0xFF) & MASK
        if i >= len(typical):
            out.append(node & 0xFF)
    unused = coder.data[coder.at :] if length else r.take(r.left())
    require(not unused or len(coder.data) == least and not any(unused), "bytes after the metadata")
    return out.decode()


def decode_provenance(r):
    digests = [r.take(32).hex() for _ in range(r.varint(64))]
    parts = decode_text(r, TYPICAL_PROVENANCE).split("\x01")
    require(len(parts) == len(digests) + 1, "digests and their places differ in number")
    return parts[0] + "".join("b3-" + digest + part for digest, part in zip(digests, parts[1:]))


# ---------------------------------------------------------------------------------------------------------------------
# Geometry: unit vectors in f64, and the integer lattice


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def plus(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def times(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def norm(a):
    return math.sqrt(dot(a, a))


def unit(a):
    return times(a, 1.0 / norm(a))


OCTANTS = [((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (-1, 0, 0)), ((-1, 0, 0), (0, -1, 0)), ((0, -1, 0), (1, 0, 0))]


def all_triangles(domain, level, size, middle):
    """The vertices of every triangle in index order."""
    result = []
    for base in range(8 if domain == SPHERE else 4):
        down = domain == LOWER or base >= 4
        a, b = OCTANTS[base % 4]
        here = [(times((0, 0, -1 if down else 1), size), times(a, size), times(b, size))]
        for _ in range(level):
            finer = []
            for v0, v1, v2 in here:
                m01, m12, m02 = middle(v0, v1), middle(v1, v2), middle(v0, v2)
                finer += [(v0, m01, m02), (m01, v1, m12), (m02, m12, v2), (m12, m02, m01)]
            here = finer
        result += here
    return result


def on_sphere(domain, level):
    return all_triangles(domain, level, 1.0, lambda a, b: unit(plus(a, b)))


def on_lattice(domain, level):
    middle = lambda a, b: tuple((x + y) // 2 for x, y in zip(a, b))
    return all_triangles(domain, level, 1 << level, middle)


def centroids(domain, level):
    return [unit(plus(plus(a, b), c)) for a, b, c in on_sphere(domain, level)]


def solid_angle(vertices):
    a, b, c = vertices
    return 2.0 * math.atan2(abs(dot(a, cross(b, c))), 1.0 + dot(a, b) + dot(b, c) + dot(c, a))


def neighbours_of(domain, level):
    mesh, around = on_lattice(domain, level), {}
    for i, triangle in enumerate(mesh):
        for vertex in triangle:
            around.setdefault(vertex, set()).add(i)
    return [sorted(set().union(*(around[v] for v in t)) - {i}) for i, t in enumerate(mesh)]


def symmetries(domain):
    exchanges = [(0, 1, 2), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    both = [(e, (bool(s & 1), bool(s & 2), bool(s & 4))) for e in exchanges for s in range(8)]
    keeps_z = lambda s: s[0][2] == 2 and not s[1][2]
    return [s for s in both if keeps_z(s)] + [s for s in both if domain == SPHERE and not keeps_z(s)]


def moved(symmetry, point):
    return tuple(-point[k] if negated else point[k] for k, negated in zip(*symmetry))


def product(second, first):
    """First `first`, then `second`."""
    exchange = tuple(first[0][k] for k in second[0])
    return exchange, tuple(n != first[1][k] for k, n in zip(second[0], second[1]))


def permutation(symmetry, domain, level):
    require(symmetry in symmetries(domain), "a symmetry of another domain")
    sums = [plus(plus(a, b), c) for a, b, c in on_lattice(domain, level)]
    place = {s: i for i, s in enumerate(sums)}
    return [place[moved(symmetry, s)] for s in sums]


# ---------------------------------------------------------------------------------------------------------------------
# Transforms, their trees and norms

LIFTINGS = {
    "5/3": ([(1, -0.5), (0, 0.25)], 1.4142135),
    "9/7": ([(1, -1.5861343), (0, -0.05298012), (1, 0.8829111), (0, 0.44350685)], 1.1496044),
}
A97 = [0.03782845550726404, -0.023849465019556843, -0.11062440441843718, 0.37740285561283066]
S97 = [-0.06453888262869706, -0.04068941760916406, 0.41809227322161724]
BANKS = {
    "5/3": (
        [-0.1767766952966369, 0.3535533905932738, 1.0606601717798212, 0.3535533905932738, -0.1767766952966369],
        [0.3535533905932738, 0.7071067811865476, 0.3535533905932738],
    ),
    "9/7": (A97 + [0.8526986790088938] + A97[::-1], S97 + [0.7884856164055829] + S97[::-1]),
}
HAAR_NUMBERS, NUMBERS_5_3, NUMBERS_9_7 = (0, 1, 75, 90), (78, 109), (87, 106, 113, 114)
BIOR44 = (87, 2)


def line_kind(transform):
    number, rule = transform
    if number in HAAR_NUMBERS and rule == 4:
        return "haar"
    if rule == 2 and number in NUMBERS_5_3 + NUMBERS_9_7:
        return "5/3" if number in NUMBERS_5_3 else "9/7"
    raise Refused(f"basis {number} under boundary rule {rule}: this reader knows Haar, 5/3 and 9/7 only")


def depth_of(n):
    return (n - 1).bit_length()


class Tree:
    def __init__(self, axis, transform):
        n = axis.count
        self.level, self.parent = [0] * n, [None] * n
        for i in range(n):
            if transform == "identity":
                continue
            if axis.kind == "triangles":
                within = i % (1 << 2 * axis.level)
                if within == 0:
                    continue
                height = ((within & -within).bit_length() - 1) // 2
                place = 1 << 2 * height
                self.level[i] = axis.level - height
                k = within // place % 4
                self.parent[i] = i - within if self.level[i] == 1 else i // (16 * place) * (16 * place) + 4 * k * place
            else:
                depth = depth_of(n)
                height = depth if i == 0 else min((i & -i).bit_length() - 1, depth)
                if height == depth:
                    continue
                self.level[i] = depth - height
                if self.level[i] == 1:
                    self.parent[i] = i - (1 << height)
                else:
                    stride = 2 << height
                    details = -(-n // stride) // 2
                    self.parent[i] = (2 * min((i >> height + 1) // 2, details - 1) + 1) * stride
        self.order = sorted(range(n), key=lambda i: (self.level[i], i))
        self.before = [None] * n
        for a, b in zip(self.order, self.order[1:]):
            if self.level[a] == self.level[b]:
                self.before[b] = a


def coding_order(axes, transforms, classes):
    """`classes`: by sample, or None where all are live."""
    if not axes:
        return natural(1, 1)
    trees = []
    for i, (axis, transform) in enumerate(zip(axes, transforms)):
        tree = Tree(axis, transform)
        if classes is not None and transform in FIXED[1:]:
            live = np.isin(classes, (POSITIVE, NEGATIVE)).reshape([a.count for a in axes])
            live = live.any(axis=tuple(k for k in range(len(axes)) if k != i))
            coded = np.ones(axis.count, bool)
            stride = 1
            for _ in range(axis.level):
                for node, children in enumerate(live.reshape(-1, 4)):
                    if children.sum() < 2:
                        coded[(4 * node + np.arange(1, 4)) * stride] = False
                live, stride = live.reshape(-1, 4).any(axis=1), 4 * stride
            tree.order = [i for i in tree.order if coded[i]]
        trees.append(tree)
    order, level, neighbours = [0], [0], [[None] * 3]
    for tree in trees[:-1]:
        n = len(tree.level)
        order = [o * n + i for o in order for i in tree.order]
        next_level, next_neighbours = [], []
        for o, (outer, (before, parent, _)) in enumerate(zip(level, neighbours)):
            earlier = before if parent is None else parent
            for i in range(n):
                next_level.append(tree.level[i] + (outer > 0))
                same = [None if k is None else o * n + k for k in (tree.before[i], tree.parent[i])]
                next_neighbours.append(same + [None if earlier is None else earlier * n + i])
        level, neighbours = next_level, next_neighbours
    last = trees[-1]
    return Rows(order, level, neighbours, last.order, last.level, [list(p) for p in zip(last.parent, last.before)])


def octant_areas(level):
    areas = [[solid_angle(t) for t in on_sphere(HEMISPHERE, level)[: 1 << 2 * level]]]
    for _ in range(level):
        a = areas[0]
        areas.insert(0, [((a[i] + a[i + 1]) + a[i + 2]) + a[i + 3] for i in range(0, len(a), 4)])
    return areas


def reflection(u):
    v = [u[0] - 1.0, u[1], u[2], u[3]]
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]
    return [[(1.0 if r == c else 0.0) - 2.0 * v[r] * v[c] / square for c in range(4)] for r in range(4)]


def inverse_sphere(x, level, basis):
    """`x[:, n, :]`, in place."""
    areas = octant_areas(level) if basis != "orthonormal-count" else None
    if level == 0 and basis == "orthonormal-area":
        x *= F(1) / F(math.sqrt(areas[0][0]))
    for l in range(level):
        place = 1 << 2 * (level - l)
        for node in range(x.shape[1] // place):
            a, b, c, d = (x[:, node * place + k * place // 4] for k in range(4))
            if basis == "orthonormal-count":
                t = F(0.5) * ((b + c) + (d - a))
                a += t
                b -= t
                c -= t
                d -= t
                continue
            children = areas[l + 1]
            first = 4 * node % len(children)
            w = children[first : first + 4]
            if basis == "bio-haar":
                w1, w2, w3 = (F(w[k] / w[0]) for k in (1, 2, 3))
                mean = a.copy()
                a[...] = mean - (w1 * b + (w2 * c + w3 * d))
                b += mean
                c += mean
                d += mean
            else:
                total = ((w[0] + w[1]) + w[2]) + w[3]
                h = reflection([math.sqrt(v / total) for v in w])
                g = [math.sqrt(v) if l + 1 == level else 1.0 for v in w]
                m = [[F(h[r][k] / g[r]) for k in range(4)] for r in range(4)]
                new = [((m[r][0] * a + m[r][1] * b) + m[r][2] * c) + m[r][3] * d for r in range(4)]
                a[...], b[...], c[...], d[...] = new


def inverse_line(x, transform):
    """`x[:, n, :]`, in place."""
    n, kind = x.shape[1], line_kind(transform)
    for k in range(depth_of(n) - 1, -1, -1):
        stride = 1 << k
        if kind == "haar":
            for left in range(0, n - stride, 2 * stride):
                right = min(stride, n - left - stride)
                alpha = F(math.sqrt(stride / (stride + right)))
                beta = F(math.sqrt(right / (stride + right)))
                p, q = x[:, left].copy(), x[:, left + stride].copy()
                x[:, left] = alpha * p + beta * q
                x[:, left + stride] = beta * p - alpha * q
            continue
        steps, low = LIFTINGS[kind]
        low = F(low)
        high = F(-1) / low
        x[:, :: 2 * stride] *= F(1) / low
        x[:, stride :: 2 * stride] *= F(1) / high
        for parity, c in reversed(steps):
            c = -F(c)
            for i in range(parity * stride, n, 2 * stride):
                if i >= stride and i + stride < n:
                    x[:, i] += c * (x[:, i - stride] + x[:, i + stride])
                elif i >= stride:
                    x[:, i] += F(2) * c * x[:, i - stride]
                elif i + stride < n:
                    x[:, i] += F(2) * c * x[:, i + stride]


def inverse(x, axes, transforms):
    """Coefficients to samples, the last axis first."""
    x = np.ascontiguousarray(x, F).reshape(-1)
    inner = 1
    for axis, transform in reversed(list(zip(axes, transforms))):
        view = x.reshape(-1, axis.count, inner)
        if transform in FIXED[1:]:
            inverse_sphere(view, axis.level, transform)
        elif transform != "identity":
            inverse_line(view, transform)
        inner *= axis.count
    return x


def folded(i, n):
    if n == 1:
        return 0
    i %= 2 * n - 2
    return i if i < n else 2 * n - 2 - i


def line_norms(n, transform):
    kind = line_kind(transform)
    if kind == "haar":
        return [1.0] * n
    analysis, synthesis = BANKS[kind]
    reach = len(analysis) // 2
    low = {k - len(synthesis) // 2: w for k, w in enumerate(synthesis)}
    # The synthesis high pass: (−1)^k · analysis low pass at 1 − k.
    high = {1 - (k - reach): (w if (1 - (k - reach)) % 2 == 0 else -w) for k, w in enumerate(analysis)}
    matrices = []
    while n > 1:
        matrix = np.zeros((n, n))
        for i in range(n):
            for parity, taps in enumerate((low, high)):
                for o in range((i - max(taps)) // 2, (i - min(taps)) // 2 + 1):
                    matrix[i, folded(2 * o + parity, n)] += taps.get(i - 2 * o, 0.0)
        matrices.append(matrix)
        n = (n + 1) // 2
    norms, depth = [], len(matrices)
    count = matrices[0].shape[0] if matrices else 1
    for index in range(count):
        height = depth if index == 0 else min((index & -index).bit_length() - 1, depth)
        function = np.zeros(-(-count // (1 << height)))
        function[index >> height] = 1.0
        if height < depth:
            function = matrices[height][:, index >> height].copy()
        for matrix in reversed(matrices[:height]):
            finer = np.zeros(matrix.shape[0])
            for o, x in enumerate(function):
                if x != 0.0:
                    finer += x * matrix[:, 2 * o]
            function = finer
        square = 0.0
        for x in function:
            square += float(x) * float(x)
        norms.append(math.sqrt(square))
    return norms


def norms_of(axis, transform):
    if transform == "identity":
        return [1.0] * axis.count
    if axis.kind != "triangles":
        return line_norms(axis.count, transform)
    if transform == "orthonormal-count":
        return [1.0] * axis.count
    areas, finest = octant_areas(axis.level), axis.level
    leaves = lambda level: float(1 << 2 * (finest - level))
    height = lambda area: 1.0 if transform == "bio-haar" else 1.0 / math.sqrt(area)
    norms = [0.0] * (1 << 2 * finest)
    norms[0] = height(areas[0][0]) * math.sqrt(leaves(0))
    for level in range(1, finest + 1):
        for parent in range(len(areas[level]) // 4):
            w = areas[level][4 * parent : 4 * parent + 4]
            total = ((w[0] + w[1]) + w[2]) + w[3]
            h = reflection([math.sqrt(v / total) for v in w])
            if transform == "bio-haar":
                h = [[-w[c] / w[0] if r == 0 else float(r == c) for c in range(4)] for r in range(4)]
            for k in range(1, 4):
                square = 0.0
                for j in range(4):
                    value = h[j][k] * height(w[j])
                    square += value * value * leaves(level)
                norms[(4 * parent + k) * int(leaves(level))] = math.sqrt(square)
    return norms * (axis.count >> 2 * finest)


OFFSET = F(0.03)


def dequantise(q, step, axes, transforms):
    """Integers `[rows, lanes]` to coefficients."""
    rows = [1.0]
    for axis, transform in list(zip(axes, transforms))[:-1]:
        rows = [row * own for row in rows for own in norms_of(axis, transform)]
    lanes = norms_of(axes[-1], transforms[-1]) if axes else [1.0]
    scale = np.array([F(1.0 / n) for n in rows], F)[:, None] * np.array([F(1.0 / n) for n in lanes], F)[None, :]
    q = q.reshape(len(rows), len(lanes))
    return (q.astype(F) - np.sign(q).astype(F) * OFFSET) * step * scale


# ---------------------------------------------------------------------------------------------------------------------
# The data's own spectral basis


class Basis:
    def __init__(self, r, axes, rows, step, gridded=False):
        start, first = r.at, r.unsigned(1)
        rank, coarseness = (first, r.unsigned(1)) if gridded else (first & 31, first >> 5)
        axis = axes[-1]
        require(1 <= rank <= min(64 if gridded else 24, axis.count) and coarseness < 8, "too many or no basis vectors")
        r.note(start, f"{rank} vectors, coarseness {coarseness}")
        start, codes = r.at, r.take(rank)
        spreads = [float(8 + k % 8) * float(1 << k // 8) / float(1 << 23) for k in codes]
        r.note(start, "root mean squares of their coefficients: " + ", ".join(f"{s:.4g}" for s in spreads))
        own = float(step) * min(1.5 * float(1 << coarseness) / math.sqrt(float(rows)), 1.0)
        steps = [F(own)] + [F(own / s) for s in spreads]
        transform = "identity" if axis.kind == "triangles" else BIOR44
        order = natural(rank + 1, axis.count)
        if transform != "identity":
            lanes = coding_order([axis], [transform], None)
            order.lane_order, order.lane_level = lanes.lane_order, lanes.lane_level
            order.lane_neighbours = lanes.lane_neighbours
        q = decode_coefficients(r.take(r.left(), "range-coded: the mean spectrum and the vectors"), order)
        decoded = [inverse(dequantise(row, s, [axis], [transform]), [axis], [transform]) for row, s in zip(q, steps)]
        decoded = [[float(x) for x in row] for row in decoded]
        self.mean, self.vectors = np.array(decoded[0]), []
        for vector in decoded[1:]:
            for other in self.vectors:
                along = 0.0
                for a, b in zip(vector, other):
                    along += a * b
                vector = [a - along * b for a, b in zip(vector, other)]
            square = 0.0
            for x in vector:
                square += x * x
            size = math.sqrt(square)
            scale = 1.0 / size if size > 1e-6 else 0.0
            self.vectors.append([x * scale for x in vector])
        self.rank = rank

    def synthesise(self, coefficients):
        """`[rows, rank]` f32 to `[rows, length]` f32, summed in f64."""
        sums = np.repeat(self.mean[None, :], len(coefficients), axis=0)
        for k, vector in enumerate(self.vectors):
            sums = sums + coefficients[:, k].astype(np.float64)[:, None] * np.array(vector)[None, :]
        return sums.astype(F)


# ---------------------------------------------------------------------------------------------------------------------
# The pyramid: symmetries, model, predictions, details


class Details:
    """The models of a pyramid, or of the coefficients of a model."""

    def __init__(self):
        self.model = Model(self.prior)

    @staticmethod
    def prior(context):
        table = context[0]
        if table in ("near", "before"):
            return NONZERO[context[2]]
        if table == "both":
            return (NONZERO[context[1]] + NONZERO[context[2]]) // 2
        return LARGER[context[2]] if table in ("first", "second") else 32768

    def root(self, coder, first):
        size = golomb(coder, self.model, ("root", first))
        return -size if size and coder.even() else size

    def detail(self, coder, level, parent=None, neighbours=None, siblings=None, before=None):
        level = min(level, 7)
        known = [(parent, 2), (neighbours, 3), (siblings, 2), (before, 2)]
        weight = sum(trust for size, trust in known if size is not None)
        total = sum(trust * min(size, 1 << 20) for size, trust in known if size is not None)
        near = fine(total // weight if weight else 16)
        by = fine(next((size for size in (before, neighbours, parent) if size is not None), 16))
        contexts = [("near", level, near), ("both", by, near), ("before", level, by)]
        if not self.model.mixed(coder, contexts, ("zero", level)):
            return 0
        negative = coder.even()
        size = magnitude(coder, self.model, near, by, level)
        return -size if negative else size


class Shape:
    """Blocks of all other axes, leaves of the last triangle axis, rows of the last axis."""

    def __init__(self, axes):
        at = max(i for i, axis in enumerate(axes) if axis.kind == "triangles")
        last = len(axes) - 1
        between = axes[at + 1 : last]
        self.mesh = axes[at]
        self.block_axes = axes[:at] + between
        self.inner = math.prod(axis.count for axis in between)
        self.length = axes[last].count if at < last else 1
        self.blocks = math.prod(axis.count for axis in self.block_axes)
        self.rows = self.blocks * self.mesh.count

    def row(self, block, leaf):
        return (block // self.inner * self.mesh.count + leaf) * self.inner + block % self.inner


class Plan:
    """Meaning of the first number of a pyramid: the model, and the group of symmetries."""

    def __init__(self, r, shape):
        known = symmetries(shape.mesh.domain)
        start, first = r.at, r.varint()
        self.kind, self.alone, self.random, number = first & 3, first >> 2 & 1, first >> 3 & 1, first >> 4
        generators = []
        while number:
            digit = number % (len(known) + 1)
            require(digit > 0, "symmetries with a digit 0")
            generators.append(known[digit - 1])
            number //= len(known) + 1
        identity = known[0]
        group, at = [identity], 0
        while at < len(group):
            for generator in generators:
                image = product(generator, group[at])
                if image not in group:
                    group.append(image)
            at += 1
        group.sort()
        models = ["no model", "isotropic model", "anisotropic model", "zonal model"]
        text = f"{models[self.kind]}, {['details', 'no details'][self.alone]}, {len(group)} symmetries"
        r.note(start, text + ", a stream for every block" * self.random)
        self.leaves = [permutation(s, shape.mesh.domain, shape.mesh.level) for s in group]
        self.moves = []
        for s in group:
            moves = [0]
            for axis in shape.block_axes:
                n = axis.count
                own = permutation(s, axis.domain, axis.level) if axis.kind == "triangles" else range(n)
                moves = [outer * n + i for outer in moves for i in own]
            self.moves.append(moves)
        self.representatives = [b for b in range(shape.blocks) if all(m[b] >= b for m in self.moves)]
        self.stabilisers = [[k for k, m in enumerate(self.moves) if m[b] == b] for b in self.representatives]
        self.orbit = [0] * shape.blocks
        for i, b in enumerate(self.representatives):
            for m in self.moves:
                self.orbit[m[b]] = i


def live_leaves(shape, plan, classes):
    """Returns flags by representative and leaf, or None where all are live."""
    if classes is None:
        return None
    rows = np.isin(classes, (POSITIVE, NEGATIVE)).reshape(-1, shape.length).any(axis=1)
    if rows.all():
        return None
    live = np.zeros((len(plan.representatives), shape.mesh.count), bool)
    for i, b in enumerate(plan.representatives):
        for moves, leaves in zip(plan.moves, plan.leaves):
            live[i] |= np.array([rows[shape.row(moves[b], leaf)] for leaf in leaves])
    return live


def mean_moments(four):
    mean = [0.0] * 9
    for moments in four:
        mean = [m + 0.25 * x for m, x in zip(mean, moments)]
    return mean


def terms_of(moments, a, b):
    first, (xx, xy, xz, yy, yz, zz) = moments[:3], moments[3:]

    def pair(p, q):
        row = (
            xx * q[0] + xy * q[1] + xz * q[2],
            xy * q[0] + yy * q[1] + yz * q[2],
            xz * q[0] + yz * q[1] + zz * q[2],
        )
        return dot(p, row)

    return [dot(first, a), dot(first, b), pair(a, a), pair(a, b), pair(b, b)]


def prediction_weights(i, around, nodes, children):
    """Returns the weight of each neighbour, f32, for corner children 0, 1, 2."""
    none = [[F(0)] * len(around)] * 3
    n = 5 if len(around) >= 7 else 2 if len(around) >= 3 else 0
    if n == 0:
        return none
    normal = unit(nodes[i][:3])
    a = unit(cross(normal, (1.0, 0.0, 0.0) if abs(normal[0]) < 0.9 else (0.0, 1.0, 0.0)))
    b = cross(normal, a)
    distances = [norm(minus(unit(nodes[j][:3]), normal)) for j in around]
    least = min(distances)
    a, b = times(a, 1.0 / least), times(b, 1.0 / least)
    centre = terms_of(nodes[i], a, b)
    relative = lambda moments: [x - c for x, c in zip(terms_of(moments, a, b), centre)]
    rows = [relative(nodes[j]) for j in around]
    trusts = []
    for d in distances:
        falling = least / (0.15 * least + d)
        trusts.append(falling * falling * falling * falling)
    matrix = [[0.0] * n for _ in range(n)]
    total = 0.0
    for row, trust in zip(rows, trusts):
        for p in range(n):
            for q in range(n):
                matrix[p][q] += trust * row[p] * row[q]
        total += trust
    for p in range(n):
        matrix[p][p] += 1e-4 * total
    factor = [[0.0] * n for _ in range(n)]
    for p in range(n):
        for q in range(p + 1):
            along = 0.0
            for k in range(q):
                along += factor[p][k] * factor[q][k]
            rest = matrix[p][q] - along
            if p == q:
                if rest <= 0.0:
                    return none
                factor[p][p] = math.sqrt(rest)
            else:
                factor[p][q] = rest / factor[q][q]
    result = []
    for corner in range(3):
        x = relative(children[4 * i + corner])[:n]
        for p in range(n):
            along = 0.0
            for k in range(p):
                along += factor[p][k] * x[k]
            x[p] = (x[p] - along) / factor[p][p]
        for p in reversed(range(n)):
            along = 0.0
            for k in range(p + 1, n):
                along += factor[k][p] * x[k]
            x[p] = (x[p] - along) / factor[p][p]
        weights = []
        for row, trust in zip(rows, trusts):
            along = 0.0
            for p in range(n):
                along += x[p] * row[p]
            weights.append(F(trust * along))
        result.append(weights)
    return result


def predictions(mesh):
    """Returns for each level, coarse first, the neighbours of each node and their weights."""
    products = lambda p: [*p, p[0] * p[0], p[0] * p[1], p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2]]
    children = [products(p) for p in centroids(mesh.domain, mesh.level)]
    levels = []
    for level in reversed(range(mesh.level)):
        nodes = [mean_moments(children[i : i + 4]) for i in range(0, len(children), 4)]
        around = neighbours_of(mesh.domain, level)
        levels.insert(0, (around, [prediction_weights(i, around[i], nodes, children) for i in range(len(nodes))]))
        children = nodes
    return levels


def level_folds(mesh, moves):
    """Returns for each level, coarse first, the representative of each node, and its children's numbers there."""
    folds, children = [], moves
    for level in reversed(range(mesh.level)):
        nodes = [[c // 4 for c in move[::4]] for move in children]
        count = len(nodes[0])
        source, same = list(range(count)), [[0, 1, 2, 3] for _ in range(count)]
        for t in range(count):
            for node, child in zip(nodes, children):
                to, images = node[t], [c % 4 for c in child[4 * t : 4 * t + 4]]
                if to < source[t]:
                    source[t], same[t] = to, images
                elif to == t and source[t] == t:
                    same[t] = [min(x, y) for x, y in zip(same[t], images)]
        folds.insert(0, (source, same))
        children = nodes
    return folds


def householder(details):
    """The deviations of siblings, one more than details, from their mean."""
    n = len(details) + 1
    exact = 1.0 / math.sqrt(float(n))
    alpha, beta, scale = F(exact), F(exact - 1.0), F(1.0 / (1.0 - exact))
    along = F(0)
    for d in details:
        along = along + d
    along = along * alpha * scale
    return [d - along * alpha for d in details] + [-along * beta]


def decode_pyramid(coder, shape, plan, live, step, vectors, finest, coded):
    """`[coded, vectors, leaves]` of the representatives `coded`, without details below level `finest`."""
    mesh, size = shape.mesh, lambda q: min(abs(q), 1 << 16)
    planes = len(coded) * vectors
    folds = {}
    for stabiliser in plan.stabilisers:
        if tuple(stabiliser) not in folds:
            folds[tuple(stabiliser)] = level_folds(mesh, [plan.leaves[k] for k in stabiliser])
    folds = [folds[tuple(plan.stabilisers[k])] for k in coded]
    lives = []
    if live is not None:
        here = live[coded]
        for _ in range(mesh.level):
            lives.insert(0, here.reshape(len(here), -1, 4))
            here = lives[0].any(axis=2)
    bases = mesh.count >> 2 * mesh.level
    details = Details()
    root_step = step / F(1 << mesh.level)
    decoded = []
    for plane in range(planes):
        source = folds[plane // vectors][0][0] if mesh.level else range(bases)
        means, last = [], 0
        for root in range(bases):
            if source[root] < root:
                means.append(means[source[root]])
                continue
            last += details.root(coder, root == 0)
            means.append(F(last) * root_step)
        decoded.append(means)
    above = None
    levels = predictions(mesh)
    for level in range(mesh.level):
        around, weights = levels[level]
        own_step = step / F(1 << mesh.level - level - 1)
        quantised, finer = [], []
        for plane in range(planes):
            source, same = folds[plane // vectors][level]
            means, q, children = decoded[plane], [[0, 0, 0] for _ in around], []
            before = plane - 1 if plane % vectors else plane - vectors
            before = quantised[before] if before >= 0 else None
            for t in range(len(around)):
                if source[t] < t:
                    children += [children[4 * source[t] + k] for k in same[t]]
                    for c in range(3):
                        if same[t][c] < 3:
                            q[t][c] = q[source[t]][same[t][c]]
                    continue
                alive = lives[level][plane // vectors][t] if lives else [True] * 4
                siblings = int(sum(alive))
                if siblings < 2:
                    children += [means[t]] * 4
                    continue
                differences = [means[n] - means[t] for n in around[t]]
                corners = []
                for corner in range(3):
                    x = F(0)
                    for w, d in zip(weights[t][corner], differences):
                        x = x + w * d
                    corners.append(x)
                predicted = corners + [-(corners[0] + corners[1] + corners[2])]
                order = [c for c in range(4) if alive[c]] + [c for c in range(4) if not alive[c]]
                if siblings < 4:
                    shift = F(0)
                    for c in order[:siblings]:
                        shift = shift + predicted[c]
                    shift = shift / F(siblings)
                    predicted = [x - shift for x in predicted]
                known = [n for n in around[t] if n < t]
                neighbours = 16 * sum(size(x) for n in known for x in q[n]) // (3 * len(known)) if known else None
                parent = 16 * sum(map(size, above[plane][t // 4])) // 3 if level else None
                residual = []
                for m in range(siblings - 1):
                    twin = same[t][m] if siblings == 4 else m
                    if twin < m:
                        q[t][m] = q[t][twin]
                    elif level < finest:
                        beside = 16 * sum(map(size, q[t][:m])) // m if m else None
                        last = None
                        if before is not None:
                            last = 16 * (2 * size(before[t][m]) + sum(map(size, before[t]))) // 5
                        q[t][m] = details.detail(coder, level + 1, parent, neighbours, beside, last)
                    x = q[t][m]
                    residual.append((F(x) - F((x > 0) - (x < 0)) * OFFSET) * own_step)
                deviations = householder(residual)
                four = [None] * 4
                for k, c in enumerate(order):
                    four[c] = means[t] + (predicted[c] + deviations[k] if k < siblings else F(0))
                children += four
            quantised.append(q)
            finer.append(children)
        decoded, above = finer, quantised
    return np.array(decoded, F).reshape(len(coded), vectors, mesh.count)


def splines(count, x):
    """The first of the four cubic B-splines that are not 0 at x, and their values."""
    spans = count - 3
    scaled = min(max(x, 0.0), 1.0) * float(spans)
    span = min(int(scaled), spans - 1)
    knot = lambda k: float(min(max(span + k, 0), spans))
    values = [1.0, 0.0, 0.0, 0.0]
    for degree in (1, 2, 3):
        saved = 0.0
        for r in range(degree):
            right, left = knot(r + 1), knot(r + 1 - degree)
            share = values[r] / (right - left)
            values[r] = saved + (right - scaled) * share
            saved = (scaled - left) * share
        values[degree] = saved
    return span, values


def degrees(angle):
    """Sine and cosine, those of multiples of 90 exact."""
    angle %= 360.0
    quarters = {0.0: (0.0, 1.0), 90.0: (1.0, 0.0), 180.0: (0.0, -1.0), 270.0: (-1.0, 0.0)}
    radians = angle * (math.pi / 180.0)
    return quarters.get(angle) or (math.sin(radians), math.cos(radians))


def direction(frame, polar, azimuth):
    theta = (polar, 180.0 - polar, 90.0 - polar, 90.0 - polar)[frame]
    (sine, z), (y, x) = degrees(theta), degrees(azimuth)
    x, y = sine * x, sine * y
    return ((x, y, z), (x, y, z), (y, -z, -x), (x, -y, z))[frame]


class Chart:
    """A model of scattering: columns for each row, orthonormal through a Cholesky factor."""

    @staticmethod
    def of_triangles(kind, shape, plan):
        mesh, zonal = shape.mesh, kind == 3
        require(zonal == (mesh.domain == SPHERE) and len(shape.block_axes) == 1, "a model that makes no sense")
        axis = shape.block_axes[0]
        if axis.kind == "triangles":
            require(zonal == (axis.domain == SPHERE), "a model that makes no sense")
            incoming = centroids(axis.domain, axis.level)
        else:
            require(axis.kind == "elevation" and not zonal, "a model that makes no sense")
            incoming = [(s * 1.0, s * 0.0, c) for s, c in map(degrees, axis.values)]
        return Chart(kind, [incoming[b] for b in plan.representatives], centroids(mesh.domain, mesh.level), 4096)

    @staticmethod
    def of_grid(kind, shape, kept):
        require(kind < 3 and shape.blocks == 1 and shape.first > 0, "a model of directions that are not there")
        parts = []
        for (frame, only), lines in zip(shape.frames, (kept[: shape.first], kept[shape.first :])):
            azimuths = lines[1].positions if len(lines) > 1 else [only]
            parts.append([direction(frame, polar, azimuth) for polar in lines[0].positions for azimuth in azimuths])
        return Chart(kind, *parts, 65536)

    def __init__(self, kind, incoming, outgoing, most):
        self.kind, self.incoming, self.outgoing, self.most = kind, incoming, outgoing, most
        self.constants = 0 if kind == 3 or len(self.incoming) > 64 else len(self.incoming)
        self.columns = self.row(0, 0)[1]
        self.factor = self.cholesky(self.gram())

    def row(self, block, leaf):
        """`[(column, value)]`, and how many columns there are."""
        wi, wo = self.incoming[block], self.outgoing[leaf]
        angle = math.sqrt(max(1.0 - dot(wi, wo), 0.0) / 2.0)
        entries = []

        def single(first, count, x):
            at, values = splines(count, x)
            entries.extend((first + at + k, v) for k, v in enumerate(values))
            return first + count

        def both(first, nx, x, ny, y):
            (ax, vx), (ay, vy) = splines(nx, x), splines(ny, y)
            entries.extend((first + (ax + i) * ny + ay + j, a * b) for i, a in enumerate(vx) for j, b in enumerate(vy))
            return first + nx * ny

        if self.kind == 3:
            return entries, single(0, 32, angle)
        wo = (wo[0], wo[1], abs(wo[2]))
        wi = (wi[0], wi[1], abs(wi[2]))
        h = plus(wi, wo)
        h = times(h, 1.0 / math.sqrt(max(dot(h, h), sys.float_info.min)))
        to_normal = math.sqrt(max(1.0 - h[2], 0.0))
        difference = math.sqrt(max(1.0 - dot(wi, h), 0.0))
        height = math.sqrt(wo[2])
        if block < self.constants:
            entries.append((block, 1.0))
        at = self.constants
        if self.kind == 1:
            peak = math.sqrt(to_normal)
            at = single(at, 14, peak)
            at = single(at, 6, difference)
            at = single(at, 7, height)
            at = single(at, 7, angle)
            at = both(at, 10, peak, 5, difference)
            at = both(at, 4, height, 5, difference)
            return entries, at
        at = single(at, 7, height)
        at = single(at, 7, angle)
        at = single(at, 6, difference)
        across = lambda x: 0.5 + 0.5 * x * 1.06 / math.sqrt(x * x + 0.1236)
        planar = len(entries)
        at = both(at, 10, across(h[0]), 10, across(h[1]))
        centred = difference - 0.5
        first = entries[planar:]
        entries.extend((column + 100, value * centred) for column, value in first)
        entries.extend((column + 200, value * centred * centred) for column, value in first)
        return entries, at + 200

    def gram(self):
        rows, leaves = len(self.incoming) * len(self.outgoing), len(self.outgoing)
        stride = 1 if rows <= self.most else -(-rows // self.most) | 1
        gram = np.zeros((self.columns, self.columns))
        for at in range(0, rows, stride):
            entries = self.row(at // leaves, at % leaves)[0]
            columns = np.array([c for c, _ in entries])
            values = np.array([v for _, v in entries])
            gram[np.ix_(columns, columns)] += values[:, None] * values[None, :]
        return (gram * float(stride)).tolist()

    def cholesky(self, gram):
        lower = [[0.0] * self.columns for _ in gram]
        for i, row in enumerate(lower):
            for j in range(i):
                other = lower[j]
                if other[j] > 0.0:
                    along = 0.0
                    for k in range(j):
                        along += row[k] * other[k]
                    row[j] = (gram[i][j] - along) / other[j]
            square = 0.0
            for k in range(i):
                square += row[k] * row[k]
            left = gram[i][i] - square
            if left > 1e-4 * gram[i][i]:
                row[i] = math.sqrt(left)
            else:
                row[:] = [0.0] * self.columns
        return lower

    def decode(self, coder, step, vectors):
        details, n = Details(), self.columns
        before = [0] * n
        planes = np.zeros((len(self.incoming), vectors, len(self.outgoing)), F)
        coefficients = []
        for vector in range(vectors):
            last, x = [64, 64, 64], [0.0] * n
            for column in range(n):
                if self.factor[column][column] > 0.0:
                    around = 16 * (2 * last[0] + last[1] + last[2]) // 4
                    q = details.detail(coder, 0, None, around, None, 16 * before[column] if vector else None)
                    size = min(abs(q), 1 << 16)
                    last, before[column] = [size, last[0], last[1]], size
                    x[column] = float(q) * float(step)
            for i in reversed(range(n)):
                row = self.factor[i]
                x[i] = x[i] / row[i] if row[i] > 0.0 else 0.0
                for k in range(i):
                    x[k] -= row[k] * x[i]
            coefficients.append(x)
        for block in range(len(self.incoming)):
            for leaf in range(len(self.outgoing)):
                entries = self.row(block, leaf)[0]
                for vector, x in enumerate(coefficients):
                    total = 0.0
                    for column, value in entries:
                        total += value * x[column]
                    planes[block, vector, leaf] = F(total)
        return planes


class LevelIndex:
    """The part of a pyramid chunk about the levels below its own."""

    def __init__(self, r, levels, length):
        self.ends, self.errors, end = [], [], 0
        self.brightness = b""
        for level in range(levels):
            start = r.at
            end += r.varint()
            if end == 0:
                r.note(start, "no coarser levels")
                return
            k = r.unsigned(1)
            self.ends.append(end)
            self.errors.append(0.0 if k == 0 else math.inf if k == 255 else 2.0 ** ((k - 140) / 8))
            r.note(start, f"level {level}: {end} bytes of what follows the levels, er(L2) {self.errors[-1]:.3g}")
        start = r.at
        if levels:
            self.brightness = r.take(r.varint())
            r.note(start, f"steps of the brightness, {len(self.brightness)} bytes")
        require(end <= length - (r.at - r.start), "a level that needs more than there is")

    def factors(self, level, representatives):
        count = len(self.ends) * representatives
        steps = decode_steps(self.brightness, count, representatives) if self.brightness else [0] * count
        own = steps[level * representatives : (level + 1) * representatives]
        return [F(math.exp(float(min(max(k, -5000), 5000)) * 0.015)) if k else None for k in own]


def predicted_logs(h, classes, basis, r, finest):
    shape = Shape(h.axes)
    require((basis is not None) == (shape.length > 1), "a basis chunk without a spectral axis, or none with one")
    basis = None if basis is None else Basis(basis, h.axes, shape.rows, h.step)
    vectors = 1 if basis is None else basis.rank
    plan = Plan(r, shape)
    count = len(plan.representatives)
    if plan.random:
        names = ["the model"] * bool(plan.kind) + [f"block {b}" for b in plan.representatives if not plan.alone]
        start, lengths = r.at, [r.varint() for _ in names]
        r.note(start, "lengths of the streams")
        coders = [Decoder(r.take(n, f"range-coded: {name}" if n else None)) for n, name in zip(lengths, names)]
        require(r.left() == 0, "bytes after the last stream")
    else:
        coders = [Decoder(r.take(r.left(), "range-coded: the model's coefficients, means and details"))]
    model = None
    if plan.kind:
        coder = coders.pop(0) if plan.random else coders[0]
        model = Chart.of_triangles(plan.kind, shape, plan).decode(coder, h.step, vectors)
    planes = np.zeros((count, vectors, shape.mesh.count), F)
    if not plan.alone:
        live = live_leaves(shape, plan, classes)
        parts = [[k] for k in range(count)] if plan.random else [list(range(count))]
        decode = lambda coder, part: decode_pyramid(coder, shape, plan, live, h.step, vectors, finest, part)
        planes = np.concatenate([decode(coder, part) for coder, part in zip(coders, parts)])
    if model is not None:
        planes = planes + model
    rows = np.zeros((shape.rows, vectors), F)
    for plane, block in zip(planes, plan.representatives):
        there = set()
        for moves, leaves in zip(plan.moves, plan.leaves):
            if moves[block] in there:
                continue
            there.add(moves[block])
            for leaf, to in enumerate(leaves):
                rows[shape.row(moves[block], to)] = plane[:, leaf]
    h.found = (plan.kind, len(plan.leaves), not plan.alone and live is not None, plan.random)
    logs = rows if basis is None else basis.synthesise(rows)
    return logs.reshape(-1), shape, plan


# ---------------------------------------------------------------------------------------------------------------------
# Grids of angles


def lanes_of(length):
    return [1, 2, 0] if length == 3 else list(range(length))


class Line:
    def __init__(self, angles, extent=None, poles=(None, None)):
        self.angles, self.extent, self.poles = list(angles), extent, poles


class GridShape:
    @staticmethod
    def of(axes):
        at = max((i for i, axis in enumerate(axes) if axis.kind in ("triangles", "grid")), default=None)
        if at is None or axes[at].kind != "grid" or len(axes) > at + 2:
            return None
        return GridShape(axes, at)

    def __init__(self, axes, at):
        front = axes[at - 1] if at > 0 else None
        own = []
        if front is not None and front.kind == "elevation":
            own = [Line(front.values)]
        elif front is not None and front.kind == "grid":
            own = self.lines_of(front)
        self.blocks = math.prod(axis.count for axis in axes[: at - bool(own)])
        self.first = len(own)
        outgoing = self.lines_of(axes[at])
        self.lines = own + outgoing
        only = lambda axis: (axis.values[2], axis.values[1][0] if axis.values[1] else 0.0)
        self.frames = [only(front) if front is not None and front.kind == "grid" else (0, 0.0), only(axes[at])]
        self.length = axes[at + 1].count if at + 1 < len(axes) else 1
        self.incoming = self.blocks * math.prod(len(line.angles) for line in own)
        lengths = [len(line.angles) for line in outgoing]
        self.polar, self.around = lengths if len(lengths) == 2 else (1, lengths[0])
        self.rows = self.blocks * math.prod(len(line.angles) for line in self.lines)

    @staticmethod
    def lines_of(axis):
        polar, azimuths, frame, extent = axis.values
        low, high = (0, 180) if frame < 2 else (-90, 90)
        if len(azimuths) < 2:
            return [Line(polar)]
        return [Line(polar, poles=(polar[0] == low, polar[-1] == high)), Line(azimuths, extent)]


class Kept:
    def __init__(self):
        self.source, self.positions, self.circle, self.poles = [], [], False, []


def read_repeats(coder, shape):
    all_kept = []
    for line in shape.lines:
        kept, count = Kept(), len(line.angles)
        seam = line.extent == 1 and coder.even()
        count -= bool(seam)
        drops = [0] * count
        if count > 1 and coder.even():
            model = Model()
            for entry in range(1, count):
                drops[entry] = model.one(coder, ("repeats", drops[entry - 1]))
        for angle, drop in zip(line.angles, drops):
            if not drop:
                kept.positions.append(float(angle))
            kept.source.append(len(kept.positions) - 1)
        if seam:
            kept.source.append(0)
        kept.circle = bool(seam) or line.extent == 0
        all_kept.append(kept)
    for line, kept, behind in zip(shape.lines, all_kept, all_kept[1:]):
        for entry, pole in zip((0, len(kept.positions) - 1), line.poles):
            if pole and len(behind.positions) > 1 and entry not in kept.poles and coder.even():
                kept.poles.append(entry)
    return all_kept


def rows_of(kept):
    rows, before = [0], None
    for line in kept:
        n = len(line.positions)
        pole = lambda row: before is not None and row % len(before.positions) in before.poles
        rows = [row * n + (0 if pole(row) else entry) for row in rows for entry in line.source]
        before = line
    return rows


def read_order(coder, lengths):
    lengths, order = list(lengths), []
    while max(lengths) > 1:
        axes = [a for a in range(4) if lengths[a] > 1]
        axis = next((a for a in axes[:-1] if coder.even()), axes[-1])
        order.append(axis)
        lengths[axis] = (lengths[axis] + 1) // 2
    return order


def gauss(rows):
    """Solves rows `[A | b]` with partial pivoting; None if A is singular."""
    n = len(rows)
    largest = max(abs(x) for row in rows for x in row[:n])
    for c in range(n):
        pivot = max(range(c, n), key=lambda r: (abs(rows[r][c]), r))
        if abs(rows[pivot][c]) <= 1e-14 * largest:
            return None
        rows[c], rows[pivot] = rows[pivot], rows[c]
        for r in range(c + 1, n):
            factor = rows[r][c] / rows[c][c]
            rows[r] = [x - factor * y for x, y in zip(rows[r], rows[c])]
    x = [0.0] * n
    for i in reversed(range(n)):
        x[i] = (rows[i][n] - sum(rows[i][k] * x[k] for k in range(i + 1, n))) / rows[i][i]
    return x


def guesses(positions, circle, halvings, wraps):
    span = 1 << halvings
    nodes = -(-len(positions) // span)
    to_units = lambda c: nearest(c * 65536) / 65536

    def entries(at):
        turns, node = divmod(at, nodes)
        if turns != 0 and not wraps:
            return None
        return [x + turns * (360.0 if circle else 0.0) for x in positions[node * span : (node + 1) * span]]

    def of_node(node):
        own = entries(node)
        if len(own) <= span // 2:
            return [0.0] * 4
        mean = lambda x: sum(x) / len(x)
        centre, halves = mean(own), (own[: span // 2], own[span // 2 :])
        children = mean(halves[1]) - mean(halves[0])
        around = [entries(node + by) for by in (1, -1, 2, -2)]
        if around[0] is None and around[1] is None:
            return [0.0] * 4
        if around[1] is None:
            return [to_units(0.8 * min(children / (mean(around[0]) - centre), 0.625)), 0.0, 0.0, 0.0]
        if around[0] is None:
            return [0.0, -to_units(0.8 * min(children / (centre - mean(around[1])), 0.625)), 0.0, 0.0]
        distance = mean(around[0]) - mean(around[1])
        moment = lambda x, k: mean([((y - centre) / (0.5 * distance)) ** k for y in x])
        wanted = [moment(halves[1], k) - moment(halves[0], k) for k in range(1, 5)]
        for count in [4, 2] if nodes > 4 and all(x is not None for x in around) else [2]:
            rows = [[moment(x, k) - moment(own, k) for x in around[:count]] + [wanted[k - 1]] for k in range(1, count + 1)]
            c = gauss(rows)
            if c is not None and sum(abs(x) for x in c) <= 1.5:
                return [to_units(x) for x in c] + [0.0] * (4 - count)
        slope = to_units(min(children / distance, 0.5))
        return [slope, -slope, 0.0, 0.0]

    return [of_node(node) for node in range(nodes)]


class Squares:
    """Recursive least squares."""

    def __init__(self, n):
        self.n, self.a, self.b, self.count, self.next = n, np.zeros((n, n)), np.zeros(n), 0.0, 0.0
        self.c = np.zeros(n)

    def fade(self):
        self.a, self.b, self.count, self.next = self.a * 0.3, self.b * 0.3, self.count * 0.3, 0.0

    def solve(self, prior, least):
        n, u, x = self.n, self.a.copy(), self.b.copy()
        prior = np.concatenate([prior, np.zeros(n - 4)])
        self.next = self.count * 1.05 + 1.0
        own = np.diag(self.a)
        ridge = (10.0 * own / self.count if self.count > 0 else 0.0 * own) + least
        u[range(n), range(n)] = own + ridge
        x += ridge * prior
        self.c = prior
        for k in range(n):
            if not u[k, k] > 0:
                return
            pivot = math.sqrt(u[k, k])
            inverse = 1.0 / pivot
            u[k, k] = pivot
            u[k, k + 1 :] *= inverse
            x[k] *= inverse
            x[k + 1 :] -= u[k, k + 1 :] * x[k]
            for i in range(k + 1, n):
                u[i, i:] -= u[k, i] * u[k, i:]
        for i in reversed(range(n)):
            for k in range(i + 1, n):
                x[i] -= u[i, k] * x[k]
            x[i] /= u[i, i]
        if np.isfinite(x).all():
            self.c = x

    def predict(self, f):
        sums = [0.0] * 4
        for i in range(self.n):
            sums[i % 4] += self.c[i] * f[i]
        return (sums[0] + sums[2]) + (sums[1] + sums[3])

    def learn(self, f, wanted):
        self.a += f[:, None] * f[None, :]
        self.b += wanted * f
        self.count += 1.0


def residual_tables():
    odds, offsets = [], []
    for s in range(256):
        deviation = 2.0 ** ((s + 0.5 - 80) / 16)
        t = math.exp(-0.5 / (0.579 * deviation))
        p = [2 * t / (1 + t)] + [t * t * (1 + t ** (2 * k - 1)) / (1 + t ** (2 * k + 1)) for k in range(1, 16)]
        log = lambda x: math.log(max(x, 1e-300))
        odds.append([nearest(min(max(256 * (log(x) - log(1 - x)), -2944), 2944)) for x in p])
        h, row = 1 / (0.58 * deviation), [0]
        for m in range(1, 16):
            z = [(i + 0.5) / 8 - 0.5 for i in range(8)]
            d = [math.exp(-(x + 0.5) * h) / (1 + math.exp(-(m + x) * h)) ** 2 for x in z]
            row.append(nearest(4096 * sum(a * b for a, b in zip(d, z)) / sum(d)))
        offsets.append(row)
    return odds, offsets


OCTAVES = [math.floor(8 * math.log2(1 + (i + 0.5) / 64)) for i in range(64)]


def octaves(x):
    raw = struct.unpack("<Q", struct.pack("<d", x))[0]
    return ((raw >> 52 & 0x7FF) - 1023) * 8 + OCTAVES[raw >> 46 & 63]


class Residuals(Model):
    def __init__(self):
        super().__init__()
        self.odds, self.offsets = residual_tables()

    def guided(self, coder, odds, contexts, name):
        slots = [self.slot(context) for context in contexts]
        weights = self.weights.setdefault(name, [65536, 0, 0, 0])
        stretched = [odds] + [STRETCH[slot[0] >> 10] for slot in slots]
        p1 = SQUASH[min(max(sum(s * w for s, w in zip(stretched, weights)) >> 16, -ODDS), ODDS) + ODDS]
        bit = coder.bit(p1)
        for i, s in enumerate(stretched):
            product = ((bit << 16) - p1) * s
            part = abs(product) // 16 * (1 if product >= 0 else -1)
            weights[i] = min(max(weights[i] + (part * 5 >> 12), -(1 << 20)), 1 << 20)
        for slot in slots:
            self.update(slot, bit)
        return bit

    def decode(self, coder, variance, near, depth, place):
        clamp = lambda x, high: min(max(x, 0), high)
        s = clamp(octaves(variance) + 80, 255)
        c, k = clamp((5 * (s - 80) >> 5) + 12, 39), clamp((3 * octaves(near) >> 5) + 9, 23)
        def decide(kind):
            contexts = [("scale", kind, c), ("near", kind, k, depth), ("place", kind, place, c // 3)]
            return self.guided(coder, self.odds[s][kind], contexts, kind)
        if not decide(0):
            return 0.0
        sign, m = -1.0 if coder.even() else 1.0, 1
        while m < 16 and decide(m):
            m += 1
        if m == 16:
            low = clamp(math.trunc((s - 80) / 16), 12)
            m += golomb(coder, self, "rest") << low
            m += coder.bits(low)
        return sign * (m + self.offsets[s][min(m, 15)] / 4096)


class Expected:
    def __init__(self, unit):
        self.unit, self.mean, self.bins = unit, 0.02 * unit * unit, [[0.0, 0.0] for _ in range(64)]

    def bin(self, mean):
        return self.bins[int(min(max(math.floor(mean * (2.0 / self.unit)) + 32, 0), 63))]

    def of(self, one):
        return (self.mean * 4.0 + one[0]) / (4.0 + one[1])

    def learn(self, one, error):
        self.mean += (error - self.mean) * 0.02
        one[0], one[1] = one[0] * 0.98 + error, one[1] * 0.98 + 1.0


def offset(*parts):
    place = [0, 0, 0, 0]
    for axis, by in parts:
        place[axis] += by
    return tuple(place)


class Around:
    """Places of features and of errors when one axis is halved."""

    def __init__(self, a, long):
        across, every = [b for b in range(4) if b != a and long[b]], [b for b in range(4) if long[b]]
        pairs = lambda axes: [(b, c) for i, b in enumerate(axes) for c in axes[i + 1 :]]
        self.differences = [offset((a, by)) for by in (1, -1, 2, -2)]
        self.slopes = [(offset((a, 1), (b, s)), offset((a, -1), (b, s))) for b in across for s in (1, -1)]
        self.details = [offset((a, -1))]
        for b in across:
            self.details += [offset((b, -1))] + [offset((b, -1), (a, 1))] * (b < a)
            self.details += [offset((b, -1), (a, -1)), offset((b, -2))]
        self.details += [offset((b, -1), (c, s)) for b, c in pairs(across) for s in (-1, 1)]
        self.others = [offset((a, by)) for by in (0, 1, -1)]
        self.errors = [(offset((b, -k)), 1.0 / k) for b in every for k in (1, 2)]
        knights = [(-1, -1, 0.5), (-1, 1, 0.5), (-1, 2, 0.25), (-2, 1, 0.25), (-2, -1, 0.25)]
        self.errors += [(offset((b, x), (c, y)), w) for b, c in pairs(every) for x, y, w in knights]
        self.count = 10 + len(self.slopes) + len(self.details)


class Pairs:
    """The pyramid of planes on up to four lines."""

    def __init__(self, lines, order, weights, by_plane):
        lines = [Line([0.0])] * (4 - len(lines)) + [Line(k.positions, k.circle) for k in lines]
        self.halvings, self.by_plane = [], by_plane
        lengths, halved = [len(line.angles) for line in lines], [0] * 4
        self.long = [n > 1 for n in lengths]
        self.weights = [[np.array(w, F).reshape(lengths)] for w in weights]
        for axis in order:
            wraps = [bool(line.extent) for line in lines]
            wraps[axis] &= lengths[axis] % 2 == 0
            halved[axis] += 1
            guess = guesses(lines[axis].angles, bool(lines[axis].extent), halved[axis], wraps[axis])
            children = list(lengths)
            lengths[axis] = (lengths[axis] + 1) // 2
            self.halvings.append((axis, children, list(lengths), wraps, guess))
            for levels in self.weights:
                even, odd = [np.take(levels[-1], range(k, children[axis], 2), axis) for k in (0, 1)]
                pad = [(0, int(b == axis and children[axis] % 2)) for b in range(4)]
                levels.append(even + np.pad(odd, pad))

    def weight(self, plane, vectors, level):
        sets = self.weights
        return sets[min(plane if self.by_plane else plane // vectors, len(sets) - 1)][level]

    def decode(self, coder, step, unit, learns, planes, vectors, left_out=0):
        residuals, unit = Residuals(), unit / step
        expected = [Expected(unit) for _ in range(4)]
        around = [Around(a, self.long) for a in range(4)]
        squares = [[Squares(around[a].count) for _ in range(4)] for a in range(4)]
        values, inherited, seen = [], [None] * planes, set()
        for plane in range(planes):
            weight = float(self.weight(plane, vectors, len(self.halvings)).reshape(-1)[0])
            root = F(0)
            if weight > 0:
                count = coder.bits(5)
                number = (1 << count - 1 | coder.bits(count - 1)) if count else 0
                root = F((-number if count and coder.even() else number) / math.sqrt(weight))
            values.append(np.full((1, 1, 1, 1), root, F))
        for level in reversed(range(left_out, len(self.halvings))):
            axis = self.halvings[level][0]
            if axis in seen:
                for system in squares[axis]:
                    system.fade()
            seen.add(axis)
            before = []
            for plane in range(planes):
                kind = min(plane % vectors, 3)
                state = (residuals, expected[kind], squares[axis][kind] if learns else None, around[axis], unit)
                found = self.halve(coder, state, level, kind, values[plane], inherited[plane], before, self.weight(plane, vectors, level))
                values[plane], inherited[plane] = found[0], found[1]
                before = [found[2]] + before[:1]
        return [(v * F(step)).reshape(-1) for v in values]

    def halve(self, coder, state, level, kind, means, inherited, before, weights):
        residuals, expected, squares, around, unit = state
        axis, children, parents, wraps, guess = self.halvings[level]
        new, errors_of_new = np.zeros(children, F), np.full(children, -1, F)
        details, errors = np.zeros(parents, F), np.zeros(parents + [4], F)
        depth = min(level // max(sum(self.long), 1), 3)

        def place(u, by):
            at = [x + d for x, d in zip(u, by)]
            for b in range(4):
                if not 0 <= at[b] < parents[b]:
                    if not wraps[b]:
                        return None
                    at[b] %= parents[b]
            return tuple(at)

        for u in np.ndindex(*parents):
            mean, own_inherited = means[u], F(-1) if inherited is None else inherited[u]
            first = tuple(2 * x if b == axis else x for b, x in enumerate(u))
            second = tuple(x + (b == axis) for b, x in enumerate(first))
            if second[axis] >= children[axis]:
                new[first], errors_of_new[first] = mean, own_inherited
                continue
            w0, w1 = float(weights[first]), float(weights[second])
            weight = w0 * w1 / (w0 + w1) if w0 > 0 and w1 > 0 else 0.0
            f = []
            for i, by in enumerate(around.differences):
                at = place(u, by) if i < 2 or parents[axis] > 4 else None
                f.append(0.0 if at is None else float(means[at]) - float(mean))
            for pair in around.slopes:
                a, b = (place(u, by) for by in pair)
                f.append(0.0 if a is None or b is None else float(means[a]) - float(means[b]))
            get = lambda array, by: 0.0 if place(u, by) is None else float(array[place(u, by)])
            f += [get(details, by) for by in around.details]
            for k in range(2):
                f += [get(before[k], by) if k < len(before) else 0.0 for by in around.others]
            f = np.array(f)
            square = 1.0 / weight if weight > 0 else 1.0
            c = guess[u[axis]]
            fixed = ((c[0] * f[0] + c[1] * f[1]) + c[2] * f[2]) + c[3] * f[3]
            one = expected.bin(float(mean))
            prior, learned = expected.of(one), fixed
            if squares is not None:
                if squares.next <= 0 or squares.count >= squares.next:
                    squares.solve(np.array(c), (1.0 / 12.0) * square + 1e-9 * unit * unit)
                learned = min(max(squares.predict(f), -6.0 * unit), 6.0 * unit)
            sums = np.zeros(4, F)
            for by, counts in around.errors:
                at = place(u, by)
                if at is not None:
                    sums = sums + F(counts) * errors[at]
            if own_inherited >= 0:
                half = F(0.5) * own_inherited
                sums = sums + np.array([half, half, half, 0.5], F)
            of_fixed, of_learned, of_blend, number = (float(x) for x in sums)
            floor, share = 0.0125 * square, 1.0 / (number + 0.5)
            variance = lambda total, prior: (total + 0.5 * (prior + floor)) * share + floor
            blend = fixed
            if squares is not None:
                ratio = min(variance(of_learned, prior) / variance(of_fixed, 0.6 * prior), 1e9)
                by_fixed = (ratio * ratio) * (ratio * ratio)
                blend = (learned + by_fixed * fixed) / (1.0 + by_fixed)
            detail, error = blend, own_inherited
            if weight > 0:
                near = of_blend / number if number > 0 else prior
                q = residuals.decode(coder, variance(of_blend, prior) * weight, near * weight, depth, 4 * axis + kind)
                detail = blend + q * math.sqrt(square)
                found = [min((detail - x) * (detail - x), 1e30) for x in (fixed, learned, blend)]
                errors[u] = found + [1.0]
                expected.learn(one, found[2])
                if squares is not None:
                    squares.learn(f, detail)
                details[u] = detail
                error = F(found[2]) * F(0.8)
            if weight > 0:
                down, up = w1 / (w0 + w1), w0 / (w0 + w1)
            else:
                down = 0.0 if w0 > 0 else 1.0 if w1 > 0 else 0.5
                up = 0.0 if w1 > 0 else 1.0 if w0 > 0 else 0.5
            new[first], new[second] = float(mean) - down * detail, float(mean) + up * detail
            errors_of_new[first] = errors_of_new[second] = error
        return new, errors_of_new, details


def read_grid_levels(r, h):
    start, levels, end = r.at, [], 0
    count = r.varint()
    require(1 <= count <= 96, "too many or no levels")
    r.note(start, f"{count} coarser levels")
    for _ in range(count):
        start, more, left_out = r.at, r.varint(), r.unsigned(1)
        require(more > 0 and left_out > 0 and (not levels or left_out < levels[-1][1]), "a level that is no finer")
        error = np.array([r.unsigned(3) << 8], np.uint32).view(F)[0]
        require(error >= 0 and np.isfinite(error), "an error that is no number")
        end += more
        levels.append((end, left_out))
        r.note(start, f"level of {end} bytes without {left_out} halvings, er(L2) {error:.6g}")
    require(end <= h.pyramid_length - (r.at - r.start), "levels of more bytes than the stream has")
    return levels


def coarse_lines(shape, kept, left_out):
    """Returns for each line of a level: nodes, angles, the node of each entry, halvings."""
    lines = []
    for i, (line, own) in enumerate(zip(shape.lines, kept)):
        halvings = sum(axis == 4 - len(kept) + i for axis in left_out)
        if halvings == 0:
            lines.append((len(own.positions), list(line.angles), list(own.source), 0))
            continue
        count = len(own.positions)
        for _ in range(halvings):
            count = (count + 1) // 2
        stated = len(own.source) - (1 if line.extent == 1 and own.circle else 0)
        sums, merged = [0.0] * count, [0] * count
        for source, angle in zip(own.source[:stated], line.angles):
            sums[source >> halvings] += angle
            merged[source >> halvings] += 1
        lines.append((count, [s / n for s, n in zip(sums, merged)], list(range(count)), halvings))
    return lines


def coarse_directions(shape, lines):
    """Incoming and outgoing directions of a level, in the order of its rows."""
    parts = []
    for (frame, only), span in zip(shape.frames, (slice(0, shape.first), slice(shape.first, None))):
        own, stated = lines[span], shape.lines[span]
        azimuths = [only]
        if len(own) > 1:
            count, azimuths, _, halvings = own[1]
            if halvings and count == 1:
                azimuths = [0.0]
            elif halvings and stated[1].extent == SECTOR:
                # Nothing is known outside a sector, whose ends stay where they are.
                azimuths = stated[1].angles[:1] + azimuths[1:-1] + stated[1].angles[-1:]
        parts.append([direction(frame, polar, azimuth) for polar in own[0][1] for azimuth in azimuths])
    return parts


def coarse_model(model, weights, kept, left_out):
    """The model's planes at the nodes of a level: means by weight of the leaves that they merge."""
    nodes, count = [0], 1
    for i, own in enumerate(kept):
        halvings = sum(axis == 4 - len(kept) + i for axis in left_out)
        length = -(-len(own.positions) // (1 << halvings))
        nodes = [node * length + (entry >> halvings) for node in nodes for entry in range(len(own.positions))]
        count *= length
    planes = []
    for plane, values in enumerate(model[0].astype(float)):
        own = weights[min(plane, len(weights) - 1)]
        sums, weighs, alls, numbers = np.zeros((4, count))
        for node, value, weight in zip(nodes, values, own):
            sums[node] += weight * value
            weighs[node] += weight
            alls[node] += value
            numbers[node] += 1
        with np.errstate(invalid="ignore"):
            planes.append(np.where(weighs > 0, sums / weighs, alls / numbers).astype(F))
    return np.array([planes])


def coarse_samples(h, classes, shape, kept, lines, first, values, bound, divided):
    """Samples of a level from the values of its nodes."""
    rows = [0]
    for i, (count, _, entries, _) in enumerate(lines):
        poles = kept[i - 1].poles if i > 0 and lines[i - 1][3] == 0 else []
        before = lines[i - 1][0] if i > 0 else 1
        rows = [row * count + (0 if row % before in poles else entry) for row in rows for entry in entries]
    nodes = math.prod(line[0] for line in lines)
    rows = [block * nodes + row for block in range(shape.blocks) for row in rows]
    values = values[rows]
    if divided is not None:
        divisors = divided.logarithms(*coarse_directions(shape, lines)).reshape(-1, 1)
        values = values + np.tile(divisors, (shape.blocks, 1))
    samples = finish(h, values.reshape(-1)).reshape(len(rows), shape.length)
    if classes is not None:
        merged = list(range(shape.blocks))
        for (count, _, _, halvings), own in zip(lines, kept):
            merged = [node * count + (entry >> halvings) for node in merged for entry in range(len(own.positions))]
        table = classes.reshape(shape.rows, shape.length)
        signs, measured = np.zeros((shape.blocks * nodes, shape.length)), np.zeros((shape.blocks * nodes, shape.length))
        for leaf, row in first.items():
            signs[merged[leaf]] += (table[row] == POSITIVE).astype(float) - (table[row] == NEGATIVE)
            measured[merged[leaf]] += table[row] != MASKED
        with np.errstate(invalid="ignore"):
            shares = (signs / measured).astype(F)[rows]
            samples = np.where(np.isnan(shares), F(np.nan), samples * shares).astype(F)
        if bound is not None:
            samples = np.maximum(samples, -finish(h, np.array([bound], F))[0])
    return samples.reshape(-1)


def decode_grid(h, classes, basis, r, between, level=None):
    shape = h.grid
    require(basis is None or shape.length > 1, "a basis chunk without a last axis behind the directions")
    basis = None if basis is None else Basis(basis, h.axes, shape.rows, h.step, gridded=True)
    start, form = r.at, r.unsigned(1)
    kind, weighs = form >> 4 & 3, form & 64
    require(kind < 3 and form & 9 != 9 and form & 66 != 66 and bool(form & 8) == bool(h.flags & LEVELS), "an unknown form of a grid chunk")
    divided = between if form & 128 else None
    require(not form & 128 or divided is not None and divided.divisor > 0, "samples divided by a function that is not stated")
    require(not form & 128 or shape.first > 0 and not h.flags & LINEAR, "samples divided that have no incoming angles or logarithms")
    require(not form & 128 or all(frame == 0 for frame, _ in shape.frames), "samples divided on angles of luminaires")
    random, has_bound, learns = form & 1, form & 2, not form & 4
    r.note(start, f"form of the grid chunk {form}")
    bound = h.negative_bound = F(r.number("f")) if has_bound else None
    levels = r.levels = read_grid_levels(r, h) if form & 8 else []
    r.levels_at = r.at
    require(level is None or level < len(levels), "there is no such level")
    end, left_out = (r.left(), 0) if level is None else levels[level]
    coder = Decoder(r.take(r.varint() if random else end, "range-coded: what repeats, order of halvings"))
    kept = read_repeats(coder, shape)
    lines = kept[shape.first :] if random else kept
    lengths = [1] * (4 - len(lines)) + [len(k.positions) for k in lines]
    order = read_order(coder, lengths)
    require(not levels or levels[0][1] <= len(order), "a level without more halvings than there are")
    inner = rows_of(kept)
    leaves = math.prod(len(k.positions) for k in kept)
    rows = [block * leaves + row for block in range(shape.blocks) for row in inner]
    unit_leaves = math.prod(lengths)
    units = shape.blocks * leaves // unit_leaves
    vectors = shape.length if basis is None else basis.rank
    first = {}
    for row, leaf in enumerate(rows):
        first.setdefault(leaf, row)
    model = None
    if kind:
        model = Chart.of_grid(kind, shape, kept).decode(coder, h.step, vectors)
        # [incoming entries, vectors, leaves] as the planes of units.
        model = model if random else model.transpose(1, 0, 2).reshape(1, vectors, leaves)
    lanes = lanes_of(shape.length)
    alive = (POSITIVE, NEGATIVE) if weighs else (POSITIVE,)
    live = None if classes is None else np.isin(classes, alive).reshape(shape.rows, shape.length)

    def weights(unit, lane):
        found = []
        for leaf in range(unit * unit_leaves, (unit + 1) * unit_leaves):
            there = leaf in first
            if there and live is not None:
                there = live[first[leaf]].any() if lane is None else live[first[leaf], lane]
            found.append(1.0 if there else 0.0)
        return found

    by_plane = basis is None and classes is not None
    which = [None] if not by_plane else lanes
    sets = [[weights(unit, lane) for lane in which] for unit in range(units if classes is not None or random else 1)]
    quantiser = (float(h.step), 32.0 * float(h.step) if h.flags & LINEAR else 1.0, learns)
    if random:
        start, sizes = r.at, [r.varint() for _ in range(units)]
        r.note(start, "lengths of the streams")
        planes = []
        for unit, size in enumerate(sizes):
            own = Decoder(r.take(size, f"range-coded: incoming entry {unit}" if size else None))
            pyramid = Pairs(lines, order, sets[min(unit, len(sets) - 1)], by_plane)
            planes += pyramid.decode(own, *quantiser, vectors, vectors)
        require(r.left() == 0, "bytes after the last stream")
    else:
        pyramid = Pairs(lines, order, [one for unit in sets for one in unit], by_plane)
        planes = pyramid.decode(coder, *quantiser, units * vectors, vectors, left_out)
        unit_leaves = len(planes[0])
    planes = np.array(planes).reshape(units, vectors, unit_leaves)
    if model is not None:
        sets = [np.array(one) for unit in sets for one in unit]
        planes = planes + (model if level is None else coarse_model(model, sets, kept, order[:left_out]))
    planes = planes.transpose(0, 2, 1).reshape(-1, vectors)
    if basis is None:
        values = np.zeros((len(planes), shape.length), F)
        values[:, lanes] = planes
    else:
        values = basis.synthesise(planes)
    if level is not None:
        lines = coarse_lines(shape, kept, order[:left_out])
        return coarse_samples(h, classes, shape, kept, lines, first, values, bound, divided)
    values = values[rows]
    if divided is not None:
        halves = shape.lines[: shape.first], shape.lines[shape.first :]
        directions = [
            [direction(frame, polar, azimuth) for polar in own[0].angles for azimuth in (own[1].angles if len(own) > 1 else [only])]
            for (frame, only), own in zip(shape.frames, halves)
        ]
        values = values + np.tile(divided.logarithms(*directions).reshape(-1, 1), (shape.blocks, 1))
    logs = values.reshape(-1)
    if bound is not None and classes is not None:
        logs = np.where(classes == NEGATIVE, np.minimum(logs, bound), logs).astype(F)
    return logs


# ---------------------------------------------------------------------------------------------------------------------
# Samples


def exponential(logs):
    x = np.clip(logs.astype(np.float64), -120.0, 100.0)
    rounder = 6755399441055744.0
    k = (x * 1.4426950408889634 + rounder) - rounder
    r = x - k * 0.6931471803691238 - k * 1.9082149292705877e-10
    total = np.full(x.shape, 1.0 / 362880.0)
    for factorial in (40320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0):
        total = total * r + 1.0 / factorial
    return (total * np.ldexp(1.0, k.astype(np.int64))).astype(F)


def finish(h, values):
    """From what was approximated to samples, but for the classes."""
    if not h.flags & LINEAR:
        return exponential(values)
    return values if h.counts[1] > 0 else np.where(values < 0, F(0), values)


def apply_classes(samples, classes):
    if classes is not None:
        samples = np.where(classes == NEGATIVE, -samples, samples)
        samples = np.where(classes == ZERO, F(0), samples)
        samples = np.where(classes == MASKED, F(np.nan), samples).astype(F)
    require(classes is not None or not np.isnan(samples).any(), "a coefficient is not a number")
    return samples


class Material:
    """A file, or with `level` its first bytes; `samples` are those of the file or of the level."""

    def __init__(self, data, level=None, trace=None):
        r = Fields(data, trace=trace)
        require(r.take(4) == b"\x89WLM", "not a material")
        r.note(0, "magic")
        version = r.unsigned(1)
        require(version == 1, f"version {version}")
        r.note(4, "version 1")
        self.data, self.trace, self.chunks, self.lengths, self.metadata = data, trace, {}, {}, None
        h = self.header = read_header(self.chunk(r, "H", level))
        for letter in announced(h):
            if level is None or r.left():
                self.chunks[letter] = self.chunk(r, letter, level)
        self.payload_end = r.at
        last = "N" if any(axis.kind == "grid" for axis in h.axes) else "M"
        if r.left():
            self.chunks[last] = self.chunk(r, last, level)
        require(r.left() == 0, "bytes after the last chunk")
        self.between = Between(self.chunks["V"], h) if "V" in self.chunks else None
        self.lobe = Lobe(self.chunks["A"], h) if "A" in self.chunks else None
        lanes = h.shape[-1] if h.shape else 1
        if h.axes and h.axes[-1].kind == "grid":
            polar, azimuths = h.axes[-1].values[:2]
            lanes = len(azimuths) if len(azimuths) > 1 else len(polar)
        self.classes = None
        if "C" in self.chunks:
            chunk = self.chunks["C"]
            coded = chunk.take(chunk.left(), "range-coded: classes")
            self.classes = decode_grid_classes(coded, h.grid) if h.grid else decode_classes(coded, h.count, lanes)
        if "D" in self.chunks:
            require(h.grid and "C" not in self.chunks, "a chunk D without a grid of angles, or beside a chunk C")
            chunk = self.chunks["D"]
            self.classes = decode_wide_classes(chunk.take(chunk.left(), "range-coded: classes in wide contexts"), h.grid)
        self.samples = self.decode(h, lanes) if level is None else self.decode_level(h, level)
        if last in self.chunks and level is None:
            chunk = self.chunks[last]
            start = chunk.at
            self.metadata = decode_provenance(chunk) if last == "N" else decode_text(chunk)
            chunk.note(start, f"length and range-coded text: {self.metadata}")
            json.loads(self.metadata)

    def chunk(self, r, letter, level):
        """The next chunk's payload, its checksum verified; of a prefix the last one may be cut."""
        start = r.at
        length = r.varint()
        payload = r.at
        r.note(start, f"chunk {letter}: {length} bytes")
        stated = letter == "P" or letter == "G" and self.header.flags & LEVELS
        require(not stated or length == self.header.pyramid_length, f"a chunk {letter} of another length than in the header")
        self.lengths[letter] = length
        cut = level is not None and r.left() < length + 4
        if cut:
            r.at = r.end
            return Fields(self.data, payload, min(payload + length, r.end))
        r.take(length)
        covered = letter.encode() + self.data[start : r.at]
        own = r.take(4, "checksum")
        require(own == blake3(covered)[:4], f"chunk {letter} does not match its checksum")
        return Fields(self.data, payload, payload + length, self.trace)

    def decode(self, h, lanes):
        transforms, classes = h.transforms, self.classes
        if h.policy == LOSSLESS:
            chunk = self.chunks["X"]
            samples = decode_exact(chunk.take(chunk.left(), "range-coded: samples"), h.count, lanes)
            if h.flags & FACTOR:
                samples = (samples.astype(np.float64) * h.factor).astype(F)
            return apply_classes(samples, classes)
        if h.flags & PREDICTED:
            r = self.chunks["P"]
            self.index = LevelIndex(r, Shape(h.axes).mesh.level, self.lengths["P"])
            self.coded_at = r.at
            logs, self.shape, self.plan = predicted_logs(h, classes, self.chunks.get("B"), r, MAX_LEVEL + 1)
        elif h.flags & GRIDDED:
            logs = decode_grid(h, classes, self.chunks.get("B"), self.chunks["G"], self.between)
        else:
            axes, live, basis = h.axes, classes, None
            if h.flags & KLT:
                basis = Basis(self.chunks["B"], axes, h.count // lanes, h.step)
                axes = axes[:-1] + [Axis("index", basis.rank)]
                if classes is not None:
                    rows = np.isin(classes, (POSITIVE, NEGATIVE)).reshape(-1, lanes).any(axis=1)
                    live = np.repeat(np.where(rows, POSITIVE, MASKED), basis.rank)
            chunk = self.chunks["Q"]
            order = coding_order(axes, transforms, live)
            data = chunk.take(chunk.left(), "range-coded: coefficients")
            q = decode_coefficients(data, order, floats=h.policy != RD)
            if h.policy != RD:
                return apply_classes(inverse(q.astype(np.uint32).view(F), axes, transforms), classes)
            logs = inverse(dequantise(q, h.step, axes, transforms), axes, transforms)
            if basis is not None:
                logs = basis.synthesise(logs.reshape(-1, basis.rank)).reshape(-1)
        if h.flags & LIGHT:
            chunk = self.chunks["L"]
            at = max(i for i, axis in enumerate(h.axes) if axis.kind in ("triangles", "grid"))
            count, inner = h.axes[at].count, math.prod(axis.count for axis in h.axes[at + 1 :])
            data = chunk.take(chunk.left(), "range-coded: steps of the light")
            steps = np.array(decode_steps(data, h.count // count, inner)).reshape(-1, 1, inner)
            if h.light_step > 0:
                shifts = steps.astype(F) * h.light_step
                dark = np.zeros_like(shifts)
            else:
                half, odd = (steps >> 1).astype(F), steps % 2 == 1
                shifts = np.where(odd, F(0), half * -h.light_step)
                dark = np.where(odd, half * (-h.light_step / F(16)), F(0))
            lit, dark = ((logs.reshape(-1, count, inner) + shift).reshape(-1) for shift in (shifts, dark))
            if h.negative_bound is None:
                dark = lit if h.light_step > 0 else logs.reshape(-1)
            else:
                dark = np.where(np.repeat(steps % 2 == 1, count, 1).reshape(-1), np.minimum(dark, h.negative_bound), dark)
            logs = np.where(classes == NEGATIVE, dark, lit) if h.flags & GRIDDED and classes is not None else lit
        if h.flags & CORRECTIONS:
            chunk = self.chunks["R"]
            data = chunk.take(chunk.left(), "range-coded: corrections")
            steps = decode_coefficients(data, natural(h.count // lanes, lanes)).reshape(-1)
            logs = logs + steps.astype(F) * h.correction_step
        return apply_classes(finish(h, logs), classes)

    def decode_level(self, h, level):
        if h.flags & LEVELS:
            require("G" in self.chunks, "no levels")
            return decode_grid(h, self.classes, self.chunks.get("B"), self.chunks["G"], self.between, level)
        require(h.flags & PREDICTED and "P" in self.chunks, "no levels")
        r = self.chunks["P"]
        mesh = Shape(h.axes).mesh
        index = LevelIndex(r, mesh.level, self.lengths["P"])
        require(level < len(index.ends), "no such level")
        require(r.left() >= index.ends[level], "more of the level is needed")
        r.end = r.at + index.ends[level]
        logs, shape, plan = predicted_logs(h, self.classes, self.chunks.get("B"), r, level)
        samples = apply_classes(finish(h, logs), self.classes)
        parts = 1 << 2 * (mesh.level - level)
        samples = samples.reshape(-1, parts, shape.inner * shape.length)
        sums, counts = np.zeros((len(samples), samples.shape[2])), np.zeros((len(samples), samples.shape[2]))
        for k in range(parts):
            there = ~np.isnan(samples[:, k])
            sums = np.where(there, sums + samples[:, k].astype(np.float64), sums)
            counts += there
        with np.errstate(invalid="ignore"):
            averages = np.where(counts > 0, sums / counts, np.nan).astype(F)
        factors = index.factors(level, len(plan.representatives))
        averages = averages.reshape(-1, shape.length)
        cells = mesh.count // parts
        for row in range(len(averages)):
            block = row // (cells * shape.inner) * shape.inner + row % shape.inner
            factor = factors[plan.orbit[block]]
            if factor is not None:
                averages[row] *= factor
        return averages.reshape(-1)


# ---------------------------------------------------------------------------------------------------------------------
# The program


def dump(data):
    trace = []
    Material(data, trace=trace)
    lines, at = [], 0
    for start, end, text in sorted(trace):
        require(start == at, f"byte {at} is not explained")
        at = end
        for k in range(start, max(end, start + 1), 16):
            piece = data[k : min(k + 16, end)].hex(" ")
            lines.append(f"{k:04x}  {piece:<47}  {text if k == start else ''}".rstrip())
    require(at == len(data), f"byte {at} is not explained")
    return "\n".join(lines)


def bits(samples):
    samples = np.array(samples, F)
    samples[np.isnan(samples)] = F(np.nan)
    return samples.view(np.uint32) & np.where(np.isnan(samples), 0x7FFFFFFF, MASK).astype(np.uint32)


def damaged_files(data):
    """Files made from a good one that must be refused, and what is wrong with them."""

    def header(change):
        """With a changed header chunk and its checksum."""
        length = data[5]
        payload = bytearray(data[6 : 6 + length])
        change(payload)
        covered = bytes([len(payload)]) + bytes(payload)
        return data[:5] + covered + blake3(b"H" + covered)[:4] + data[6 + length + 4 :]

    def put(at, value):
        return lambda payload: payload.__setitem__(at, value)

    yield "a later version", data[:4] + b"\x02" + data[5:]
    yield "an unknown flag", header(lambda payload: payload.__setitem__(slice(2, 3), bytes([data[8] | 128, 4])))
    yield "an overlong integer", header(lambda payload: payload.__setitem__(slice(2, 3), bytes([data[8] | 128, 0])))
    yield "an unknown policy", header(put(1, data[7] | 7 << 5))
    yield "an unknown unit", header(put(1, data[7] | 31))
    yield "level 9", header(put(3, data[9] & 0xE0 | 9))
    yield "a byte after the header", header(lambda payload: payload.append(0))
    yield "a byte after the file", data + b"\0"
    for at in range(len(data)):
        yield f"byte {at} flipped", data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :]
    # A file cut in front of its metadata is whole.
    metadata = len(data) - 17
    for end in range(len(data)):
        if end != metadata:
            yield f"the first {end} bytes", data[:end]


def lobe_values(material):
    """The lobe at the incidences and at the centroids of the outgoing triangles, over the axes of the samples."""
    incoming, outgoing = material.header.axes[:2]
    if incoming.kind == "elevation":
        angles = [math.radians(angle) for angle in incoming.values]
        incidences = [(math.sin(angle), 0.0, math.cos(angle)) for angle in angles]
    else:
        incidences = centroids(incoming.domain, incoming.level)
    directions = centroids(outgoing.domain, outgoing.level)
    return np.array([material.lobe.value(wi, wo) for wi in incidences for wo in directions]).reshape(-1)


def check():
    golden, failed, found = os.path.join(HERE, "golden"), 0, set()
    for name in sorted(name for name in os.listdir(golden) if name.endswith(".wlm")):
        data = open(os.path.join(golden, name), "rb").read()
        base = os.path.join(golden, name[:-4])
        material = Material(data)
        h = material.header
        runs = [("samples", material.samples, base + ".f32")]
        if h.flags & PREDICTED and material.index.ends:
            # The first bytes alone are enough for the level.
            prefix = data[: material.coded_at + material.index.ends[0]]
            runs.append(("level 0", Material(prefix, level=0).samples, base + ".level0.f32"))
        if h.flags & LEVELS:
            prefix = data[: material.chunks["G"].levels_at + material.chunks["G"].levels[0][0]]
            runs.append(("level 0", Material(prefix, level=0).samples, base + ".level0.f32"))
            found.add("levels of a grid")
        if h.flags & PREDICTED:
            found.add(("model", h.found[0]))
            found |= {"symmetries"} if h.found[1] > 1 else set()
            found |= {"dead triangles"} if h.found[2] else set()
            found |= {"random access"} if h.found[3] else set()
        if h.flags & LINEAR:
            found.add("samples with signs" if h.counts[1] else "samples")
        for what, samples, path in runs:
            wanted = np.fromfile(path, "<f4")
            same = len(wanted) == len(samples) and (bits(wanted) == bits(samples)).all()
            off = 0 if same else int((bits(wanted) != bits(samples)).sum()) if len(wanted) == len(samples) else "?"
            print(f"{name}, {what}: {len(wanted)} samples, " + ("every bit" if same else f"{off} DIFFER"))
            failed += not same
        if material.lobe:
            found.add(CENTRES[material.lobe.centre])
            values, wanted = lobe_values(material), np.fromfile(base + ".lobe.f32", "<f4")
            off = float(np.max(np.abs(values - wanted) / np.maximum(wanted, 1e-30)))
            print(f"{name}, lobe at centroids: {len(wanted)} values, at most {off:.1e} off")
            failed += not off < 1e-5
        found |= set(material.chunks) | {"H"} | {POLICIES[h.policy]} | {str(t) for t in h.transforms}
    models = {("model", k) for k in range(4)}
    wanted = models | set("HVACBPGQLRXM") | set(CENTRES) | {"symmetries", "dead triangles", "conventional", "orthonormal-count", "bio-haar"}
    wanted |= {"random access", "samples", "samples with signs", "levels of a grid"}
    wanted |= {"(0, 4)", "(78, 2)", "(87, 2)"}
    for what, damaged in damaged_files(open(os.path.join(golden, DUMPED + ".wlm"), "rb").read()):
        try:
            Material(damaged)
            print(f"not refused: {what}")
            failed += 1
        except Refused:
            pass
    # Without its metadata a file whose chunk P has another length could be the prefix of another file.
    whole = open(os.path.join(golden, DUMPED + ".wlm"), "rb").read()
    whole = whole[: Material(whole).payload_end]
    right = bits(Material(whole, level=0).samples)
    for at in range(len(whole)):
        for bit in range(8):
            try:
                coarse = Material(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :], level=0)
            except Refused:
                continue
            if len(coarse.samples) != len(right) or (bits(coarse.samples) != right).any():
                print(f"bit {bit} of byte {at} flipped: other samples of level 0")
                failed += 1
    for missing in sorted(map(str, wanted - found)):
        print(f"no golden file has: {missing}")
        failed += 1
    text = open(DOCUMENT, encoding="utf-8").read()
    shown = lambda name: text.split(f"<!-- {name} -->\n```text\n")[1].split("\n```\n")[0]
    if shown("dump") != dump(open(os.path.join(golden, DUMPED + ".wlm"), "rb").read()):
        print(f"docs/container.md: the dump is not that of {DUMPED}.wlm (reader.py --dump)")
        failed += 1
    if shown("typical provenance") != TYPICAL_PROVENANCE.replace("\x01", "␁"):
        print("docs/container.md: the text that provenance is expected to look like is not that of the reader")
        failed += 1
    if shown("typical") != TYPICAL:
        print("docs/container.md: the text that metadata is expected to look like is not that of the reader")
        failed += 1
    sys.exit(1 if failed else 0)


def main(arguments):
    if arguments == ["--check"]:
        check()
    elif len(arguments) == 2 and arguments[0] == "--dump":
        print(dump(open(arguments[1], "rb").read()))
    elif arguments:
        material = Material(open(arguments[0], "rb").read())
        samples = material.samples.reshape(material.header.shape)
        print(samples.shape, material.metadata or "")
        if len(arguments) > 1:
            np.save(arguments[1], samples)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
