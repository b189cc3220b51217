#!/usr/bin/env python3
"""Compares the reader of RGL tensor files with another implementation, Mitsuba's `measured` BSDF.

    rgl_mitsuba.py EXAMPLE [--pairs N]      EXAMPLE is the built example program `rgl`
    rgl_mitsuba.py --golden OUT.json        writes the golden values of the tiny fixtures

Needs numpy and mitsuba (`python3 -m pip install numpy mitsuba`; variants scalar_rgb and scalar_spectral). It makes
files of every kind (rgl_make.py), draws N (10,000) pairs of directions in the upper hemisphere, and compares f · cos:
every value must agree to 1e-5 relative. Exit code 0 if all do, 1 if not, 2 if something is missing.
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
    print(f"rgl_mitsuba.py: {error}; install numpy and mitsuba: python3 -m pip install numpy mitsuba", file=sys.stderr)
    sys.exit(2)

sys.path.insert(0, str(Path(__file__).parent))
import rgl_make  # noqa: E402

TOLERANCE = 1e-5


def pairs(count, seed):
    """Unit vectors in f32, uniform in solid angle, no nearer to the horizon than 0.6 degrees."""
    random = np.random.default_rng(seed)
    z = random.uniform(0.01, 1, (count, 2))
    phi = random.uniform(-np.pi, np.pi, (count, 2))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1).astype(np.float32)


def pairs_for(path, count, seed):
    """Mitsuba 3.9.1 leaves the symmetry of files with one or two azimuths uninitialised, and may turn or mirror both
    directions for it. One azimuth does not mind; with two, only incident directions that it leaves alone are
    compared."""
    directions = pairs(count, seed)
    if path.stem.startswith("two-azimuths"):
        directions[:, 0, :2] = -np.abs(directions[:, 0, :2])
    return directions


def mitsuba_values(path, directions, wavelengths):
    """f · cos [pair, channel] by Mitsuba, in f32."""
    mi.set_variant("scalar_rgb" if wavelengths is None else "scalar_spectral")
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    context = mi.BSDFContext()
    channels = 3 if wavelengths is None else len(wavelengths)
    found = np.empty((len(directions), channels))
    for k, (wi, wo) in enumerate(directions.tolist()):
        si = mi.SurfaceInteraction3f()
        si.wi = wi
        for first in range(0, channels, 4):
            if wavelengths is not None:
                # The last four wavelengths again where fewer are left.
                first = min(first, channels - 4)
                si.wavelengths = [float(w) for w in wavelengths[first : first + 4]]
            value = list(bsdf.eval(context, si, mi.Vector3f(wo)))
            found[k, first : first + len(value)] = value
            if wavelengths is None:
                break
    return found


def our_values(example, path, directions):
    text = "\n".join(" ".join(repr(float(x)) for x in pair.ravel()) for pair in directions)
    done = subprocess.run([example, path], input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{example} {path}: {done.stderr.strip()}")
    return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])


def cosines(directions):
    wo = directions[:, 1].astype(np.float64)
    return (wo[:, 2] / np.linalg.norm(wo, axis=1))[:, None]


def compare(example, count):
    failed = False
    with tempfile.TemporaryDirectory() as directory:
        for seed, path in enumerate(rgl_make.write_all(directory)):
            fields = dict(rgl_make.kinds())[path.stem]
            directions = pairs_for(path, count, seed)
            expected = mitsuba_values(path, directions, fields.get("wavelengths"))
            found = our_values(example, path, directions) * cosines(directions)
            error = np.abs(found / expected - 1)
            good = bool(np.all(np.isfinite(expected)) and error.max() <= TOLERANCE)
            failed |= not good
            print(
                f"{path.stem:36} {found.shape[0]} pairs x {found.shape[1]:2}: relative difference at most {error.max():.1e}, "
                f"99.9 % {np.quantile(error, 0.999):.1e}, mean {error.mean():.1e}{'' if good else '   TOO LARGE'}",
                flush=True,
            )
    print(f"mitsuba {mi.__version__}: {'DISAGREES' if failed else f'all agree to {TOLERANCE}'}")
    return 1 if failed else 0


def golden(out):
    """Values of the tiny fixtures, for the tests that run without Mitsuba."""
    fixtures = Path(__file__).resolve().parent.parent / "fixtures" / "rgl"
    cases = []
    for seed, path in enumerate(rgl_make.write_all(fixtures, tiny=True)):
        fields = dict(rgl_make.kinds(tiny=True))[path.stem]
        directions = pairs(40, 1000 + seed)
        values = mitsuba_values(path, directions, fields.get("wavelengths")) / cosines(directions)
        cases.append(
            {
                "file": path.name,
                "wavelengths": None if "rgb" in fields else fields["wavelengths"].astype(float).tolist(),
                "pairs": directions.reshape(-1, 6).astype(float).tolist(),
                "brdf": [[float(f"{v:.7g}") for v in row] for row in values],
            }
        )
    text = json.dumps({"made_by": f"tests/formats/rgl_mitsuba.py with mitsuba {mi.__version__}", "cases": cases})
    Path(out).write_text(text.replace('{"file"', '\n{"file"').replace('], [', '],\n[') + "\n")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--golden", out]:
            golden(out)
        case [example]:
            sys.exit(compare(example, 10_000))
        case [example, "--pairs", count]:
            sys.exit(compare(example, int(count)))
        case _:
            print(__doc__, file=sys.stderr)
            sys.exit(2)
