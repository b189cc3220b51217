#!/usr/bin/env python3
"""Compresses surfaces of known truth that were measured at a few incidences, and compares what is evaluated between
them.

    between.py BINARY [--all] [--measured] [--before OTHER] [--draw]

Each surface is averaged over the 16,384 triangles of level 6, at eight incidences as in the RGL database or at steps of
10 degrees, compressed to er(L2) 0.2 %, and evaluated between these incidences: near the mirror direction (within 20
degrees, no further than 80 degrees from the normal) and over all directions to 80 degrees. The picture docs/between.svg
is compared with what comes out. --all takes all surfaces at both, not three; --measured puts Mitsuba's `measured`
beside them, on a file with the values of the surface itself at the same incidences; OTHER is a program of another
version, whose errors are stated, too, and over all directions are not to be exceeded by a tenth; --draw draws the
picture again and does nothing else. Needs numpy and mitsuba. Exit code 0 if everything is within its bound and the
picture is up to date, 1 if not.
"""
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path += [os.path.join(ROOT, "tests", "container"), os.path.join(ROOT, "tests", "formats")]
from pictures import keep  # noqa: E402
from reader import HEMISPHERE, on_sphere  # noqa: E402

LEVEL = 6
# The error of the samples that compression may make.
ER_L2 = 0.002
LEAST_COSINE = 1e-3
POINTS = 4000


def dot(a, b):
    return np.sum(a * b, axis=-1)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def ggx(alpha, f0):
    """GGX with height-correlated masking and Schlick's Fresnel factor."""

    def f(wi, wo):
        h = unit(wi + wo)
        ci, co = np.maximum(wi[..., 2], LEAST_COSINE), np.maximum(wo[..., 2], LEAST_COSINE)
        aa = alpha * alpha
        d = aa / (np.pi * (h[..., 0] ** 2 + h[..., 1] ** 2 + aa * h[..., 2] ** 2) ** 2)
        masking = lambda c: 0.5 * (np.sqrt(1 + aa * (1 / (c * c) - 1)) - 1)
        fresnel = f0 + (1 - f0) * (1 - dot(wi, h)) ** 5
        return d * fresnel / (1 + masking(ci) + masking(co)) / (4 * ci * co)

    return f


def over_base(lobe, base):
    return lambda wi, wo: lobe(wi, wo) + base / np.pi


def ward(wi, wo):
    alpha, h = 0.15, unit(wi + wo)
    slope = 1 / np.maximum(h[..., 2], LEAST_COSINE) ** 2 - 1
    cosines = np.maximum(wi[..., 2], LEAST_COSINE) * np.maximum(wo[..., 2], LEAST_COSINE)
    return np.exp(-slope / alpha**2) / (4 * np.pi * alpha**2 * np.sqrt(cosines)) + 0.05


def phong(wi, wo):
    mirror = wi[..., 2] * wo[..., 2] - wi[..., 0] * wo[..., 0] - wi[..., 1] * wo[..., 1]
    return 62 / (2 * np.pi) * np.maximum(mirror, 0) ** 60 + 0.02


def conductor(wi, wo):
    """GGX with the Fresnel equations of a conductor."""
    n, k, c = 0.2, 3.5, np.clip(dot(wi, unit(wi + wo)), 0, 1)
    ss = 1 - c * c
    t = n * n - k * k - ss
    ab = np.sqrt(t * t + 4 * n * n * k * k)
    a = np.sqrt(np.maximum(0.5 * (ab + t), 0))
    rs = (ab + c * c - 2 * a * c) / (ab + c * c + 2 * a * c)
    rp = rs * (c * c * ab + ss * ss - 2 * a * c * ss) / (c * c * ab + ss * ss + 2 * a * c * ss)
    return ggx(0.15, 1.0)(wi, wo) * 0.5 * (rs + rp)


def two_lobes(wi, wo):
    return ggx(0.08, 0.3)(wi, wo) + ggx(0.4, 0.3)(wi, wo)


def retro(wi, wo):
    """A lobe about the direction back to the source, over a base."""
    return 0.05 + 0.4 * np.exp(-(1 - dot(wi, wo)) / 0.02)


SURFACES = {
    **{f"metal {alpha}": ggx(alpha, 0.9) for alpha in (0.05, 0.15, 0.3)},
    **{f"dielectric {alpha}": over_base(ggx(alpha, 0.04), 0.3) for alpha in (0.05, 0.15, 0.3)},
    "Ward 0.15": ward,
    "Phong 60": phong,
    "conductor": conductor,
    "two lobes": two_lobes,
    "retro-reflector": retro,
}
RGL = [90 * (0.95 * i / 7) ** 2 for i in range(8)]
TENS = [10.0 * i for i in range(9)]
# Between the incidences: 24 elevations equal in the cosine from 1 to 0.17; half way.
ASKED = {
    "RGL": (RGL, [float(np.degrees(np.arccos(1 - 0.83 * (k + 0.5) / 24))) for k in range(24)]),
    "10 degrees": (TENS, [t + 5 for t in TENS[:-1]]),
}
# Bounds in % near the mirror direction.
BOUNDS = {
    ("RGL", "metal 0.05"): 1.5, ("RGL", "metal 0.15"): 1.5, ("RGL", "metal 0.3"): 1.5,
    ("RGL", "dielectric 0.05"): 3.0, ("RGL", "dielectric 0.15"): 3.0, ("RGL", "dielectric 0.3"): 3.0,
    ("10 degrees", "metal 0.05"): 0.5, ("10 degrees", "metal 0.15"): 0.5, ("10 degrees", "metal 0.3"): 0.5,
    ("10 degrees", "dielectric 0.05"): 1.5, ("10 degrees", "dielectric 0.15"): 1.5, ("10 degrees", "dielectric 0.3"): 1.5,
    ("10 degrees", "Ward 0.15"): 3.0, ("10 degrees", "Phong 60"): 3.0, ("10 degrees", "conductor"): 3.0,
    ("10 degrees", "two lobes"): 3.0, ("10 degrees", "retro-reflector"): 5.0,
}
# Over all directions, as a multiple of the error before.
OVER_ALL = 1.1
# Largest error of an incidence's light, half way between others at steps of 10 degrees, in %; more for lobes that no
# divisor fits.
LIGHT = 0.3
UNLIKE = {"Ward 0.15": 1.2, "Phong 60": 1.0, "two lobes": 0.9}
# The picture's surface and incidences, which are among the quick ones.
PICTURE, PICTURED = "between.svg", ("RGL", "metal 0.15")
QUICK = [PICTURED, ("RGL", "dielectric 0.05"), ("10 degrees", "metal 0.15")]


def towards(degrees):
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def cells():
    """Centroids of the sixteen parts of each triangle, and their areas."""
    triangles = np.array(on_sphere(HEMISPHERE, LEVEL))[:, None]
    for _ in range(2):
        a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
        ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=-2) for part in parts], axis=1)
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    areas = 2 * np.arctan2(np.abs(dot(a, np.cross(b, c))), 1 + dot(a, b) + dot(b, c) + dot(c, a))
    return unit(a + b + c), areas


def around(axis, cosines, azimuths):
    """Directions at cosines and azimuths from an axis in the plane of azimuth 0."""
    sines = np.sqrt(1 - cosines**2)
    x, y = sines * np.cos(azimuths), sines * np.sin(azimuths)
    return np.stack([x * axis[2] + cosines * axis[0], y, cosines * axis[2] - x * axis[0]], axis=-1)


def questions(elevation):
    """Outgoing directions near the mirror direction and over all to 80 degrees, evenly spread."""
    i = np.arange(POINTS)
    u, v = [(0.5 + i * step) % 1 for step in (0.754877666246693, 0.569840290998053)]
    wi = towards(elevation)
    near = around(wi * [-1, 1, 1], 1 - (1 - np.cos(np.radians(20))) * u, 2 * np.pi * v)
    everywhere = around(np.array([0.0, 0.0, 1.0]), 1 - (1 - np.cos(np.radians(80))) * u, 2 * np.pi * v)
    return wi, near[near[:, 2] >= np.cos(np.radians(80))], everywhere


def rows(wi, wo):
    """Rows of angles in degrees, turned about the normal: isotropic surfaces look alike from everywhere, cells do
    not."""
    turn = 17.0
    angles = lambda d: (np.degrees(np.arccos(np.clip(d[..., 2], -1, 1))), np.degrees(np.arctan2(d[..., 1], d[..., 0])) + turn)
    (ti, pi), (to, po) = angles(wi), angles(wo)
    return np.stack(np.broadcast_arrays(ti, pi, to, po), axis=-1).astype(np.float32)


class Material:
    """A compressed surface."""

    def __init__(self, binary, scratch, name, incidences, surface):
        self.binary, self.scratch, self.path = binary, scratch, os.path.join(scratch, name + ".wlm")
        parts, areas = CELLS
        table = [np.sum(surface(towards(t), parts) * areas, 1) / np.sum(areas, 1) for t in incidences]
        source = os.path.join(scratch, name + ".npy")
        np.save(source, np.array(table, np.float32))
        axes = [{"kind": "elevation", "values": incidences}, f"hemi:{LEVEL}"]
        with open(source.removesuffix(".npy") + ".axes.json", "w") as file:
            json.dump({"quantity": "brdf", "value_unit": "1/sr", "axes": axes}, file)
        self.report = json.loads(self.run("compress", source, "-o", self.path, "--er-l2", str(ER_L2), "--json"))

    def run(self, *arguments):
        done = subprocess.run([self.binary, *arguments], cwd=self.scratch, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"between.py: {' '.join(arguments)}: {done.stderr}")
        return done.stdout

    def values(self, wi, wo):
        asked, answers = os.path.join(self.scratch, "asked.npy"), os.path.join(self.scratch, "answers.npy")
        np.save(asked, rows(wi, wo))
        self.run("evaluate", self.path, "--directions", asked, "-o", answers)
        return np.load(answers)[:, 0].astype(float)


class Measured:
    """Mitsuba's `measured` on an RGL file with the surface's own values at the same incidences."""

    def __init__(self, scratch, incidences, surface, alpha, side=128):
        import mitsuba as mi
        from rgl_make import write_tensor

        mi.set_variant("scalar_rgb")
        columns = 256
        u = np.linspace(0, 1, columns)
        theta = u**2 * np.pi / 2
        d = lambda t: alpha**2 / (np.pi * (np.sin(t) ** 2 + alpha**2 * np.cos(t) ** 2) ** 2)
        sigma = lambda t: 0.5 * (np.cos(t) + np.sqrt(np.cos(t) ** 2 + alpha**2 * np.sin(t) ** 2))
        grids, values = [], []
        rows_of = 128
        phi = (2 * np.linspace(0, 1, rows_of) - 1) * np.pi
        for degrees in incidences:
            wi = towards(degrees)
            m = np.stack([np.sin(theta) * np.cos(phi[:, None]), np.sin(theta) * np.sin(phi[:, None]),
                          np.cos(theta) * np.ones_like(phi)[:, None]], axis=-1)
            density = np.maximum(dot(m, wi), 0) * d(theta) * np.sin(theta) * u + 1e-4
            grids.append(density.astype(np.float32))
            warp = mi.MarginalContinuous2D0(mi.TensorXf(grids[-1]))
            found = np.array([[np.array(warp.sample(mi.Point2f(float(x), float(y)))[0]) for x in np.linspace(0, 1, side)]
                              for y in np.linspace(0, 1, side)])
            t, p = found[..., 0] ** 2 * np.pi / 2, (2 * found[..., 1] - 1) * np.pi
            h = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
            wo = 2 * dot(h, wi)[..., None] * h - wi
            lit = surface(wi, wo) * np.maximum(wo[..., 2], LEAST_COSINE)
            at_wi = np.interp(np.sqrt(np.radians(degrees) * 2 / np.pi), u, sigma(theta))
            values.append((lit * 4 * at_wi / np.interp(found[..., 0], u, d(theta))).astype(np.float32))
        one = np.array(values)[None]
        fields = {
            "description": np.frombuffer(b"a surface", np.uint8),
            "phi_i": np.zeros(1, np.float32), "theta_i": np.radians(incidences).astype(np.float32),
            "ndf": np.tile(d(theta), (2, 1)).astype(np.float32), "sigma": np.tile(sigma(theta), (2, 1)).astype(np.float32),
            "vndf": np.array(grids)[None], "luminance": one, "rgb": np.repeat(one[:, :, None], 3, axis=2),
            "jacobian": np.array([1], np.uint8),
        }
        path = os.path.join(scratch, "measured.bsdf")
        write_tensor(path, fields)
        self.mi, self.bsdf = mi, mi.load_dict({"type": "measured", "filename": path})

    def values(self, wi, wo):
        context, found = self.mi.BSDFContext(), []
        for direction in wo:
            interaction = self.mi.SurfaceInteraction3f()
            interaction.wi = [float(x) for x in wi]
            found.append(float(np.array(self.bsdf.eval(context, interaction, [float(x) for x in direction]))[1]))
        return np.array(found) / wo[:, 2]


def er_l2(material, surface, elevations):
    """er(L2) in % near the mirror direction and over all directions, and the largest error of an incidence's light in
    %."""
    sums, light = [[], []], 0.0
    for elevation in elevations:
        wi, near, everywhere = questions(elevation)
        found = [material.values(wi, wo) for wo in (near, everywhere)]
        truth = [surface(wi, wo) for wo in (near, everywhere)]
        for all_errors, a, b in zip(sums, found, truth):
            all_errors.append(a / b - 1)
        # Near the mirror direction there are many points, elsewhere few: each part weighs its solid angle.
        apart = dot(everywhere, wi * [-1, 1, 1]) < np.cos(np.radians(20))
        cap, rest = 2 * np.pi * (1 - np.cos(np.radians(20))) / POINTS, 2 * np.pi * (1 - np.cos(np.radians(80))) / POINTS
        total = lambda a, b: cap * np.sum(a * near[:, 2]) + rest * np.sum((b * everywhere[:, 2])[apart])
        light = max(light, abs(100 * (total(*found) / total(*truth) - 1)))
    return [100 * np.sqrt(np.mean(np.concatenate(errors) ** 2)) for errors in sums] + [light]


def picture(material, scratch):
    """The SVG of the lobe of PICTURED half way between the last incidences: truth, material, and Mitsuba's
    `measured`."""
    _, name = PICTURED
    surface, elevation = SURFACES[name], 70.0
    angles = np.arange(40.0, 85.01, 0.5)
    wi, wo = towards(elevation), np.array([towards(-angle) for angle in angles])
    beside = Measured(scratch, RGL, surface, roughness(name))
    curves = [("the surface", "#000", surface(wi, wo)), ("the material", "#06c", material.values(wi, wo)),
              ("Mitsuba's measured", "#2a2", beside.values(wi, wo))]
    top = 1.05 * max(np.max(values) for _, _, values in curves)
    place = lambda x, y: f"{60 + (x - 40) * 12:.1f},{310 - 290 * y / top:.1f}"
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" width="640" height="360" font-family="sans-serif" font-size="13">',
             '<rect width="640" height="360" fill="#fff"/>', '<path d="M60 20V310H620" fill="none" stroke="#888"/>']
    for angle in range(40, 86, 5):
        lines.append(f'<text x="{60 + (angle - 40) * 12}" y="328" text-anchor="middle">{angle}</text>')
    lines.append('<text x="340" y="350" text-anchor="middle">outgoing angle in the plane of incidence, degrees</text>')
    lines.append('<text x="18" y="170" transform="rotate(-90 18 170)" text-anchor="middle">BRDF, 1/sr</text>')
    for row, (label, colour, values) in enumerate(curves):
        points = " ".join(place(x, y) for x, y in zip(angles, values))
        dashes = ' stroke-dasharray="6 4"' if row else ""
        lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{dashes}/>')
        lines.append(f'<path d="M80 {40 + 20 * row}h30" stroke="{colour}" stroke-width="2"{dashes}/>')
        lines.append(f'<text x="116" y="{44 + 20 * row}">{label}</text>')
    return "\n".join(lines + ["</svg>"]) + "\n"


def after(arguments, option):
    """The argument after an option; None without it."""
    return arguments[arguments.index(option) + 1] if option in arguments else None


def roughness(name):
    """The roughness by which `measured` spreads its samples."""
    last = name.split()[-1]
    return float(last) if last.startswith("0.") else 0.15


def main():
    arguments = sys.argv[1:]
    if not arguments:
        sys.exit(__doc__)
    binary, failed = os.path.abspath(arguments[0]), []
    other = after(arguments, "--before")
    other = other and os.path.abspath(other)
    has_measured = "--measured" in arguments
    with tempfile.TemporaryDirectory() as scratch:
        if "--draw" in arguments:
            material = Material(binary, scratch, "now", RGL, SURFACES[PICTURED[1]])
            keep(PICTURE, picture(material, scratch), True, "")
            return 0
        names = ["near the mirror", *["before"] * bool(other), *["`measured`"] * has_measured]
        names += ["all directions", *["before"] * bool(other), "light", "left out", "estimated"]
        print(f"| incidences | surface | {' | '.join(names)} | how |\n|---|---|{'--:|' * len(names)}---|")
        for kind, (incidences, asked) in ASKED.items():
            for name, surface in SURFACES.items():
                if (kind, name) not in QUICK and "--all" not in arguments:
                    continue
                now = Material(binary, scratch, "now", incidences, surface)
                if (kind, name) == PICTURED:
                    command = f"python tests/acceptance/between.py {arguments[0]} --draw"
                    failed += filter(None, [keep(PICTURE, picture(now, scratch), False, command)])
                near, everywhere, light = er_l2(now, surface, asked)
                before = er_l2(Material(other, scratch, "before", incidences, surface), surface, asked) if other else None
                report = now.report.get("incidences") or {"left_out_er_l2": np.nan, "estimated_er_l2": np.nan, "interpolation": None}
                figures = [near, *(before or [])[:1]]
                if has_measured:
                    figures.append(er_l2(Measured(scratch, incidences, surface, roughness(name)), surface, asked)[0])
                figures += [everywhere, *(before or [])[1:2], light]
                figures += [100 * report[key] for key in ("left_out_er_l2", "estimated_er_l2")]
                how = json.dumps(report["interpolation"])
                print(f"| {kind} | {name} | {' | '.join(f'{figure:.2f}' for figure in figures)} | {how} |", flush=True)
                if near > BOUNDS.get((kind, name), np.inf):
                    failed.append(f"{kind}, {name}: {near:.2f} % near the mirror direction, at most {BOUNDS[kind, name]} %")
                if before and everywhere > OVER_ALL * before[1] + 0.05:
                    failed.append(f"{kind}, {name}: {everywhere:.2f} % over all directions, before {before[1]:.2f} %")
                most = UNLIKE.get(name, LIGHT)
                if kind != "RGL" and light > most:
                    failed.append(f"{kind}, {name}: {light:.2f} % of an incidence's light is missing or too much, at most {most} %")
    for message in failed:
        print(f"FAILED  {message}")
    return 1 if failed else 0


CELLS = cells()
if __name__ == "__main__":
    sys.exit(main())
