#!/usr/bin/env python3
"""Reads files of spectrometers (ASD, Spectra Vista, Sekonic, Speos) with parsers of its own and compares every value.

    spectrometers.py WAVELUME       the built program
    spectrometers.py --make         writes the small files of tests/fixtures/spectrometers anew

Beside the fixtures it makes ASD files of every version and kind of numbers, signature files whose detectors overlap,
for each rule of `--overlap`, and exports of both other kinds, all from random numbers. Values and wavelengths must
agree to 1e-5 relative. Needs numpy only. Exit code 0 if all agree, 1 if not, 2 if something is missing.
"""
import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"spectrometers.py: {error}; install numpy: python3 -m pip install numpy", file=sys.stderr)
    sys.exit(2)

ROOT = Path(__file__).resolve().parent.parent.parent
FIXTURES = ROOT / "tests/fixtures/spectrometers"
TOLERANCE = 1e-5
ELEMENTS = {0: "<f4", 1: "<i4", 2: "<f8"}


def write_asd(version, kind, element, first, step, target, white, description="", tail=b""):
    """An ASD file: a header of 484 bytes, the target, and from version 2 on the white reference."""
    header = bytearray(484)
    header[:3] = b"ASD" if version == 1 else b"as%d" % version
    header[3:18] = b"made-up numbers"
    struct.pack_into("<6h", header, 160, 9, 8, 7, 26, 10, 126)
    header[181], header[186], header[199] = 1, kind, element
    struct.pack_into("<ff", header, 191, first, step)
    struct.pack_into("<H", header, 204, len(target))
    struct.pack_into("<I", header, 390, 68)
    struct.pack_into("<H", header, 400, 6005)
    header[431] = 4
    struct.pack_into("<HH", header, 436, 500, 700)
    struct.pack_into("<ff", header, 444, first + 9 * step, first + 17 * step)
    body = np.asarray(target).astype(ELEMENTS[element]).tobytes()
    if version > 1:
        text = description.encode("cp1252")
        body += struct.pack("<HddH", 0xFFFF, 46352.25, 46352.5, len(text)) + text
        body += np.asarray(white).astype(ELEMENTS[element]).tobytes()
    return bytes(header) + body + tail


def read_asd(data):
    """Wavelengths and reflectances."""
    version = 1 if data[:3] == b"ASD" else int(data[2:3])
    first, step = struct.unpack_from("<ff", data, 191)
    (count,) = struct.unpack_from("<H", data, 204)
    element = np.dtype(ELEMENTS[data[199]])
    target = np.frombuffer(data, element, count, 484).astype(float)
    nm = first + step * np.arange(count)
    if version == 1:
        return nm, target
    at = 484 + count * element.itemsize
    flag, _, _, length = struct.unpack_from("<HddH", data, at)
    assert flag == 0xFFFF
    return nm, target / np.frombuffer(data, element, count, at + 20 + length)


def write_sig(rows):
    lines = [
        "/*** Spectra Vista SIG Data ***/",
        "name= made_up.sig",
        "instrument= HI: 0000000 (HR-1024i)",
        "units= Radiance, Radiance",
        "comm= ",
        "factors= 1.0, 1.0, 1.0 [Overlap: Preserve, Matching Type: None]",
        "data= ",
    ]
    lines += [f"{nm:.1f}  {white:.2f}  {target:.2f}  {100 * target / white:.2f}" for nm, white, target in rows]
    return "\r\n".join(lines).encode() + b"\r\n"


def read_sig(data, column, rule):
    """Wavelengths and one column (1 white reference, 2 target, 3 reflectance), with the detectors joined."""
    lines = data.decode().splitlines()
    start = next(i for i, line in enumerate(lines) if line.split("=")[0] == "data")
    rows = np.array([[float(cell) for cell in line.split()] for line in lines[start + 1 :]])
    rows = rows[:, [0, column]] / (1, 100 if column == 3 else 1)
    runs = np.split(rows, 1 + np.flatnonzero(np.diff(rows[:, 0]) <= 0))
    joined = runs[0]
    for run in runs[1:]:
        first, last = run[0, 0], joined[-1, 0]
        if rule == "shorter":
            joined = np.concatenate([joined, run[run[:, 0] > last]])
        elif rule == "longer":
            joined = np.concatenate([joined[joined[:, 0] < first], run])
        else:
            common = np.union1d(joined[joined[:, 0] >= first, 0], run[run[:, 0] <= last, 0])
            mean = (np.interp(common, *joined.T) + np.interp(common, *run.T)) / 2
            joined = np.concatenate(
                [joined[joined[:, 0] < first], np.column_stack([common, mean]), run[run[:, 0] > last]]
            )
    return joined.T


def write_sekonic(values):
    lines = ["\ufeffDate Saved,26/11/2026 7:08:09 a.m.", "Title,made up", "", "Measuring Mode,Ambient", "Tcp [K],3000"]
    lines += ["\u22bfuv,-0.0029", "CRI Ra,90", "SSI1,---", ""]
    for step in (5, 1):
        lines += [f"Spectral Data {380 + i}[nm],{value:.12f}" for i, value in enumerate(values) if i % step == 0] + [""]
    return "\n".join(lines).encode()


def read_sekonic(data):
    pairs = {}
    for line in data.decode("utf-8-sig").splitlines():
        if line.startswith("Spectral Data "):
            name, value = line.split(",")
            pairs[float(name[len("Spectral Data ") : -len("[nm]")])] = float(value)
    return np.array(sorted(pairs.items())).T


def write_speos(nm, values):
    rows = [f"{x:g}\t{y:g}" for x, y in zip(nm, values)]
    return "\n".join(["OPTIS - Spectrum file v1.0", "made-up numbers", str(len(rows)), *rows]).encode() + b"\n"


def read_speos(data):
    return np.array([[float(cell) for cell in line.split()] for line in data.decode().splitlines()[3:]]).T


def detectors(random):
    """Rows of three detectors whose ranges overlap."""
    for first, last, step in ((900, 1010, 1.5), (985, 1900, 7), (1885, 2500, 4)):
        for nm in np.arange(first, last, step):
            white = random.uniform(500, 4e5)
            yield nm, white, white * random.uniform(0.01, 1.1)


def fixtures():
    x = np.arange(24)
    white = np.round(30000 * np.exp(-(((x - 12) / 9) ** 2)) + 500)
    target = np.round(white * (0.1 + 0.02 * x))
    rows = [(nm, 1000 + nm, (0.2 + 0.0002 * (nm - 900)) * (1000 + nm)) for nm in np.arange(900, 1012, 8.0)]
    rows += [(nm, 1000 + nm, (0.23 + 0.0002 * (nm - 900)) * (1000 + nm)) for nm in np.arange(985, 1080, 7.0)]
    bump = 1e-4 + 9e-4 * np.exp(-(((np.arange(21) - 12) / 5) ** 2))
    nm = np.arange(400, 701, 25)
    return {
        "field.asd": write_asd(7, 1, 2, 350, 25, target, white, "gravel, dry", b"\0" * 40),
        "raw.asd": write_asd(5, 0, 0, 350, 25, target, white),
        "field.sig": write_sig(rows),
        "meter.csv": write_sekonic(bump),
        "led.spectrum": write_speos(nm, np.round(100 * np.exp(-(((nm - 610) / 60.0) ** 2)), 3)),
    }


class Program:
    def __init__(self, path, folder):
        self.path, self.folder, self.compared, self.failed = Path(path).resolve(), Path(folder), 0, False

    def compare(self, what, data, expected, *options):
        """Projects a file with the program and compares its wavelengths and values with those expected."""
        source, array = self.folder / "measurement", self.folder / "out.npy"
        source.write_bytes(data)
        command = [self.path, "project", source, "-o", array, *options]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            print(f"{what}: {done.stderr.strip()}")
            self.failed = True
            return
        axis = json.loads(array.with_suffix(".axes.json").read_text())["axes"][-1]
        nm = axis["values"] if "values" in axis else axis["start"] + axis["step"] * np.arange(axis["count"])
        nm = np.array(nm)
        values = np.load(array).ravel()
        self.compared += values.size
        close = [
            a.shape == b.shape and np.allclose(a, b, rtol=TOLERANCE, atol=1e-12, equal_nan=True)
            for a, b in zip((nm, values), expected)
        ]
        if not all(close):
            print(f"{what}: other {'values' if close[0] else 'wavelengths'}")
            self.failed = True


def main(wavelume):
    random = np.random.default_rng(51)
    with tempfile.TemporaryDirectory() as folder:
        program = Program(wavelume, folder)
        for name, data in fixtures().items():
            if (FIXTURES / name).read_bytes() != data:
                print(f"{name}: not the file that --make writes")
                program.failed = True
            suffix = Path(name).suffix
            readers = {".asd": read_asd, ".csv": read_sekonic, ".spectrum": read_speos}
            expected = read_sig(data, 3, "shorter") if suffix == ".sig" else readers[suffix](data)
            program.compare(name, data, expected)
        for version in range(1, 9):
            for element in (0, 2) if version == 1 else ELEMENTS:
                count = int(random.integers(30, 3000))
                white = np.round(random.uniform(100, 60000, count))
                ratio = random.uniform(0.01, 1.2, count)
                target = ratio if version == 1 else np.round(white * ratio)
                data = write_asd(version, 1, element, 350, 1.4, target, white, "é" * int(random.integers(40)))
                program.compare(f"ASD version {version}, numbers {element}", data, read_asd(data))
        signature = write_sig(detectors(random))
        for column in (1, 2, 3):
            for rule in ("shorter", "longer", "mean"):
                options = ["--column", column, "--overlap", rule]
                program.compare(f"signature {options}", signature, read_sig(signature, column, rule), *options)
        meter = write_sekonic(random.uniform(1e-6, 1e-3, 401))
        program.compare("meter", meter, read_sekonic(meter))
        speos = write_speos(np.cumsum(random.uniform(0.5, 5, 300)) + 300, random.uniform(0, 100, 300))
        nm, percent = read_speos(speos)
        program.compare("Speos", speos, (nm, percent))
        program.compare("Speos as a reflectance", speos, (nm, percent / 100), "--quantity", "reflectance")
    print(f"{program.compared:,} values compared")
    return 1 if program.failed else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    if sys.argv[1] == "--make":
        FIXTURES.mkdir(parents=True, exist_ok=True)
        for name, data in fixtures().items():
            (FIXTURES / name).write_bytes(data)
        sys.exit(0)
    sys.exit(main(sys.argv[1]))
