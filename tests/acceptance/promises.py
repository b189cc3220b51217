#!/usr/bin/env python3
"""Compresses every gridded fixture on its own grid through the service, and compares what is evaluated there at the
file's own angles with the numbers of the file, as the readers of gridded.py have them. Of files with coarser levels,
the first bytes of the material are decoded, and the error that each level states is compared with that of evaluating it
at the same angles.

Usage: promises.py BINARY
"""
import json
import math
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import gridded

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TARGETS = [0.02, 0.01, 0.005]
FIXTURES = """
    data/aerolamp.ies data/nukit_lantern.ies data/ushio_b1.ies
    tests/fixtures/ies/examp1.ies tests/fixtures/ies/example_modules.ies
    tests/fixtures/ies/iesna2002_example_typec.ies tests/fixtures/ies/test.ies
    tests/fixtures/ldt/absolute.ldt tests/fixtures/ldt/example.ldt tests/fixtures/ldt/multiple_lamp_sets.ldt
    tests/fixtures/ldt/symmetry_to_c0c180.ldt tests/fixtures/ldt/symmetry_to_c90c270.ldt
    tests/fixtures/mbsdf/test_reflection_scalar_theta_2_phi_3.mbsdf tests/fixtures/mbsdf/test_rgb_theta_2_phi_3.mbsdf
    tests/fixtures/mbsdf/test_transmission_scalar_theta_2_phi_4.mbsdf
""".split()
# The car paint has 546,750 samples: one target shows what the small ones cannot.
LARGE = ("data/carpaint_blue.mbsdf", [0.01])
# Relative difference between the error that a level states, rounded up, and the one found.
OFF = 0.01


def tables(folder):
    """Writes the grids that no fixture states: a table of text, and an array with a manifest. Returns their paths."""
    theta_i, theta_o, phi_o = [0.0, 20.0, 45.0, 70.0], [5.0 * i for i in range(17)], [15.0 * i for i in range(13)]
    wavelengths = [450, 550, 650]

    def value(i, o, p, nm):
        away = (o - i) ** 2 + (min(o, i) * math.sin(math.radians(180 - p))) ** 2 + (0 if p > 90 else i * o)
        return 0.05 * (1 + nm / 2000) + 0.8 * math.exp(-away / 300)

    lines = ["# radiometric-csv: 1", "# quantity: brdf", "# value_unit: 1/sr", "# cosine_included: false", "# angle_unit: deg",
             "# wavelength_unit: nm", "# isotropic: true", "# phi_o_extent: mirrored",
             "theta_i,theta_o,phi_o," + ",".join(f"v{nm}" for nm in wavelengths)]
    values = []
    for i in theta_i:
        for o in theta_o:
            for p in phi_o:
                row = [np.float32(value(i, o, p, nm)) for nm in wavelengths]
                values.append(row)
                lines.append(",".join(f"{number:.9g}" for number in (i, o, p, *row)))
    text, binary = os.path.join(folder, "table.csv"), os.path.join(folder, "table.npy")
    with open(text, "w") as file:
        file.write("\n".join(lines) + "\n")
    np.save(binary, np.array(values, np.float32).reshape(len(theta_i), len(theta_o), len(phi_o), len(wavelengths)))
    angles = lambda kind, values, **more: {"kind": kind, "unit": "deg", "values": values, **more}
    manifest = {"quantity": "brdf", "value_unit": "1/sr", "cosine_included": False, "axes": [
        angles("theta_i", theta_i), angles("theta_o", theta_o), angles("phi_o", phi_o, extent="mirrored"),
        {"kind": "wavelength", "unit": "nm", "values": wavelengths}]}
    with open(binary[: -len(".npy")] + ".axes.json", "w") as file:
        json.dump(manifest, file)
    return [text, binary]


def manifest_of(path):
    """The axes beside an array; None of other files."""
    if not path.endswith(".npy"):
        return None
    with open(path[: -len(".npy")] + ".axes.json") as file:
        return json.load(file)


def check(base, path, targets):
    """The number of promises that are broken."""
    broken = 0
    for target in targets:
        whole = os.path.join(ROOT, path)
        found, allowed = gridded.promise(base, whole, target, manifest_of(whole), domain="grid")
        verdict = "ok" if found <= allowed else f"BROKEN: expected at most {100 * allowed:.4f} %"
        broken += found > allowed
        print(f"  {os.path.basename(path):<52} asked {100 * target:4.1f} %, found {100 * found:7.4f} %  {verdict}", flush=True)
    return broken


def check_phase(base, folder):
    """The number of broken promises of a phase function over the scattering angle, under light from two sides."""
    theta = [2.5 * i for i in range(73)]
    values = [(1 - 0.64) / (4 * math.pi * (1.64 - 1.6 * math.cos(math.radians(t))) ** 1.5) for t in theta]
    path, broken = os.path.join(folder, "phase.csv"), 0
    with open(path, "w") as file:
        file.write("# radiometric-csv: 1\n# quantity: phase\n# value_unit: 1/sr\n# angle_unit: deg\ntheta,value\n")
        file.writelines(f"{t},{v:.9g}\n" for t, v in zip(theta, values))
    for target in TARGETS:
        material = gridded.compress(base, path, target, domain="grid")["material"]
        # Light goes on towards -wi: the scattering angle is counted from there. The reader may scale the whole to 1.
        for wi in ((0.0, 0.0), (40.0, 0.0)):
            wo = [(abs(180.0 - t + wi[0]), 0.0) if 180.0 - t + wi[0] <= 180 else (180.0 + t - wi[0], 180.0) for t in theta]
            samples = gridded.Samples([wi] * len(theta), wo, values)
            found = gridded.evaluate(base, material, samples)[:, 0].astype(np.float64)
            scale = np.mean(values / found)
            error = gridded.er_l2(samples, scale * found)
            broken += error > target
            verdict = "ok" if error <= target else "BROKEN"
            print(f"  phase function, light from {wi[0]:4.1f}°{'':<22} asked {100 * target:4.1f} %, found {100 * error:7.4f} %  {verdict}")
    return broken


def check_levels(binary, base, path, folder):
    """The number of levels whose stated error is not that of evaluating the bytes they need at the samples of the
    file."""
    whole, broken = os.path.join(ROOT, path), 0
    samples = gridded.read(whole, manifest_of(whole))
    options = {} if manifest_of(whole) is None else {"axes": manifest_of(whole)}
    job = gridded.compress(base, whole, 0.01, domain="grid", **options)
    address = f"{base}/v1/materials/{job['material']}"
    levels = json.loads(gridded.call(address))["levels"] or []
    for level in levels[:-1]:
        # The bytes of the level alone, and what is decoded of them as a measurement of its own.
        prefix = gridded.call(f"{address}/content", headers={"Range": f"bytes=0-{level['bytes'] - 1}"})
        material, array = os.path.join(folder, "prefix.wlm"), os.path.join(folder, "level.npy")
        with open(material, "wb") as file:
            file.write(prefix)
        subprocess.run([binary, "decode", material, "--level", str(level["level"]), "-o", array], check=True,
                       stdout=subprocess.DEVNULL)
        with open(array[: -len(".npy")] + ".axes.json") as file:
            axes = json.load(file)
        coarse = gridded.compress(base, array, "lossless", axes=axes)["material"]
        found = gridded.er_l2(samples, gridded.evaluate(base, coarse, samples))
        is_off = abs(found / level["er_l2"] - 1) > OFF
        broken += is_off
        verdict = "BROKEN" if is_off else "ok"
        print(f"  {os.path.basename(path):<46} level {level['level']:2}, states {100 * level['er_l2']:9.3f} %, "
              f"found {100 * found:9.3f} %  {verdict}", flush=True)
    return broken


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[-1])
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.argv[1], "serve", "--data", scratch, "--listen", "127.0.0.1:0"]
        with open(os.path.join(scratch, "log"), "w+") as log:
            service = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
            try:
                line = service.stdout.readline()
                address = re.search(r"http://[0-9.]+:[0-9]+", line)
                if not address:
                    sys.exit(f"promises.py: the service said {line!r}, expected its address")
                every = [(path, TARGETS) for path in FIXTURES + tables(scratch)] + [LARGE]
                broken = sum(check(address.group(), path, targets) for path, targets in every)
                broken += check_phase(address.group(), scratch)
                with_levels = ["data/nukit_lantern.ies", LARGE[0], *tables(scratch)]
                broken += sum(check_levels(sys.argv[1], address.group(), path, scratch) for path in with_levels)
            finally:
                service.terminate()
                service.wait()
    sys.exit(f"{broken} promises are broken" if broken else 0)


if __name__ == "__main__":
    main()
