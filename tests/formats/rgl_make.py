#!/usr/bin/env python3
"""Writes small RGL tensor files (.bsdf) of every kind: isotropic or not, spectral or RGB, jacobian 0 or 1, reduced or
not.

    rgl_make.py DIRECTORY [--tiny]

The materials are smooth made-up functions; nothing in them is periodic or symmetric that need not be, so that a reader
that confuses axes, slices or symmetries is found out. Needs numpy only.
"""
import struct
import sys
from pathlib import Path

import numpy as np

CODES = {"uint8": 1, "float32": 10}


def write_tensor(path, fields):
    """The container: magic, version 1.0, a table of (name, shape, type, offset), the arrays at multiples of 8."""
    table = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields))
    size = len(table) + sum(2 + len(name.encode()) + 2 + 1 + 8 + 8 * a.ndim for name, a in fields.items())
    body = b""
    for name, array in fields.items():
        array = np.ascontiguousarray(array)
        body += b"\0" * (-(size + len(body)) % 8)
        table += struct.pack("<H", len(name.encode())) + name.encode()
        table += struct.pack("<HBQ", array.ndim, CODES[array.dtype.name], size + len(body))
        table += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += array.tobytes()
    Path(path).write_bytes(table + body)


def grid(rows, columns):
    """u_theta over columns, u_phi over rows."""
    return np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))


def material(phi, theta, wavelengths, side, maps, jacobian, name):
    """All fields of one material: `phi`, `theta` in radians, `wavelengths` None for RGB."""
    tau = 2 * np.pi
    (ndf_rows, ndf_columns), (sigma_rows, sigma_columns), (rows, columns) = maps
    x, y = grid(ndf_rows, ndf_columns)
    # Nothing depends on the azimuth at the pole, everything returns after a turn.
    ndf = 3.5 * np.exp(-2.5 * x) * (1 + 0.3 * x * np.cos(tau * (y - 0.1))) + 0.2
    x, y = grid(sigma_rows, sigma_columns)
    # The projected area of an isotropic surface is that of every azimuth.
    sigma = 0.4 + 0.5 * np.cos(0.5 * np.pi * x) + (0.1 * x * np.sin(tau * y) if len(phi) > 2 else 0)
    channels = np.linspace(0, 1, 3 if wavelengths is None else len(wavelengths))
    x, y = grid(rows, columns)
    p, t = np.array(phi)[:, None, None, None], np.array(theta)[None, :, None, None]
    vndf = (0.3 + 2 * np.exp(-(((x - 0.35 - 0.1 * t) / 0.3) ** 2))) * (1 + 0.4 * x * np.cos(tau * y + 0.5 * t + p))
    x, y = grid(side, side)
    p, t = p[:, :, None], t[:, :, None]
    c = channels[None, None, :, None, None]
    values = 0.8 + 0.3 * np.sin(2 * x + c + t) * (1 + 0.3 * np.cos(tau * y + p)) + 0.15 * c * np.cos(tau * y - 2 * c)
    fields = {
        "description": np.frombuffer(name.encode(), np.uint8),
        "phi_i": np.array(phi, np.float32),
        "theta_i": np.array(theta, np.float32),
    }
    if wavelengths is not None:
        fields["wavelengths"] = np.array(wavelengths, np.float32)
    fields |= {
        "ndf": ndf.astype(np.float32),
        "sigma": sigma.astype(np.float32),
        "vndf": vndf.astype(np.float32),
        "luminance": values.mean(axis=2).astype(np.float32),
        "rgb" if wavelengths is None else "spectra": values.astype(np.float32),
        "jacobian": np.array([jacobian], np.uint8),
    }
    assert values.min() > 0 and vndf.min() > 0 and sigma.min() > 0
    return fields


def kinds(tiny=False):
    """Every kind of file as (name, fields)."""
    pi = np.pi
    lambdas = [380, 402.5, 440, 500, 700.25] if tiny else [360, 380.5, 400, 431, 470, 520, 580, 650, 730, 800, 1000]
    elevations = [0, 0.4, 1.2] if tiny else [0, 0.1, 0.25, 0.5, 0.8, 1.1, 1.4, 1.55]
    side = 4 if tiny else 16
    maps = [(3, 5), (4, 3), (5, 6)] if tiny else [(9, 33), (12, 17), (21, 25)]
    azimuths = {
        "isotropic": [0],
        "two-azimuths": [-2.8, -1.8],
        "anisotropic": np.linspace(-pi, pi, 5 if tiny else 13),
        "half-turn": np.linspace(-pi, 0, 3 if tiny else 8),
        "quarter-turn": np.linspace(-pi, -pi / 2, 3 if tiny else 6),
    }
    # Uneven azimuths between the ends.
    azimuths = {k: np.asarray(v, float) for k, v in azimuths.items()}
    azimuths["anisotropic"][2] += 0.1
    for shape, phi in azimuths.items():
        for spectral in [True, False]:
            for jacobian in [1, 0]:
                if tiny and (shape == "two-azimuths" or spectral != (shape != "half-turn") or jacobian != (shape != "quarter-turn")):
                    continue
                name = f"{shape}-{'spectral' if spectral else 'rgb'}-jacobian-{jacobian}"
                yield name, material(phi, elevations, lambdas if spectral else None, side, maps, jacobian, name)


def write_all(directory, tiny=False):
    """Writes every kind into `directory`; their paths."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, fields in kinds(tiny):
        paths.append(directory / f"{name}.bsdf")
        write_tensor(paths[-1], fields)
    return paths


if __name__ == "__main__":
    arguments = [a for a in sys.argv[1:] if a != "--tiny"]
    if len(arguments) != 1:
        sys.exit(__doc__)
    for path in write_all(arguments[0], "--tiny" in sys.argv):
        print(path, path.stat().st_size, "bytes")
