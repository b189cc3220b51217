#!/usr/bin/env python3
"""Promises of the program, checked from outside with numpy: errors, masks, memory, refusals, equal bytes.

Usage: run.py [--all-builds] BINARY OTHER [FIGURES.md]

With FIGURES.md it writes the table of docs/performance.md there, otherwise it compares the table with what it measures.
OTHER is a second build of the program, of another optimisation in `tests/nightly release`, or the example program
`again`. Both must write the same bytes. --all-builds compares them on every file, not on four, and does nothing else;
it takes two builds of the program.
"""
import json
import os
import struct
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "peers"))
import gen  # noqa: E402

MIB = 1 << 20
PAGE = "docs/performance.md"
TARGET = 0.01
TRUNCATIONS = 25

# Real files, with the options that they need.
REAL = [
    ("data/aerolamp.ies", ["--spectrum", "data/aerolamp.csv"]),
    ("data/aerolamp.ies", []),
    ("data/carpaint_blue.mbsdf", []),
    ("data/colorchecker_n_ohta.csv", ["--quantity", "reflectance"]),
    ("data/colorchecker_n_ohta.csv", ["--quantity", "reflectance", "--column", "light skin"]),
    ("data/illuminant_D65.csv", []),
    ("data/aerolamp.csv", []),
    ("tests/fixtures/ies/nukit_lantern.ies", []),
    ("tests/fixtures/ies/ushio_b1.ies", ["--spectrum", "tests/fixtures/ies/ushio_b1.csv"]),
    ("tests/fixtures/ies/iesna2002_example_typec.ies", []),
    ("tests/fixtures/mbsdf/test_rgb_theta_2_phi_3.mbsdf", []),
]

# Files that break the rules of their format, and formats that are recognised but not read.
MALFORMED = [
    "tests/fixtures/ies/test_file_format_error.ies",
    "tests/fixtures/mbsdf/test_file_format_error.mbsdf",
    "tests/fixtures/spectra/Invalid.spdx",
]

failures = []
figures = []


def check(holds, message):
    if not holds:
        failures.append(message)
        print(f"  FAILED  {message}")


class Done:
    """A finished run of the program."""

    def __init__(self, code, out, err, peak):
        self.code, self.out, self.err, self.peak = code, out, err, peak


# A child's peak starts at that of the process that forked it, so a small process stands between.
MEASURE = """
import os, resource, subprocess, sys
child = subprocess.Popen(sys.argv[2:])
_, status, usage = os.wait4(child.pid, 0)
open(sys.argv[1], "w").write(str(usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)))
code = os.waitstatus_to_exitcode(status)
sys.exit(code if code >= 0 else 128 - code)
"""


def run(binary, *args, measure=None):
    """Runs the program in the project's directory; with a file to `measure` into, also its peak of resident memory."""
    command = [binary, *args]
    if measure:
        command = [sys.executable, "-S", "-c", MEASURE, measure, *command]
    done = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True)
    peak = None
    if measure:
        with open(measure) as file:
            peak = int(file.read())
    return Done(done.returncode, done.stdout.decode(), done.stderr.decode(), peak)


def errors(original, decoded):
    """er(L1), er(L2) and the largest relative error over samples > 0, in float64."""
    s, d = original.astype(np.float64).ravel(), decoded.astype(np.float64).ravel()
    scored = s > 0
    if not scored.any():
        return 0.0, 0.0, 0.0
    relative = np.abs(d[scored] - s[scored]) / s[scored]
    return relative.mean(), np.sqrt((relative**2).mean()), relative.max()


def refused(done, what):
    """A refusal is exit code 1, one line on stderr that says who speaks, and nothing on stdout."""
    lines = done.err.splitlines()
    check(done.code == 1, f"{what}: exit code {done.code}, expected 1: {done.err.strip()[:200]}")
    check(len(lines) == 1 and lines[0].startswith("wavelume: "), f"{what}: stderr is {done.err[:200]!r}")
    check(done.out == "", f"{what}: stdout is {done.out[:100]!r}")


def promise(binary, scratch, path, options, own_tensor=None):
    """Compresses, projects and decodes one measurement, and scores what came back."""
    name = " ".join([os.path.basename(path), *(os.path.basename(o) for o in options)])
    material, tensor, decoded = (os.path.join(scratch, f) for f in ("m.wlm", "t.npy", "d.npy"))
    peak = os.path.join(scratch, "peak")
    to = ["-o", material, "--er-l2", str(TARGET), "--json"]
    compressed = run(binary, "compress", path, *to, *options, measure=peak)
    projected = run(binary, "project", path, "-o", tensor, *options, measure=peak)
    back = run(binary, "decode", material, "-o", decoded, measure=peak)
    for what, done in (("compress", compressed), ("project", projected), ("decode", back)):
        if done.code != 0:
            check(False, f"{name}: {what}: {done.err.strip()}")
            return None
    report = json.loads(compressed.out)
    s, d = np.load(tensor), np.load(decoded)
    check(s.dtype == np.float32 and d.dtype == np.float32, f"{name}: {s.dtype} and {d.dtype}, expected float32")
    check(s.shape == d.shape, f"{name}: shape {d.shape}, expected {s.shape}")
    if s.shape != d.shape:
        return None
    if own_tensor is not None:
        check(np.array_equal(s, np.load(own_tensor), equal_nan=True), f"{name}: project changed an array on its axes")
    l1, l2, largest = errors(s, d)
    check(l2 <= TARGET, f"{name}: er(L2) {l2:.6f}, promised {TARGET}")
    check(np.array_equal(np.isnan(s), np.isnan(d)), f"{name}: the masks differ")
    check(np.array_equal(s == 0, d == 0) or not (s == 0).any(), f"{name}: zeros are not zeros any more")
    # Errors of averages over cells, where the file's samples are not the tensor's.
    of = "_cells" if report.get("er_l2_cells") is not None else ""
    for key, found in (("er_l1" + of, l1), ("er_l2" + of, l2), ("max_relative_error" + of, largest)):
        close = abs(report[key] - found) <= 1e-9 + 1e-6 * found
        check(close, f"{name}: reports {key} {report[key]}, measured {found}")
    check(report["bytes"] == os.path.getsize(material), f"{name}: reports {report['bytes']} bytes")
    check(report["samples" + of] == s.size, f"{name}: reports {report['samples' + of]} samples")
    for key in ("kept_coefficients", "ratio_coefficients", "ratio_bytes", "relative_rmse", "zero_samples", "seconds"):
        check(key in report, f"{name}: no {key} in the report")
    limit = 4 * s.nbytes + 64 * MIB
    for what, done in (("compress", compressed), ("project", projected), ("decode", back)):
        check(done.peak <= limit, f"{name}: {what} took {done.peak / MIB:.0f} MiB, expected {limit / MIB:.0f} at most")
    ratio = s.nbytes / report["bytes"]
    figures.append(
        f"| {name} | {s.nbytes:,} | {report['bytes']:,} | {ratio:,.{0 if ratio >= 100 else 2}f} | {100 * l2:.3f} |"
    )
    print(
        f"  {name[:58]:58s} {s.nbytes:>10,} -> {report['bytes']:>8,}  er(L2) {100 * l2:.3f} %"
        f"  {report['seconds']:6.2f} s  {compressed.peak / MIB:4.0f} MiB"
    )
    return material


def npy(descr="<f4", shape="(2, 3)", body=b"\0" * 24, fortran="False"):
    header = f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}"
    header = header.ljust((-(len(header) + 11)) % 64 + len(header)) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + body


def start_of(path, count):
    """The first bytes of a file."""
    with open(os.path.join(ROOT, path), "rb") as file:
        return file.read(count)


def hostile(scratch):
    """Files that lie about their size, their type or themselves."""
    made = {
        "empty": b"",
        "zeros": b"\0" * 4096,
        "random": np.random.default_rng(7).bytes(4096),
        "prose.txt": b"It was a bright cold day in April, and the clocks were striking thirteen.\n" * 20,
        "scan.h5": b"\x89HDF\r\n\x1a\n" + b"\0" * 504,
        "cut.bsdf": start_of("tests/fixtures/rgl/isotropic-spectral-jacobian-1.bsdf", 1500),
        "cut.ldt": start_of("tests/fixtures/ldt/example.ldt", 300),
        "huge.npy": npy(shape="(100000000000,)"),
        "overflow.npy": npy(shape="(4294967296, 4294967296, 4294967296)"),
        "negative.npy": npy(shape="(-2, 3)"),
        "object.npy": npy(descr="|O"),
        "complex.npy": npy(descr="<c8"),
        "short.npy": npy(body=b"\0" * 20),
        "long.npy": npy(body=b"\0" * 28),
        "infinite.npy": npy(body=struct.pack("<6f", 1, 2, float("inf"), 4, 5, 6)),
        "headless.npy": b"\x93NUMPY\x01\x00" + struct.pack("<H", 65535) + b"{",
        "version.npy": b"\x93NUMPY\x09\x00" + npy()[8:],
        "magic.wlm": b"\x89WLM",
        "garbage.wlm": b"\x89WLM" + np.random.default_rng(8).bytes(500),
        "huge.mbsdf": b"NVIDIA ARC MBSDF V1\n" + struct.pack("<4I", 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 3),
        "angles.ies": b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 999999999 999999999 1 2 0 0 0\n1 1 0\n0 1 2\n",
        "nan.csv": b"wavelength_nm,value\n400,nan\n410,--\n420,\n",
        "words.csv": b"wavelength_nm,value\n400,1\n410,bright\n420,3\n",
        "backwards.csv": b"wavelength_nm,value\n420,1\n410,2\n400,3\n410,4\n",
    }
    for name, content in made.items():
        with open(os.path.join(scratch, name), "wb") as file:
            file.write(content)
        if name.endswith(".npy"):
            with open(os.path.join(scratch, name[:-4] + ".axes.json"), "w") as file:
                json.dump({"quantity": "spectrum", "axes": ["index", "lambda:400:10:3"]}, file)
    return [os.path.join(scratch, name) for name in made]


def refusals(binary, scratch):
    directory = os.path.join(scratch, "hostile")
    os.makedirs(directory)
    out = os.path.join(scratch, "refused.wlm")
    paths = [*MALFORMED, *hostile(directory), directory, os.path.join(directory, "missing.ies")]
    for path in paths:
        name = os.path.basename(path)
        refused(run(binary, "inspect", path), f"inspect {name}")
        refused(run(binary, "compress", path, "-o", out), f"compress {name}")
        check(not os.path.exists(out), f"compress {name}: left a file behind")
    refused(run(binary, "decode", os.path.join(ROOT, "README.md"), "-o", os.path.join(scratch, "refused.npy")), "decode README.md")
    print(f"  {len(paths)} malformed, hostile and missing files")


def truncations(binary, scratch, files):
    """Every file cut at many places. A table of text may be whole where it is cut: then it must still be understood. So
    is a material in front of its metadata."""
    cut, accepted = os.path.join(scratch, "cut"), 0
    for path, options in files:
        with open(os.path.join(ROOT, path), "rb") as file:
            content = file.read()
        extension = os.path.splitext(path)[1]
        binary_format = extension in (".wlm", ".npy", ".mbsdf")
        # Without its last number, and without the spaces before it, a text file has certainly lost something.
        complete = len(content.rstrip()) - len(content.split()[-1]) if not binary_format else len(content)
        if extension == ".wlm":
            complete = json.loads(run(binary, "inspect", path, "--json").out)["levels"][-1]["bytes"]
        may_end_anywhere = extension == ".csv"
        side_car = os.path.splitext(path)[0] + ".axes.json"
        if extension == ".npy" and os.path.exists(os.path.join(ROOT, side_car)):
            options = [*options, "--axes", side_car]
        for i in range(TRUNCATIONS):
            size = len(content) * i // TRUNCATIONS
            with open(cut + extension, "wb") as file:
                file.write(content[:size])
            command = ["decode", cut + extension, "-o", cut + ".out"] if extension == ".wlm" else ["inspect", cut + extension]
            done = run(binary, *command, *(options if extension != ".wlm" else []))
            if extension == ".wlm" and size > complete:
                refused(done, f"{os.path.basename(path)} cut at {size} of {len(content)}")
                continue
            if done.code == 0 and (may_end_anywhere or size >= complete):
                accepted += 1
                continue
            refused(done, f"{os.path.basename(path)} cut at {size} of {len(content)}")
    print(f"  {len(files)} files cut at {TRUNCATIONS} places each; {accepted} cuts left a whole table")


def compressed_by(binary, scratch, path, threads, options):
    """The bytes of the material."""
    out = os.path.join(scratch, "equal.wlm")
    done = run(binary, "compress", path, "-o", out, "--threads", str(threads), *options)
    check(done.code == 0, f"{os.path.basename(path)}: {done.err.strip()}")
    with open(out, "rb") as file:
        return file.read()


def small_files(arrays):
    """Real files and two arrays, each with its options."""
    return REAL + [(arrays["edf_led"], []), (arrays["edf_f11"], [])]


def equal_threads(binary, scratch, arrays):
    """Checks that bytes are equal on any number of threads, on every run."""
    # One of each way to code: grids of angles, colours, spectra on triangles, and spectra alone.
    files = [("data/aerolamp.ies", []), ("data/carpaint_blue.mbsdf", []), ("data/illuminant_D65.csv", []),
             ("data/colorchecker_n_ohta.csv", ["--quantity", "reflectance"]), (arrays["brdf_wood"], [])]
    for path, options in files:
        same = compressed_by(binary, scratch, path, 1, options) == compressed_by(binary, scratch, path, 5, options)
        check(same, f"{os.path.basename(path)}: 5 threads differ from one")
    print(f"  {len(files)} pairs of materials of other threads compared byte by byte")


def equal_builds(binary, other, scratch, arrays, all_files):
    """Checks that builds of different optimisation make equal bytes, of four files or of all."""
    is_example = os.path.basename(other) == "again"
    compared = 0
    policies = [[], ["--policy", "conventional", "--ratio", "20"], ["--lossless"], ["--max-relative-error", "0.05"]]
    several = (arrays["edf_led"], "data/carpaint_blue.mbsdf", "data/illuminant_D65.csv")
    few = (*several, arrays["edf_f11"])
    for path, options in small_files(arrays):
        if not all_files and path not in few:
            continue
        for policy in policies if path in several else [[]]:
            written = compressed_by(binary, scratch, path, 1, options + policy)
            if is_example:
                # It compresses the file again, as the material of compressed_by says that it was asked for.
                done = run(other, path, os.path.join(scratch, "equal.wlm"))
                check(done.code == 0, f"{os.path.basename(path)} {' '.join(policy)}: {done.out.strip()} {done.err.strip()}")
            else:
                same = written == compressed_by(other, scratch, path, 2, options + policy)
                check(same, f"{os.path.basename(path)} {' '.join(policy)}: the builds differ")
            compared += 1
    print(f"  {compared} pairs of materials of other builds compared byte by byte")


def documented():
    """The page has the sizes and errors that were measured; times and memory differ between machines."""
    with open(os.path.join(ROOT, PAGE)) as file:
        table = file.read().split("<!-- figures -->")[1].split("<!-- end of figures -->")[0]
    for line in figures:
        check(line in table, f"{PAGE} does not have the measured line {line}")
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    check(len(rows) == len(figures) + 1, f"{PAGE} has {len(rows) - 1} lines of figures, measured {len(figures)}")


def main():
    all_builds = "--all-builds" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--all-builds"]
    if len(arguments) not in (2, 3):
        sys.exit(__doc__.splitlines()[2])
    binary, other = (os.path.abspath(path) for path in arguments[:2])
    with tempfile.TemporaryDirectory() as scratch:
        if all_builds:
            arrays = {name: gen.generate(os.path.join(scratch, "arrays"), name) for name in ("edf_led", "edf_f11")}
            equal_builds(binary, other, scratch, arrays, all_files=True)
            sys.exit(f"{len(failures)} checks failed" if failures else 0)
        print("Arrays and real files, compressed to er(L2) 1 % and scored with numpy")
        arrays = {name: gen.generate(os.path.join(scratch, "arrays"), name) for name in gen.ARRAYS}
        for path in arrays.values():
            promise(binary, scratch, path, [], own_tensor=path)
        good = []
        for i, (path, options) in enumerate(REAL):
            material = promise(binary, scratch, path, options)
            if material:
                kept = os.path.join(scratch, f"good{i}.wlm")
                os.replace(material, kept)
                good.append((kept, []))
        print("Refusals")
        refusals(binary, scratch)
        truncations(binary, scratch, REAL + good[:3] + [(arrays["edf_f11"], [])])
        print("Equal bytes")
        equal_threads(binary, scratch, arrays)
        equal_builds(binary, other, scratch, arrays, all_files=False)
    if len(arguments) == 3:
        heading = "| measurement | float32, bytes | material, bytes | ratio | er(L2), % |"
        with open(arguments[2], "w") as file:
            file.write("\n".join([heading, "|---|--:|--:|--:|--:|", *figures]) + "\n")
    else:
        documented()
    if failures:
        sys.exit(f"{len(failures)} checks failed")
    print("all held")


if __name__ == "__main__":
    main()
