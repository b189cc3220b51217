#!/usr/bin/env python3
"""Writes colour_science.json beside itself: colours of the ColorChecker's patches by the PyPI package colour-science.

    pip install colour-science==0.4.7 numpy
    python tests/golden/colour_science.py

Spectra are those of data/, brought to 380..780 nm by 1 in straight lines, and summed by `sd_to_XYZ_integration` (which
has no interpolation of its own then): the method of src/domain/colour/tristimulus.rs.

`patches`: for each illuminant, a patch's XYZ and Lab. `lights`: XYZ of each illuminant as an emitter, k = 683 lm/W.
`at_5_nm`: XYZ under D65 summed at 5 nm; `astm_e308`: XYZ under D65 by `sd_to_XYZ_ASTME308`, which interpolates by
Sprague's and Lagrange's polynomials: other methods, near ours. `differences`: CIEDE2000 of each patch to the next,
under each illuminant. `srgb`: linear values and their sRGB values; `matrix`: the inverse of the matrix from sRGB to
XYZ. `observer_1964`: XYZ under D65 by the 10° observer. `adapted`: patches under A and F11 as they look under D65
(Bradford), XYZ. `temperatures`: correlated colour temperature and (u, v) of lights and of some chromaticities beside
the Planckian locus, by minimising the distance to Planck's law. `oklab`: linear sRGB and its Oklab.
"""
import json
import os
import warnings

import colour
import numpy as np
from colour.colorimetry import sd_to_XYZ_ASTME308, sd_to_XYZ_integration

warnings.filterwarnings("ignore")
HERE = os.path.dirname(os.path.abspath(__file__))
DATA = os.path.join(HERE, "..", "..", "data")
FINE = np.arange(380.0, 781.0)
SHAPE = colour.SpectralShape(380, 780, 1)
COARSE = colour.SpectralShape(380, 780, 5)


def table(name):
    with open(os.path.join(DATA, name), encoding="utf-8") as f:
        head, *rows = [line.strip().split(",") for line in f if line.strip()]
    rows = np.array(rows, dtype=float)
    return head[1:], rows[:, 0], rows[:, 1:]


def sd(lambdas, values, name="", at=FINE):
    return colour.SpectralDistribution(np.interp(at, lambdas, values), at, name=name)


def light(name, at=FINE):
    if name == "E":
        return sd(FINE, np.full(len(FINE), 100.0), name, at)
    _, lambdas, values = table(f"illuminant_{name}.csv")
    return sd(lambdas, values[:, 0], name, at)


def cmfs(at=FINE, observer="1931_2"):
    names, lambdas, values = table(f"cmfs_CIE_{observer}_Degree_Standard_Observer.csv")
    columns = np.transpose([np.interp(at, lambdas, values[:, k]) for k in range(3)])
    return colour.colorimetry.XYZ_ColourMatchingFunctions(columns, at)


def xyz(spectrum, illuminant, at=FINE, shape=SHAPE):
    return sd_to_XYZ_integration(sd(*spectrum, at=at).values, cmfs(at), light(illuminant, at), shape=shape)


def temperature(uv):
    planck = colour.temperature.uv_to_CCT_Planck1900(uv, cmfs(), optimisation_kwargs={"options": {"fatol": 1e-16}})
    return {"uv": list(uv), "kelvin": float(planck)}


def main():
    names, lambdas, values = table("colorchecker_n_ohta.csv")
    patches, differences = {}, {}
    for illuminant in ("A", "B", "C", "D50", "D65", "F11", "E"):
        white = xyz((FINE, np.ones(len(FINE))), illuminant)
        colours = [xyz((lambdas, values[:, k]), illuminant) for k in range(len(names))]
        labs = [colour.XYZ_to_Lab(c / 100.0, colour.XYZ_to_xy(white)) for c in colours]
        patches[illuminant] = [{"xyz": list(c), "lab": list(lab)} for c, lab in zip(colours, labs)]
        pairs = zip(labs, labs[1:])
        differences[illuminant] = [float(colour.delta_E(a, b, method="CIE 2000")) for a, b in pairs]
    unit = sd(FINE, np.ones(len(FINE)))
    lights = {
        # The package divides by 100 where k is given.
        name: list(100.0 * sd_to_XYZ_integration(light(name).values, cmfs(), unit, k=683, shape=SHAPE))
        for name in patches
    }
    wide = [
        sd_to_XYZ_integration(sd(lambdas, values[:, k]).values, cmfs(observer="1964_10"), light("D65"), shape=SHAPE)
        for k in range(len(names))
    ]
    whites = {name: xyz((FINE, np.ones(len(FINE))), name) for name in patches}
    adapted = {
        name: [
            list(colour.adaptation.chromatic_adaptation_VonKries(p["xyz"], whites[name], whites["D65"], "Bradford"))
            for p in patches[name]
        ]
        for name in ("A", "F11")
    }
    uvs = [colour.UCS_to_uv(colour.XYZ_to_UCS(lights[name])) for name in lights]
    for kelvin, duv in ((1500, 0.01), (2700, -0.005), (4000, 0.02), (8000, -0.01), (20000, 0.003)):
        uvs.append(colour.temperature.CCT_to_uv_Ohno2013([kelvin, duv], cmfs()))
    oklab = [[1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.2, 0.5, 0.1], [0.02, 0.01, 0.9]]
    coarse = np.arange(380.0, 781.0, 5.0)
    spectra = [colour.SpectralDistribution(values[:, k], lambdas) for k in range(len(names))]
    e308 = [sd_to_XYZ_ASTME308(s, cmfs(), light("D65"), use_practice_range=False) for s in spectra]
    linear = [-0.01, 0.0, 0.001, 0.0031308, 0.0032, 0.02, 0.18, 0.5, 1.0, 1.5]
    document = {
        "made": f"colour-science {colour.__version__}",
        "names": names,
        "patches": patches,
        "lights": lights,
        "at_5_nm": [list(xyz((lambdas, values[:, k]), "D65", coarse, COARSE)) for k in range(len(names))],
        "astm_e308": [list(c) for c in e308],
        "differences": differences,
        "observer_1964": [list(c) for c in wide],
        "adapted": adapted,
        "temperatures": [temperature(uv) for uv in uvs],
        "oklab": [
            [c, list(colour.XYZ_to_Oklab(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ @ np.array(c, float)))]
            for c in oklab
        ],
        "srgb": [[x, float(colour.models.eotf_inverse_sRGB(x))] for x in linear],
        "matrix": np.linalg.inv(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ).tolist(),
    }
    with open(os.path.join(HERE, "colour_science.json"), "w", encoding="utf-8") as f:
        text = json.dumps(json.loads(json.dumps(document), parse_float=lambda x: float(f"{float(x):.13g}")), indent=None)
        f.write(text.replace('}, {"xyz"', '},\n{"xyz"').replace('], "', '],\n"') + "\n")


main()
