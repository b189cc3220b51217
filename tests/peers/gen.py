#!/usr/bin/env python3
"""Deterministic synthetic measurements: float32 arrays (.npy) with their side-cars (.axes.json), numpy only.

Usage: gen.py DIRECTORY [NAME...]

They are analytic reflectances, luminaires and phase functions in the sizes of [CPB06] (BRDF 16 x 1024 x 75, EDF
2048 x 91, phase function 2048 x 2048), on the bundled spectra. Triangle order: base octants 0..3 = (+z; x,y) (+z; y,-x)
(+z; -x,-y) (+z; -y,x), 4..7 the same with -z. A triangle (v0,v1,v2) has children 0:(v0,m01,m02) 1:(m01,v1,m12)
2:(m02,m12,v2) 3:(m12,m02,m01), midpoints pushed onto the sphere; index = base*4^L + child_1*4^(L-1) + ... + child_L.
A sample is the value at the triangle's normalised centroid.
"""
import csv
import json
import os
import sys

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
X, Y, Z = np.eye(3)
BASE = [(Z, X, Y), (Z, Y, -X), (Z, -X, -Y), (Z, -Y, X), (-Z, X, Y), (-Z, Y, -X), (-Z, -X, -Y), (-Z, -Y, X)]
BRDF_AXES = ["hemi:1", "hemi:4", "lambda:380:5:75"]
EDF_AXES = ["sphere:4", "lambda:380:5:91"]
PHASE_AXES = ["sphere:4", "sphere:4"]


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def centres(level, full):
    """Normalised centroids of the triangles of a mesh, in order."""
    tri = np.array([list(t) for t in BASE[: 8 if full else 4]])
    for _ in range(level):
        a, b, c = tri[:, 0], tri[:, 1], tri[:, 2]
        ab, bc, ac = unit(a + b), unit(b + c), unit(a + c)
        children = [[a, ab, ac], [ab, b, bc], [ac, bc, c], [bc, ac, ab]]
        tri = np.stack([np.stack(child, 1) for child in children], 1).reshape(-1, 3, 3)
    return unit(tri.sum(1))


def spectrum(path, column, wavelengths):
    """A column of a bundled table at `wavelengths`; beyond the table's ends its end values hold."""
    with open(os.path.join(ROOT, path), newline="") as file:
        rows = list(csv.reader(file))
    at = rows[0].index(column)
    nm, values = np.array([(float(row[0]), float(row[at])) for row in rows[1:] if row[at]]).T
    return np.interp(wavelengths, nm, values)


def noisy(a, seed):
    return a * (1 + 0.003 * np.random.default_rng(seed).standard_normal(a.shape))


class Reflection:
    """BRDFs on 16 incoming x 1024 outgoing triangles x 75 wavelengths."""

    def __init__(self):
        self.nm = np.arange(380, 751, 5.0)
        self.n = 1.46 + 0.0085 / (self.nm / 1000) ** 2
        self.wi, self.wo = centres(1, False), centres(4, False)
        self.ci, self.co = self.wi[:, 2][:, None], self.wo[:, 2][None, :]
        self.h = unit(self.wi[:, None] + self.wo[None])
        self.cd = (self.wi[:, None] * self.h).sum(-1)

    def patch(self, name):
        return spectrum("data/colorchecker_n_ohta.csv", name, self.nm)

    def fresnel(self):
        c = self.cd[..., None]
        g = np.sqrt(self.n**2 + c**2 - 1)
        return 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)

    def ggx(self, alpha):
        d = alpha**2 / (np.pi * (self.h[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
        shadow = lambda c: (-1 + np.sqrt(1 + alpha**2 * (1 / c**2 - 1))) / 2
        g = 1 / (1 + shadow(self.ci) + shadow(self.co))
        return (d * g / (4 * self.ci * self.co))[..., None] * self.fresnel()

    def oren(self, sigma):
        a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
        b = 0.45 * sigma**2 / (sigma**2 + 0.09)
        ti, to = np.arccos(self.ci), np.arccos(self.co)
        phi = np.arctan2(self.wi[:, 1], self.wi[:, 0])[:, None] - np.arctan2(self.wo[:, 1], self.wo[:, 0])[None]
        return a + b * np.maximum(0, np.cos(phi)) * np.sin(np.maximum(ti, to)) * np.tan(np.minimum(ti, to))

    def gloss_clean(self):
        red = self.patch("red") / np.pi
        return np.broadcast_to(red[None, None], (16, 1024, 75)) + self.ggx(0.15)

    def spectralon(self):
        white = 0.985 - 0.02 * np.exp(-(((self.nm - 380) / 40) ** 2))
        return white / np.pi * self.oren(0.25)[..., None] + 0.02 * self.ggx(0.5)

    def wood(self):
        return self.patch("light skin") / np.pi * self.oren(0.35)[..., None] * 0.9 + self.ggx(0.35)

    def velvet(self):
        purple, cosine = self.patch("purple"), self.wi @ self.wo.T
        hg = lambda g: (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
        fuzz = (1 - np.exp(-0.3 * (1 / self.ci + 1 / self.co))) / (self.ci + self.co)
        fuzz = fuzz * (0.6 * hg(0.55) + 0.4 * hg(-0.3))
        return 0.25 * purple / np.pi + fuzz[..., None] * (0.35 * np.sqrt(purple))

    def aniso(self):
        """No symmetry of the mesh: anisotropic GGX, tangent frame turned by 23 degrees, normal tilted by 4."""
        tilt, turn = np.radians(4), np.radians(23)
        n = np.array([np.sin(tilt) * 0.6, np.sin(tilt) * 0.8, np.cos(tilt)])
        t = np.array([np.cos(turn), np.sin(turn), 0])
        t = unit(t - n * (t @ n))
        b = np.cross(n, t)
        ax, ay = 0.10, 0.30
        hx, hy, hn = self.h @ t, self.h @ b, self.h @ n
        d = 1 / (np.pi * ax * ay * ((hx / ax) ** 2 + (hy / ay) ** 2 + hn**2) ** 2)
        slope = lambda w: ((ax * (w @ t)) ** 2 + (ay * (w @ b)) ** 2) / np.maximum(w @ n, 0.02) ** 2
        shadow = lambda w: (-1 + np.sqrt(1 + slope(w))) / 2
        g = 1 / (1 + shadow(self.wi)[:, None] + shadow(self.wo)[None])
        diffuse = self.patch("blue sky") / np.pi * self.oren(0.2)[..., None]
        return diffuse + (d * g / (4 * self.ci * self.co))[..., None] * self.fresnel()


class Emission:
    """EDFs on 2048 triangles x 91 wavelengths."""

    def __init__(self):
        self.nm = np.arange(380, 831, 5.0)
        self.s = centres(4, True)

    def lobe(self, axis, exponent, peak):
        return peak * np.maximum(0, self.s @ unit(np.array(axis, float))) ** exponent

    def lobes(self):
        down = [[np.cos(a) * np.sin(0.6), np.sin(a) * np.sin(0.6), -np.cos(0.6)] for a in np.arange(4) * np.pi / 2]
        side = [([0, 0, -1], 3, 350), ([0.5, 0, 1], 10, 260), ([-0.5, 0, 1], 10, 260), ([0, 0.9, 0.3], 40, 150)]
        return 8 + sum(self.lobe(axis, 18, 900) for axis in down) + sum(self.lobe(*one) for one in side)

    def d65(self):
        light = spectrum("data/illuminant_D65.csv", "D65", self.nm)
        return self.lobes()[:, None] * (light / light.max())

    def f11(self):
        """A cut-off downlight: zero above about 87 degrees, with a spiky spectrum."""
        light = spectrum("tests/fixtures/spectra/illuminants_FL.csv", "FL11", self.nm)
        i = self.lobe([0, 0, -1], 2, 500) + self.lobe([1, 0.2, -1], 25, 700) + self.lobe([-1, -0.2, -1], 25, 700)
        return (i * np.clip((-self.s[:, 2] - 0.05) / 0.12, 0, 1))[:, None] * (light / light.max())

    def led(self):
        blue = np.exp(-0.5 * ((self.nm - 452) / 9) ** 2)
        phosphor = np.exp(-0.5 * ((self.nm - 570) / 58) ** 2)
        u = np.clip(-self.s[:, 2], 0, 1)[:, None]
        return self.lobes()[:, None] * (blue * (0.55 + 0.45 * u) + phosphor * (1.05 - 0.35 * u**2) + 0.004)


def schlick(share, k1, k2):
    s = centres(4, True)
    mu = np.clip(s @ s.T, -1, 1)
    lobe = lambda k: (1 - k**2) / (4 * np.pi * (1 - k * mu) ** 2)
    return share * lobe(k1) + (1 - share) * lobe(k2)


def rayleigh():
    s = centres(4, True)
    return 3 / (16 * np.pi) * (1 + np.clip(s @ s.T, -1, 1) ** 2)


ARRAYS = {
    "brdf_gloss": ("brdf", BRDF_AXES, lambda: noisy(Reflection().gloss_clean(), 1)),
    "brdf_gloss_clean": ("brdf", BRDF_AXES, lambda: Reflection().gloss_clean()),
    "brdf_spectralon": ("brdf", BRDF_AXES, lambda: noisy(Reflection().spectralon(), 2)),
    "brdf_wood": ("brdf", BRDF_AXES, lambda: noisy(Reflection().wood(), 3)),
    "brdf_velvet": ("brdf", BRDF_AXES, lambda: noisy(Reflection().velvet(), 4)),
    "brdf_aniso": ("brdf", BRDF_AXES, lambda: noisy(Reflection().aniso(), 6)),
    "edf_d65": ("edf", EDF_AXES, lambda: Emission().d65()),
    "edf_f11": ("edf", EDF_AXES, lambda: Emission().f11()),
    "edf_led": ("edf", EDF_AXES, lambda: noisy(Emission().led(), 5)),
    "phase_rayleigh": ("phase", PHASE_AXES, rayleigh),
    "phase_hazy": ("phase", PHASE_AXES, lambda: schlick(0.12, -0.50, 0.70)),
    "phase_murky": ("phase", PHASE_AXES, lambda: schlick(0.19, -0.65, 0.91)),
}


def generate(directory, name):
    """Writes one array and its side-car; returns the array's path."""
    quantity, axes, make = ARRAYS[name]
    os.makedirs(directory, exist_ok=True)
    path = os.path.join(directory, name + ".npy")
    np.save(path, np.ascontiguousarray(make(), np.float32))
    with open(os.path.join(directory, name + ".axes.json"), "w") as file:
        json.dump({"quantity": quantity, "axes": axes, "sampling": "point"}, file)
    return path


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[2])
    for chosen in sys.argv[2:] or ARRAYS:
        made = generate(sys.argv[1], chosen)
        array = np.load(made, mmap_mode="r")
        print(f"{chosen:18s} {str(array.shape):16s} {array.nbytes / 1e6:6.2f} MB  {array.min():.4g} to {array.max():.4g}")
