#!/usr/bin/env python3
"""Compresses every gridded fixture through the service, lossless and to 1 %, exports it in its own format, and compares
the two files as the readers of gridded.py have them: the same angles, numbers equal or within the promise, keywords
that are still there, at most 1.3 times the bytes. Luminaires are also written in the other format for them. Tables of
text and arrays come back as arrays on the same angles.

Usage: round_trips.py BINARY
"""
import json
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import gridded
import promises

FORMATS = {".ies": "lm63", ".ldt": "eulumdat", ".mbsdf": "mbsdf"}
OTHER = {".ies": ".ldt", ".ldt": ".ies"}
PROMISE = 0.01
# Largest size of an export, in sizes of its source.
LARGER = 1.3
# Numbers of more digits than an f32 has are kept as the nearest f32, and written with the fewest digits that mean it:
# half a step of an f32 each, relative.
ROUNDED = 2.0**-23
# Planes of type A and B have no other format, nor has light in other units than candela; planes from C270 over C0 to
# C90 are listed as their mirror images there.
NO_OTHER = ("data/", "ies/example_modules.ies", "ies/test.ies", "ldt/symmetry_to_c90c270.ldt")


def export(base, material, extension, scratch):
    """The file that the service writes, and the error that it states."""
    address = f"{base}/v1/materials/{material}/export?format={FORMATS[extension]}"
    path = os.path.join(scratch, "export" + extension)
    with gridded.urllib.request.urlopen(address, timeout=600) as answer:
        stated = answer.headers["Wavelume-Export-Error"]
        with open(path, "wb") as file:
            file.write(answer.read())
    return path, stated


def error(stated, found):
    """er(L2) of numbers, each where it is stated; zeros have to be zeros."""
    scored = stated > 0
    if not np.array_equal(stated == 0, found == 0):
        return np.inf
    return float(np.sqrt(np.mean(((found[scored] - stated[scored]) / stated[scored]) ** 2)))


def same_angles(a, b):
    sides = ((a.wi, b.wi), (a.wo, b.wo))
    return all((x is None) == (y is None) and (x is None or np.array_equal(x, y)) for x, y in sides)


def keywords(path):
    """Lines of an LM-63 file in front of its numbers, without blanks that mean nothing."""
    with open(path, "rb") as file:
        head = file.read().decode("latin-1").replace("\r", "\n").split("TILT=")[0]
    lines = [re.sub(r"\s*\]\s*", "] ", line.strip()) for line in head.split("\n") if line.strip()]
    return [line.upper() for line in lines if line.startswith("[")]


def failures(path, samples, target, made, stated):
    """Faults in the export of a file."""
    found, wrong = gridded.read(made), []
    if not same_angles(samples, found):
        return ["other angles"]
    added = error(samples.values, found.values)
    if target == "lossless" and not np.allclose(found.values, samples.values, rtol=ROUNDED, atol=0):
        wrong.append(f"numbers that differ by er(L2) {added}")
    if added > PROMISE * (1 + 1e-4):
        wrong.append(f"er(L2) {100 * added:.4f} %, expected at most {100 * PROMISE} %")
    size = os.path.getsize(made) / os.path.getsize(path)
    if size > LARGER:
        wrong.append(f"{size:.3f} times the size of the source, expected at most {LARGER}")
    if path.endswith(".ies") and keywords(path) != keywords(made):
        wrong.append("other keywords")
    if path.endswith(".mbsdf") and target == "lossless":
        with open(path, "rb") as a, open(made, "rb") as b:
            if a.read() != b.read():
                wrong.append("other bytes")
    luminaire = not path.endswith(".mbsdf")
    if luminaire and not all(key in stated for key in ("peak=", "flux=", "rms_of_peak=", "er_l2_bright=")):
        wrong.append(f"no errors of a luminaire in {stated}")
    return wrong


def crossed(path, samples, made):
    """Faults in the other format of a luminaire: a value at each direction that both files list."""
    found = gridded.read(made)
    known = {tuple(np.round(wo % [361, 360], 9)): value for wo, value in zip(found.wo, found.values[:, 0])}
    pairs = [(known.get(tuple(np.round(wo % [361, 360], 9))), value) for wo, value in zip(samples.wo, samples.values[:, 0])]
    if any(value is None for value, _ in pairs):
        return ["directions that are not in the other format"]
    both = np.array(pairs)
    off = np.max(np.abs(both[:, 0] - both[:, 1]) / np.maximum(both[:, 1], 1e-30 + 1e-6 * both[:, 1].max()))
    return [f"values in the other format that are {off} off"] if off > 1e-6 else []


def check(base, path, scratch):
    """The number of round trips that are broken."""
    whole = os.path.join(promises.ROOT, path)
    extension = os.path.splitext(path)[1]
    samples, broken = gridded.read(whole), 0
    for target in ("lossless", PROMISE):
        material = gridded.compress(base, whole, target, domain="grid")["material"]
        made, stated = export(base, material, extension, scratch)
        wrong = failures(whole, samples, target, made, stated)
        if target == "lossless" and extension in OTHER and not any(part in path for part in NO_OTHER):
            wrong += crossed(path, samples, export(base, material, OTHER[extension], scratch)[0])
        size = os.path.getsize(made) / os.path.getsize(whole)
        broken += bool(wrong)
        verdict = "BROKEN: " + "; ".join(wrong) if wrong else "ok"
        print(f"  {os.path.basename(path):<52} {target!s:>8}, {size:5.2f} times the size  {verdict}", flush=True)
    return broken


def check_array(binary, base, path, scratch):
    """The number of round trips of a table or an array that are broken: it comes back as an array on its own angles."""
    samples, broken = gridded.read(path), 0
    options = {} if promises.manifest_of(path) is None else {"axes": promises.manifest_of(path)}
    for target in ("lossless", PROMISE):
        job = gridded.compress(base, path, target, domain="grid", **options)
        material, array = os.path.join(scratch, "back.wlm"), os.path.join(scratch, "back.npy")
        with open(material, "wb") as file:
            file.write(gridded.call(f"{base}/v1/materials/{job['material']}/content"))
        subprocess.run([binary, "export", material, "--format", "npy", "-o", array], check=True, stdout=subprocess.DEVNULL)
        with open(array[: -len(".npy")] + ".axes.json") as file:
            incoming, outgoing, _ = json.load(file)["axes"]
        angles = [(i, o, p) for i in incoming["values"] for o in outgoing["polar"] for p in outgoing["azimuths"]]
        stated = [(wi[0], *wo) for wi, wo in zip(samples.wi, samples.wo)]
        found = np.load(array).astype(np.float64).reshape(samples.values.shape)
        wrong = [] if angles == stated else ["other angles"]
        if target == "lossless" and not np.array_equal(found, samples.values.astype(np.float32)):
            wrong.append("other numbers")
        added = error(samples.values, found)
        if target != "lossless" and added > PROMISE * (1 + 1e-4):
            wrong.append(f"er(L2) {100 * added:.4f} %, expected at most {100 * PROMISE} %")
        broken += bool(wrong)
        verdict = "BROKEN: " + "; ".join(wrong) if wrong else "ok"
        print(f"  {os.path.basename(path):<52} {target!s:>8}{'':<24}  {verdict}", flush=True)
    return broken


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[-1])
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.argv[1], "serve", "--data", os.path.join(scratch, "data"), "--listen", "127.0.0.1:0"]
        with open(os.path.join(scratch, "log"), "w+") as log:
            service = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
            try:
                line = service.stdout.readline()
                address = re.search(r"http://[0-9.]+:[0-9]+", line)
                if not address:
                    sys.exit(f"round_trips.py: the service said {line!r}, expected its address")
                broken = sum(check(address.group(), path, scratch) for path in promises.FIXTURES)
                for path in promises.tables(scratch):
                    broken += check_array(sys.argv[1], address.group(), path, scratch)
            finally:
                service.terminate()
                service.wait()
    sys.exit(f"{broken} round trips are broken" if broken else 0)


if __name__ == "__main__":
    main()
