"""Other compressors of scientific arrays, each behind the same three functions: prepare, encode, decode.

`packaged` peers are what a user installs and calls; `recipe` peers are what a specialist writes in an afternoon from
packaged parts (principal components, Tucker factors, Haar trees on triangles). Whatever a peer needs travels in its
bytes, except shape and axes, which are free. A knob is continuous (about the root mean square error wanted) or a list
of steps from coarse to fine.
"""

import math
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from typing import Callable, Optional

import numpy as np

COARSE_TO_FINE_BITS = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 23]


@dataclass
class Peer:
    """One compressor. `prepare(x, axes)` is what does not depend on the knob; it is timed with the first encoding."""

    name: str
    group: str
    encode: Callable  # (x, axes, state, knob) -> bytes
    decode: Callable  # (bytes, shape, axes) -> float32 array
    steps: Optional[Callable] = None  # x -> list of knobs, coarse to fine; none = continuous
    prepare: Callable = lambda x, axes: None
    layouts: tuple = ("array", "grid")
    domains: tuple = ("linear", "log")
    slow: bool = False  # left out on arrays above the limit of run_peers.py


# ---- axes and layouts


@dataclass
class Axis:
    """An axis of an array: `triangles` with a level and 4 or 8 octants, or any other kind by its name."""

    kind: str
    level: int = 0
    octants: int = 0


def axes_of(manifest):
    """The axes of a manifest, in its short or long forms."""
    found = []
    for axis in manifest["axes"]:
        if isinstance(axis, dict):
            octants = 8 if axis.get("domain") == "sphere" else 4
            found.append(Axis(axis["kind"], axis.get("level", 0), octants if axis["kind"] == "triangles" else 0))
        elif axis.split(":")[0] in ("hemi", "sphere", "lower"):
            found.append(Axis("triangles", int(axis.split(":")[1]), 8 if axis.startswith("sphere") else 4))
        else:
            found.append(Axis("wavelength" if axis.startswith("lambda") else axis))
    return found


def rhombic_order(level, octants):
    """The order that turns a triangle axis into a 2-D grid: two octants glued along an edge make a rhombus of 2^level ×
    2^level cells of two triangles. It is what a user of image compressors would do, and costs no bytes."""
    n = 1 << level
    corners = np.array([[(0, 0), (n, 0), (0, n)]])
    for _ in range(level):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ac = (a + b) // 2, (b + c) // 2, (a + c) // 2
        children = [[a, ab, ac], [ab, b, bc], [ac, bc, c], [bc, ac, ab]]
        corners = np.stack([np.stack(child, 1) for child in children], 1).reshape(-1, 3, 2)
    count = 4**level
    key = np.empty(octants * count, np.int64)
    for octant in range(octants):
        s, t = corners[..., 0], corners[..., 1]
        u, v = (n - s - t, t) if octant % 2 == 0 else (n - s, s + t)
        i, j = u.min(1), v.min(1)
        down = (u.sum(1) + v.sum(1) - 3 * i - 3 * j) == 4
        key[octant * count : (octant + 1) * count] = ((octant // 2) * n + i) * 2 * n + 2 * j + down
    return np.argsort(key, kind="stable"), (octants // 2 * n, 2 * n)


class Layout:
    """An array as it is, or with its triangle axes (from 256 triangles) on rhombic grids."""

    def __init__(self, shape, axes, grid):
        self.shape, self.orders, out = shape, [], []
        for k, (n, axis) in enumerate(zip(shape, axes)):
            if grid and axis.kind == "triangles" and n >= 256:
                order, cells = rhombic_order(axis.level, axis.octants)
                self.orders.append((k, order, np.argsort(order)))
                out += cells
            else:
                out.append(n)
        self.out = tuple(out)

    def forward(self, x):
        for k, order, _ in self.orders:
            x = np.take(x, order, axis=k)
        return np.ascontiguousarray(x.reshape(self.out))

    def inverse(self, y):
        y = y.reshape(self.shape)
        for k, _, back in self.orders:
            y = np.take(y, back, axis=k)
        return y


def folded(shape, most, least=1):
    """The shape without axes of one element, its leading axes merged until at most `most` are left."""
    sizes = [n for n in shape if n > 1]
    while len(sizes) > most:
        sizes[:2] = [sizes[0] * sizes[1]]
    return tuple([1] * (least - len(sizes)) + sizes)


# ---- packaged


def zfp():
    import zfpy

    def steps(x):
        top = math.ceil(math.log2(float(np.abs(x).max()) or 1.0))
        return list(range(top, top - 34, -1))

    def encode(x, axes, state, exponent):
        return zfpy.compress_numpy(x.reshape(folded(x.shape, 4)), tolerance=2.0**exponent, write_header=True)

    return [Peer("zfp", "packaged", encode, lambda b, shape, axes: zfpy.decompress_numpy(b).reshape(shape), steps)]


def sz3():
    import pysz

    def peer(name, algorithm):
        def encode(x, axes, state, error):
            x = x.reshape(folded(x.shape, 4))
            config = pysz.szConfig(x.shape)
            config.errorBoundMode = pysz.szErrorBoundMode.ABS
            config.absErrorBound = float(error * 3**0.5)
            config.cmprAlgo = getattr(pysz.szAlgorithm, algorithm)
            config.openmp = False
            return bytes(pysz.sz.compress(x, config)[0])

        def decode(b, shape, axes):
            return pysz.sz.decompress(np.frombuffer(b, np.uint8), np.float32, folded(shape, 4))[0].reshape(shape)

        return Peer(name, "packaged", encode, decode)

    return [peer("sz3", "INTERP_LORENZO"), peer("sz3-lorenzo", "LORENZO_REG")]


def sperr_bytes(image, error):
    """SPERR's 2-D or 3-D bytes for about that root mean square error."""
    import imagecodecs

    span = float(image.max() - image.min()) or 1.0
    level = float(max(20 * np.log10(span / error), 1))
    chunks = tuple(image.shape) if image.ndim == 3 else None
    return bytes(imagecodecs.sperr_encode(image, level=level, mode="psnr", chunks=chunks, numthreads=1))


def sperr():
    import imagecodecs

    def encode(x, axes, state, error):
        return sperr_bytes(np.ascontiguousarray(x.reshape(folded(x.shape, 3, 2))), error)

    def decode(b, shape, axes):
        return np.asarray(imagecodecs.sperr_decode(b, numthreads=1)).reshape(shape)

    return [Peer("sperr", "packaged", encode, decode)]


def fpzip():
    import fpzip as package

    def encode(x, axes, state, bits):
        return package.compress(x.reshape(folded(x.shape, 4)), precision=bits, order="C")

    def decode(b, shape, axes):
        return package.decompress(b, order="C").reshape(shape)

    return [Peer("fpzip", "packaged", encode, decode, lambda x: list(range(9, 22)) + [24, 28, 32], domains=("linear",))]


def rounded(x, keep):
    """float32 with `keep` bits of mantissa, to nearest even."""
    if keep >= 23:
        return x
    bits, drop = x.view(np.uint32), 23 - keep
    bits = bits + (np.uint32((1 << (drop - 1)) - 1) + ((bits >> np.uint32(drop)) & np.uint32(1)))
    return (bits & np.uint32(0xFFFFFFFF ^ ((1 << drop) - 1))).view(np.float32)


def shuffled(values):
    return values.reshape(-1).view(np.uint8).reshape(-1, values.itemsize).T.tobytes()


def unshuffled(b, dtype):
    size = np.dtype(dtype).itemsize
    return np.ascontiguousarray(np.frombuffer(b, np.uint8).reshape(size, -1).T).reshape(-1).view(dtype)


def bitround_zstd():
    import zstandard

    def encode(x, axes, state, keep):
        return zstandard.ZstdCompressor(level=19).compress(shuffled(np.ascontiguousarray(rounded(x, keep))))

    def decode(b, shape, axes):
        return unshuffled(zstandard.ZstdDecompressor().decompress(b), np.float32).reshape(shape)

    steps = lambda x: COARSE_TO_FINE_BITS
    return [Peer("bitround+zstd19", "packaged", encode, decode, steps, domains=("linear",), slow=True)]


def bitround_pco():
    import imagecodecs

    def encode(x, axes, state, keep):
        return bytes(imagecodecs.pcodec_encode(rounded(x, keep), level=8))

    def decode(b, shape, axes):
        return np.asarray(imagecodecs.pcodec_decode(b, shape=shape, dtype=np.float32))

    return [Peer("bitround+pco", "packaged", encode, decode, lambda x: COARSE_TO_FINE_BITS, domains=("linear",))]


def tthresh():
    """TTHRESH is a program of its own, not on PyPI; the variable TTHRESH names it."""
    program = os.environ.get("TTHRESH", "")
    if not os.path.exists(program):
        raise ImportError("not on PyPI; build github.com/rballester/tthresh and name its program in the variable TTHRESH")

    def run(*arguments):
        subprocess.run([program, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def encode(x, axes, state, error):
        room = tempfile.mkdtemp()
        try:
            x.tofile(room + "/i")
            sizes = map(str, folded(x.shape, 9, 3)[::-1])  # the fastest axis first, whatever its message says
            run("-i", room + "/i", "-t", "float", "-s", *sizes, "-r", f"{error:.9g}", "-c", room + "/c")  # -r: RMSE
            with open(room + "/c", "rb") as file:
                return file.read()
        finally:
            shutil.rmtree(room)

    def decode(b, shape, axes):
        room = tempfile.mkdtemp()
        try:
            with open(room + "/c", "wb") as file:
                file.write(b)
            run("-c", room + "/c", "-o", room + "/o")
            return np.fromfile(room + "/o", np.float32).reshape(shape)
        finally:
            shutil.rmtree(room)

    return [Peer("tthresh", "packaged", encode, decode, slow=True)]


# ---- recipes: integers to bytes, with the smaller of two packaged entropy coders


def zigzag(a):
    u = ((a.astype(np.int64) << 1) ^ (a.astype(np.int64) >> 63)).astype(np.uint64)
    top = int(u.max(initial=0))
    return u.astype(np.uint8 if top < 256 else np.uint16 if top < 65536 else np.uint32)


def pack(a, both=True):
    """int32 array to bytes: pcodec or zstd with its width, length, payload."""
    import imagecodecs
    import zstandard

    kind, payload = 0, bytes(imagecodecs.pcodec_encode(np.ascontiguousarray(a, np.int32).reshape(-1), level=8))
    if both:
        u = zigzag(a)
        level = 19 if u.size < 2_000_000 or np.count_nonzero(u) < 100_000 else 9  # elsewhere it takes minutes
        other = zstandard.ZstdCompressor(level=level).compress(shuffled(u))
        kind, payload = (u.itemsize, other) if len(other) < len(payload) else (kind, payload)
    return bytes([kind]) + np.uint32(len(payload)).tobytes() + payload


class Reader:
    """Reads back what recipes wrote one after the other."""

    def __init__(self, b):
        self.b, self.at = b, 0

    def numbers(self, dtype, count):
        got = np.frombuffer(self.b, dtype, count, self.at)
        self.at += got.nbytes
        return got

    def blob(self):
        size = int(self.numbers(np.uint32, 1)[0])
        self.at += size
        return self.b[self.at - size : self.at]

    def integers(self, shape):
        import imagecodecs
        import zstandard

        kind, payload = int(self.numbers(np.uint8, 1)[0]), self.blob()
        if kind == 0:
            count = int(np.prod(shape))
            return np.asarray(imagecodecs.pcodec_decode(payload, shape=(count,), dtype=np.int32)).reshape(shape)
        dtype = {1: np.uint8, 2: np.uint16, 4: np.uint32}[kind]
        u = unshuffled(zstandard.ZstdDecompressor().decompress(payload), dtype).astype(np.int64)
        return ((u >> 1) ^ -(u & 1)).astype(np.int32).reshape(shape)


def dead_zone(y, step):
    q = y / np.float32(step)
    return (np.sign(q) * np.floor(np.abs(q) + np.float32(0.4))).astype(np.int32)


# ---- recipes: trees on triangles

HADAMARD = np.array(
    [[0.5, 0.5, 0.5, 0.5], [0.5, 0.5, -0.5, -0.5], [0.5, -0.5, 0.5, -0.5], [0.5, -0.5, -0.5, 0.5]], np.float32
)


def haar(x, axis, inverse):
    """Orthonormal 4-child Haar along an axis of triangles, down to the octants."""
    y = np.moveaxis(x, axis, 0).copy()
    sizes, n = [], y.shape[0]
    while n % 4 == 0 and n >= 16:
        sizes.append(n)
        n //= 4
    for n in reversed(sizes) if inverse else sizes:
        rest = y.shape[1:]
        if inverse:
            parts = np.tensordot(HADAMARD.T, y[:n].reshape((4, n // 4) + rest), 1).swapaxes(0, 1)
        else:
            parts = np.tensordot(HADAMARD, y[:n].reshape((n // 4, 4) + rest), ([1], [1]))
        y[:n] = parts.reshape((n,) + rest)
    return np.moveaxis(y, 0, axis)


def haar_wavelet():
    """The plain idea of the paper: Haar trees on directions × a 9/7 along wavelength, a dead zone, an entropy coder."""
    import warnings

    import pywt

    warnings.filterwarnings("ignore", module="pywt")

    def level(n):
        return min(4, pywt.dwt_max_level(n, "bior4.4") + 1)

    def spectral(axes, n):
        return axes[-1].kind == "wavelength" and n >= 8

    def prepare(x, axes):
        y = x
        for k, axis in enumerate(axes):
            if axis.kind == "triangles":
                y = haar(y, k, False)
        if spectral(axes, x.shape[-1]):
            y = np.concatenate(pywt.wavedec(y, "bior4.4", mode="symmetric", level=level(x.shape[-1])), -1)
        return np.moveaxis(y, -1, 0)

    def encode(x, axes, state, error):
        step = np.float32(error * 2.2)
        return step.tobytes() + pack(dead_zone(state, step))

    def decode(b, shape, axes):
        reader = Reader(b)
        step = reader.numbers(np.float32, 1)[0]
        lengths = [shape[-1]]
        if spectral(axes, shape[-1]):
            empty = np.zeros(shape[-1], np.float32)
            lengths = [c.size for c in pywt.wavedec(empty, "bior4.4", mode="symmetric", level=level(shape[-1]))]
        y = reader.integers((sum(lengths),) + tuple(shape[:-1])).astype(np.float32) * step
        y = np.moveaxis(y, 0, -1)
        if spectral(axes, shape[-1]):
            parts = np.split(y, np.cumsum(lengths)[:-1], axis=-1)
            y = pywt.waverec(parts, "bior4.4", mode="symmetric")[..., : shape[-1]].astype(np.float32)
        for k, axis in enumerate(axes):
            if axis.kind == "triangles":
                y = haar(y, k, True)
        return y

    return [Peer("haar+9/7", "recipe", encode, decode, prepare=prepare, layouts=("array",))]


# ---- recipes: principal components of the last axis


def principal(x, axes):
    """Eigenvalues, descending, and eigenvectors of MᵀM, M the array as (others × last axis); above 512 columns those of
    a random subspace of 640, with what it leaves as one more eigenvalue."""
    m = x.shape[-1]
    matrix = x.reshape(-1, m).astype(np.float64)
    n = len(matrix)
    if m <= 512:
        values, vectors = np.linalg.eigh(matrix.T @ matrix)
        return matrix, np.maximum(values[::-1], 0), vectors[:, ::-1]
    small = matrix.astype(np.float32)
    start = np.random.default_rng(0).standard_normal((m, min(640, n))).astype(np.float32)
    q = np.linalg.qr(small.T @ (small @ start))[0]
    q = np.linalg.qr(small.T @ (small @ q))[0]
    part = (small @ q).astype(np.float64)
    values, vectors = np.linalg.eigh(part.T @ part)
    values = np.maximum(values[::-1], 0)[:600]
    left = max((matrix**2).sum() - values.sum(), 0)
    return matrix, np.append(values, left), np.pad(q @ vectors[:, ::-1][:, :600], ((0, 0), (0, 1)))


def principal_components():
    """Components by reverse water-filling, a coded basis, scores refitted to it and coded three ways."""
    import imagecodecs

    def peer(name, scores, layouts):
        def encode(x, axes, state, error):
            matrix, values, vectors = state
            n, m = matrix.shape
            low, high = 0.0, values[0] / n + 1e-300
            for _ in range(80):
                water = (low + high) / 2
                if np.minimum(water, values / n).sum() > m * error * error:
                    high = water
                else:
                    low = water
            k = max(1, int((values / n > low * 1.0001).sum()))
            fine = np.sqrt(12 * 0.1 * n * error * error / (k * np.maximum(values[:k], 1e-300)))
            fine = np.minimum(fine, 0.05 / np.sqrt(m)).astype(np.float32).astype(np.float64)
            coded = np.rint(vectors[:, :k] / fine).astype(np.int32)
            basis = coded * fine
            fitted = np.linalg.solve(basis.T @ basis + 1e-9 * np.eye(k), basis.T @ matrix.T)
            out = [np.uint16(k).tobytes(), fine.astype(np.float32).tobytes(), pack(coded.T)]
            step = np.float32(np.sqrt(12 * 0.9 * low) or error)
            if scores == "sperr":
                for row in fitted:
                    image = np.ascontiguousarray(row.reshape(folded(x.shape[:-1], 3, 2)), np.float32)
                    one = sperr_bytes(image, max(np.sqrt(0.9 * low), 1e-12))
                    out.append(np.uint32(len(one)).tobytes() + one)
                return b"".join(out)
            if scores == "haar":
                step = np.float32(step * 0.9)
                planes = on_triangles(fitted.reshape((k,) + x.shape[:-1]).astype(np.float32), axes, False)
                return b"".join([*out, step.tobytes(), pack(dead_zone(planes, step))])
            rows = np.rint(fitted / step).astype(np.int32)
            return b"".join([*out, step.tobytes(), *(pack(row, both=False) for row in rows)])

        def decode(b, shape, axes):
            reader = Reader(b)
            m, n = shape[-1], int(np.prod(shape[:-1]))
            k = int(reader.numbers(np.uint16, 1)[0])
            fine = reader.numbers(np.float32, k).astype(np.float64)
            basis = reader.integers((k, m)) * fine[:, None]
            if scores == "sperr":
                planes = [np.asarray(imagecodecs.sperr_decode(reader.blob(), numthreads=1)).reshape(-1) for _ in range(k)]
                fitted = np.stack(planes)
            elif scores == "haar":
                step = reader.numbers(np.float32, 1)[0]
                planes = reader.integers((k,) + tuple(shape[:-1])).astype(np.float32) * step
                fitted = on_triangles(planes, axes, True).reshape(k, n)
            else:
                step = reader.numbers(np.float32, 1)[0]
                fitted = np.stack([reader.integers((n,)) for _ in range(k)]).astype(np.float32) * step
            return (fitted.T.astype(np.float32) @ basis.astype(np.float32)).reshape(shape)

        return Peer(name, "recipe", encode, decode, prepare=principal, layouts=layouts)

    def on_triangles(planes, axes, inverse):
        for k, axis in enumerate(axes[:-1]):
            if axis.kind == "triangles":
                planes = haar(planes, k + 1, inverse)
        return planes

    return [
        peer("pca+pco", "pco", ("array", "grid")),
        peer("pca+sperr", "sperr", ("array", "grid")),
        peer("pca+haar", "haar", ("array",)),
    ]


def plain_components():
    """Components with float16 scores and a float32 basis, not entropy coded: any spectrum is at hand."""

    def encode(x, axes, state, k):
        matrix, _, vectors = state
        basis = vectors[:, :k].astype(np.float32)
        scores = matrix.astype(np.float32) @ basis
        scale = np.abs(scores).max(0) + np.float32(1e-30)
        parts = np.uint16(k), (basis.T * scale[:, None]).astype(np.float32), (scores / scale).astype(np.float16)
        return b"".join(part.tobytes() for part in parts)

    def decode(b, shape, axes):
        reader = Reader(b)
        m, n = shape[-1], int(np.prod(shape[:-1]))
        k = int(reader.numbers(np.uint16, 1)[0])
        basis = reader.numbers(np.float32, k * m).reshape(k, m)
        return (reader.numbers(np.float16, n * k).reshape(n, k).astype(np.float32) @ basis).reshape(shape)

    def steps(x):
        return [k for k in (1, 2, 3, 4, 5, 6, 8, 10, 14, 20, 30, 45) if k <= min(x.shape[-1], x.size // x.shape[-1])]

    return [Peer("pca-f16", "recipe", encode, decode, steps, prepare=principal, layouts=("array",))]


# ---- recipes: Tucker factors of every axis, the idea of TTHRESH


def tucker():
    """Higher-order SVD, one step for the core, each factor column as fine as its slice of the core is heavy."""

    def along(y, k, matrix):
        return np.moveaxis(np.tensordot(matrix, y, ([1], [k])), 0, k)

    def prepare(x, axes):
        if max(x.shape) > 2048:
            raise ValueError(f"an axis of {max(x.shape)} is too long for its factor")
        core, factors = x.astype(np.float32), []
        for k, n in enumerate(x.shape):
            rows = np.moveaxis(core, k, 0).reshape(n, -1).astype(np.float64)
            vectors = np.linalg.eigh(rows @ rows.T)[1][:, ::-1].astype(np.float32)
            core = along(core, k, vectors.T)
            factors.append(vectors)
        return core, factors

    def fineness(core, step):
        """The step of each column of each factor, from the decoded core."""
        for k in range(core.ndim):
            norms = np.sqrt((core.astype(np.float64) ** 2).sum(tuple(a for a in range(core.ndim) if a != k)))
            yield (step / np.maximum(norms, step)).astype(np.float32)

    def encode(x, axes, state, error):
        core, factors = state
        step = np.float32(error * 3)
        q = dead_zone(core, step)
        used = np.nonzero(q)
        ranks = [int(one.max()) + 1 if one.size else 1 for one in used]
        q = q[tuple(slice(r) for r in ranks)]
        out = [step.tobytes(), np.uint16(ranks).tobytes(), pack(q)]
        for factor, r, fine in zip(factors, ranks, fineness(q.astype(np.float32) * step, step)):
            out.append(pack(np.rint(factor[:, :r] / fine).astype(np.int32).T))
        return b"".join(out)

    def decode(b, shape, axes):
        reader = Reader(b)
        step = reader.numbers(np.float32, 1)[0]
        ranks = reader.numbers(np.uint16, len(shape)).astype(int)
        core = reader.integers(tuple(ranks)).astype(np.float32) * step
        y = core
        for k, fine in enumerate(fineness(core, step)):
            y = along(y, k, (reader.integers((ranks[k], shape[k])) * fine[:, None]).T.astype(np.float32))
        return y

    return [Peer("tucker", "recipe", encode, decode, prepare=prepare)]


MAKERS = {
    "zfp": zfp,
    "sz3": sz3,
    "sperr": sperr,
    "tthresh": tthresh,
    "fpzip": fpzip,
    "bitround+zstd19": bitround_zstd,
    "bitround+pco": bitround_pco,
    "pca": principal_components,
    "pca-f16": plain_components,
    "tucker": tucker,
    "haar+9/7": haar_wavelet,
}


def installed():
    """All peers that can run here, and why the others cannot, by name."""
    peers, missing = [], {}
    for name, make in MAKERS.items():
        try:
            peers += make()
        except ImportError as why:
            missing[name] = str(why)
    return peers, missing
