#!/usr/bin/env python3
"""Renders exported RGL files with Mitsuba 3 and compares the pictures with the materials' own evaluation.

    rgl_render.py WAVELUME EXAMPLE [--quick]      the built program, and the built example program `rgl`

A sphere under three distant lights, 64 x 64 pixels from an orthographic camera, `scalar_spectral`, one narrow band at
a time. The same pixels are summed here over 4 x 4 places each, every value evaluated by wavelume on the compressed
material. Mitsuba hands `measured` the direction to the camera as `wi`, so that is what `wi` is here. The mean
difference of the pixels must be at most 0.5 % of their mean. A diffuse sphere rendered the same way shows what the
picture of a known material differs by, and gives the one factor between the two scales. --quick leaves out the
anisotropic surface. Needs numpy and mitsuba. Exit code 0 if all hold, 1 if not, 2 if something is missing.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import mitsuba as mi
    import numpy as np
except ImportError as error:
    print(f"rgl_render.py: {error}; install numpy and mitsuba: python3 -m pip install numpy mitsuba", file=sys.stderr)
    sys.exit(2)

SIZE = 64
# Places along a side of a pixel here, samples of a pixel there.
PLACES, SAMPLES = 4, 16
TOLERANCE = 0.005
BANDS = [450.0, 650.0]
# Width of a band in nm: spectra have kinks at their samples, which a wide band would average.
WIDTH = 0.1
LIGHTS = np.array([[0.3, 0.4, 1.0], [-0.8, 0.1, 0.5], [0.2, -0.7, 0.6]])
LIGHTS /= np.linalg.norm(LIGHTS, axis=1, keepdims=True)
ALBEDO = 0.5

MATERIALS = {
    "isotropic": {
        "model": {"sum": [
            {"lobe": {"lambert": {"reflectance": "red"}}},
            {"lobe": {"ggx": {"alpha": {"isotropic": 0.35}, "fresnel": {"cauchy": {"a": 1.46, "b": 0.0085}}}}},
        ]},
        "axes": [{"kind": "elevation", "values": [0, 10, 20, 30, 40, 50, 60, 70, 80, 88]}, "hemi:5", "lambda:400:50:7"],
    },
    "anisotropic": {
        "model": {"sum": [
            {"lobe": {"lambert": {"reflectance": "red"}}},
            {"lobe": {"ggx": {"alpha": {"anisotropic": [0.5, 0.3]}, "fresnel": {"cauchy": {"a": 1.46, "b": 0.0085}}}}},
        ]},
        "axes": ["hemi:3", "hemi:4", "lambda:400:50:7"],
    },
}


def scene(bsdf, wavelength, light):
    """`bsdf` on a unit sphere, seen along -z; one light, so that none is drawn among several."""
    transform = mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])
    band = {"type": "irregular", "wavelengths": f"{wavelength - WIDTH / 2}, {wavelength + WIDTH / 2}", "values": "1, 1"}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "orthographic",
            "to_world": transform,
            "film": {"type": "specfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "band": band},
            "sampler": {"type": "stratified", "sample_count": SAMPLES},
        },
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "light": {
            "type": "directional",
            "direction": [float(-x) for x in light],
            "irradiance": {"type": "irregular", "wavelengths": "300, 900", "values": "1, 1"},
        },
    })


def render(bsdf, wavelength):
    """The sum of the pictures under each light."""
    pictures = [mi.render(scene(bsdf, wavelength, light), spp=SAMPLES) for light in LIGHTS]
    return sum(np.array(picture, dtype=np.float64).reshape(SIZE, SIZE, -1)[:, :, 0] for picture in pictures)


def frames():
    """Points at which the rays of all places meet the sphere, [place, xyz], and the frame there: s along the parallel,
    t, n."""
    at = (np.arange(SIZE * PLACES) + 0.5) / (SIZE * PLACES) * 2 - 1
    # The camera looks along -z with y up: x grows to the right, where pixels count from the left; rows from the top.
    x, y = np.meshgrid(at, -at)
    inside = x * x + y * y < 1
    n = np.stack([x[inside], y[inside], np.sqrt(1 - x[inside] ** 2 - y[inside] ** 2)], axis=1)
    s = np.stack([-n[:, 1], n[:, 0], np.zeros(len(n))], axis=1)
    s /= np.maximum(np.linalg.norm(s, axis=1, keepdims=True), 1e-12)
    return inside, n, s, np.cross(n, s)


def check_frames(bsdf):
    """The camera and the frame are Mitsuba's."""
    made = scene(bsdf, 550.0, LIGHTS[0])
    random = np.random.default_rng(5)
    worst = 0.0
    for u, v in random.uniform(0, 1, (200, 2)):
        ray, _ = made.sensors()[0].sample_ray(0.0, 0.5, mi.Point2f(u, v), mi.Point2f(0.5, 0.5))
        hit = made.ray_intersect(mi.Ray3f(ray))
        x, y = 2 * u - 1, 1 - 2 * v
        if not hit.is_valid():
            assert x * x + y * y > 0.99, (x, y)
            continue
        n = np.array([x, y, np.sqrt(max(1 - x * x - y * y, 0))])
        s = np.array([-y, x, 0]) / np.hypot(x, y)
        # At the rim z changes faster than f32 follows.
        if n[2] > 0.1:
            worst = max(worst, np.abs(np.array(hit.sh_frame.n) - n).max(), np.abs(np.array(hit.sh_frame.s) - s).max())
    assert worst < 1e-3, f"the frames differ by {worst}"


def ours(example, path, n, s, t):
    """Radiance [place, band] of the material in `path`, lights of irradiance 1."""
    frame = lambda d: np.stack([s @ d, t @ d, n @ d], axis=1)
    view = frame(np.array([0.0, 0.0, 1.0]))
    total = np.zeros((len(n), len(BANDS)))
    columns = [round((band - 400) / 50) for band in BANDS]
    for light in LIGHTS:
        wo = frame(light)
        lit = (wo[:, 2] > 0) & (view[:, 2] > 0)
        text = "\n".join("%.9g %.9g %.9g %.9g %.9g %.9g" % (*a, *b) for a, b in zip(view[lit], wo[lit]))
        done = subprocess.run([example, path], input=text, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{example} {path}: {done.stderr.strip()}")
        values = np.array(done.stdout.split(), dtype=np.float64).reshape(lit.sum(), -1)[:, columns]
        total[lit] += values * wo[lit, 2:]
    return total


def picture(inside, values):
    """The mean over the places of each pixel."""
    whole = np.zeros(inside.shape)
    whole[inside] = values
    return whole.reshape(SIZE, PLACES, SIZE, PLACES).mean(axis=(1, 3))


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout


def main(wavelume, example, is_quick):
    mi.set_variant("scalar_spectral")
    inside, n, s, t = frames()
    diffuse = {"type": "diffuse", "reflectance": {"type": "uniform", "value": ALBEDO}}
    check_frames(diffuse)
    known = picture(inside, ALBEDO / np.pi * np.maximum(n @ LIGHTS.T, 0).sum(axis=1))
    scales = []
    for band in BANDS:
        found = render(diffuse, band)
        scales.append(known.mean() / found.mean())
        difference = np.abs(found * scales[-1] - known).mean() / known.mean()
        print(f"diffuse      {band:.0f} nm: scale {scales[-1]:.6g}, mean difference {100 * difference:.3f} %", flush=True)
    failed = False
    with tempfile.TemporaryDirectory() as directory:
        for name, document in list(MATERIALS.items())[: 1 if is_quick else None]:
            source, material, exported = (Path(directory) / f"{name}.{e}" for e in ("json", "wlm", "bsdf"))
            source.write_text(json.dumps({"wavelume": "virtual", "quantity": "brdf", "name": name, **document}))
            run(wavelume, "compress", source, "-o", material, "--er-l2", "0.005")
            report = json.loads(run(wavelume, "export", material, "--format", "rgl", "-o", exported, "--json"))
            error = report["error"]
            print(f"{name:12} {report['resolution']}, {report['bytes']:,} bytes: er(L2) {100 * error['er_l2']:.3f} %,"
                  f" er(L1) {100 * error['er_l1']:.3f} %", flush=True)
            wanted = ours(example, material, n, s, t)
            for k, band in enumerate(BANDS):
                found = render({"type": "measured", "filename": str(exported)}, band) * scales[k]
                expected = picture(inside, wanted[:, k])
                difference = np.abs(found - expected).mean() / expected.mean()
                total = found.mean() / expected.mean() - 1
                good = difference <= TOLERANCE
                failed |= not good
                print(f"{name:12} {band:.0f} nm: mean difference {100 * difference:.3f} %, of the mean {100 * total:+.3f} %"
                      f"{'' if good else '   TOO LARGE'}", flush=True)
    print(f"mitsuba {mi.__version__}: {'TOO FAR' if failed else f'all within {100 * TOLERANCE} %'}")
    return 1 if failed else 0


if __name__ == "__main__":
    is_quick = sys.argv[3:] == ["--quick"]
    if len(sys.argv) != 3 + is_quick:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(*sys.argv[1:3], is_quick))
