#!/usr/bin/env python3
"""Checks the readers of gridded.py against numbers written by hand, and on every gridded fixture against counts that
the files state. Usage: gridded_check.py"""
import json
import math
import os
import struct
import sys
import tempfile
import unittest

import numpy as np

import gridded

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def ies(kind, vertical, horizontal, numbers, tag="IESNA:LM-63-2002", head="1 -1 2"):
    lists = "\n".join(" ".join(map(str, numbers)) for numbers in (vertical, horizontal, numbers))
    counts = f"{len(vertical)} {len(horizontal)}"
    return f"{tag}\n[TEST] 1\nTILT=NONE\n{head} {counts} {kind} 2 0 0 0\n0.5 3 0\n{lists}\n".encode()


def ldt(symmetry, numbers):
    lines = ["company", "3", str(symmetry), "4", "90", "2", "90", "r", "l", "n", "f", "d", *["0"] * 9]
    lines += ["100", "100", "2,5", "0", "1", "1", "lamp", "400", "", "", "9", *["0"] * 10]
    lines += ["0", "90", "180", "270", "0", "90", *map(str, numbers)]
    return "\r\n".join(lines).encode()


class Luminaires(unittest.TestCase):
    def test_type_c_and_its_factors(self):
        found = gridded.lm63(ies(1, [0, 90], [0, 180, 360], [1, 2, 3, 4, 5, 6]))
        self.assertEqual(found.wo.tolist(), [[180, 0], [90, 0], [180, 180], [90, 180], [180, 360], [90, 360]])
        self.assertEqual(found.grids, [{"phi_o": 3, "theta_o": 2}])
        self.assertEqual(found.values[:, 0].tolist(), [1, 2, 3, 4, 5, 6])
        # Nadir three times, C0 and C360 at the horizon.
        self.assertEqual(found.expected()[:, 0].tolist(), [3, 4, 3, 4, 3, 4])
        old = gridded.lm63(ies(1, [0, 90], [0], [1, 2], tag="IESNA91"))
        self.assertEqual(old.values[:, 0].tolist(), [3, 6])

    def test_types_a_and_b(self):
        # H 0 and 90, V -90 and 0: type B looks along (-1, 0, 0) and down, then twice along -y.
        found = gridded.lm63(ies(2, [-90, 0], [0, 90], [1, 2, 3, 5]))
        np.testing.assert_allclose(found.wo, [[90, 180], [180, 0], [90, -90], [90, -90]], atol=1e-12)
        self.assertEqual(found.expected()[:, 0].tolist(), [1, 2, 4, 4])
        # Type A: V -90 is nadir whatever H; H 90 at V 0 is -y.
        found = gridded.lm63(ies(3, [-90, 0], [0, 90], [1, 2, 3, 5]))
        np.testing.assert_allclose(found.wo, [[180, 0], [90, 0], [180, 0], [90, -90]], atol=1e-12)
        self.assertEqual(found.expected()[:, 0].tolist(), [2, 2, 2, 5])

    def test_eulumdat_by_symmetry(self):
        for symmetry, planes in ((0, [0, 90, 180, 270]), (1, [0]), (2, [0, 90, 180]), (3, [270, 0, 90]), (4, [0, 90])):
            numbers = list(range(1, 2 * len(planes) + 1))
            found = gridded.eulumdat(ldt(symmetry, numbers))
            self.assertEqual(found.wo[::2].tolist(), [[180, c] for c in planes])
            # 2.5 · 400 / 1000 = 1.
            self.assertEqual(found.values[:, 0].tolist(), numbers)
            self.assertEqual(found.wo[1].tolist(), [90, planes[0]])


class Surfaces(unittest.TestCase):
    def test_mbsdf(self):
        head = b"NVIDIA ARC MBSDF V1\nname=\"x\"\n"
        values = struct.pack("<12f", *range(1, 13))
        block = struct.pack("<III", 0, 2, 3) + values
        found = gridded.mbsdf(head + b"MBSDF_DATA_REFLECTION=\n" + block)
        self.assertEqual(found.wi[::3].tolist(), [[0, 0], [0, 0], [45, 0], [45, 0]])
        self.assertEqual(found.wo[:4].tolist(), [[0, 0], [0, 90], [0, 180], [45, 0]])
        # The outgoing pole is stated three times.
        self.assertEqual(found.expected()[:6, 0].tolist(), [2, 2, 2, 4, 5, 6])
        both = gridded.mbsdf(head + b"MBSDF_DATA=\n" + block + b"MBSDF_DATA_TRANSMISSION=\n" + block)
        self.assertEqual(both.wo[12:16].tolist(), [[180, 0], [180, 90], [180, 180], [135, 0]])
        self.assertEqual(len(gridded.mbsdf(head + b"MBSDF_DATA=\n" + block, "brdf").values), 12)

    def test_csv(self):
        text = b"""# radiometric-csv: 1
# quantity: brdf
# angle_unit: rad
# cosine_included: true
theta_i,phi_i,theta_o,phi_o,lambda,value
0,0,0,0,500,1
0,0,0,0,600,2
0,0,1.0471975511965976,0,600,3
0,0,1.0471975511965976,0,500,
"""
        found = gridded.radiometric_csv(text)
        self.assertEqual((found.spectral, len(found.values)), ([500, 600], 2))
        np.testing.assert_allclose(found.values, [[1, 2], [np.nan, 6]])
        np.testing.assert_allclose(found.wo, [[0, 0], [60, 0]])
        wide = b"# quantity: reflectance-factor\n# isotropic: true\ntheta_i,phi_i,theta_o,phi_o,v0.6,v0.5\n9,30,5,40,1,2\n"
        found = gridded.radiometric_csv(b"# wavelength_unit: um\n" + wide)
        np.testing.assert_allclose(found.values, [[2 / math.pi, 1 / math.pi]])
        self.assertEqual((found.spectral, found.wi.tolist(), found.wo.tolist()), ([500, 600], [[9, 0]], [[5, 10]]))

    def test_arrays(self):
        manifest = {"quantity": "brdf", "cosine_included": True, "axes": [
            {"name": "theta_i", "values": [10]}, {"name": "theta_o", "values": [0, 60]},
            {"name": "phi_o", "values": [0, 180, 360]}, "lambda:400:100:2"]}
        values = np.arange(1, 13, dtype=np.float32).reshape(1, 2, 3, 2)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a.npy")
            np.save(path, values)
            with open(os.path.join(folder, "a.axes.json"), "w") as file:
                json.dump(manifest, file)
            found = gridded.read(path)
        self.assertEqual((found.spectral, found.wi[0].tolist()), ([400, 500], [10, 0]))
        self.assertEqual(found.wo[-1].tolist(), [60, 360])
        np.testing.assert_allclose(found.values[3:], [[14, 16], [18, 20], [22, 24]])
        np.testing.assert_allclose(found.expected(), [[3, 4]] * 3 + [[18, 20], [18, 20], [18, 20]])


class Rule(unittest.TestCase):
    def test_errors_are_taken_against_the_mean_as_often_as_it_is_stated(self):
        wo = [[180, 0], [180, 90], [90, 0], [90, 360], [80, 0], [70, 0], [60, 0]]
        samples = gridded.Samples(None, wo, [0.9, 1.1, 2, 2, 4, 0, np.nan])
        self.assertEqual(samples.expected()[:6, 0].tolist(), [1, 1, 2, 2, 4, 0])
        self.assertAlmostEqual(samples.contradiction(), 100 * math.sqrt(0.02 / 4))
        exact = [1, 1, 2, 2, 4, 7, 7]
        self.assertEqual(gridded.er_l2(samples, exact), 0)
        # 10 % at the pole, which counts twice of five.
        self.assertAlmostEqual(gridded.er_l2(samples, [1.1, 1.1, 2, 2, 4, 0, 0]), 0.1 * math.sqrt(2 / 5))
        self.assertAlmostEqual(gridded.er_l2(samples, [1, 1, 2, 2, 4.4, 0, 0], floor=4), 0.1)


class Fixtures(unittest.TestCase):
    def test_every_gridded_fixture_is_read(self):
        for path, rows, channels in [
            ("data/aerolamp.ies", 33 * 37, 1),
            ("data/ushio_b1.ies", 17 * 37, 1),
            ("data/nukit_lantern.ies", 361 * 17, 1),
            ("data/carpaint_blue.mbsdf", 45 * 45 * 90, 3),
            ("tests/fixtures/ies/examp1.ies", None, 1),
            ("tests/fixtures/ies/example_modules.ies", 16, 1),
            ("tests/fixtures/ies/iesna2002_example_typec.ies", None, 1),
            ("tests/fixtures/ies/test.ies", 10, 1),
            ("tests/fixtures/ldt/absolute.ldt", 37, 1),
            ("tests/fixtures/ldt/example.ldt", None, 1),
            ("tests/fixtures/ldt/multiple_lamp_sets.ldt", 37, 1),
            ("tests/fixtures/ldt/symmetry_to_c0c180.ldt", None, 1),
            ("tests/fixtures/ldt/symmetry_to_c90c270.ldt", None, 1),
            ("tests/fixtures/mbsdf/test_reflection_scalar_theta_2_phi_3.mbsdf", 12, 1),
            ("tests/fixtures/mbsdf/test_rgb_theta_2_phi_3.mbsdf", 12, 3),
            ("tests/fixtures/mbsdf/test_transmission_scalar_theta_2_phi_4.mbsdf", 16, 1),
            ("tests/fixtures/instruments/brf_directions.csv", 4, 2),
        ]:
            samples = gridded.read(os.path.join(ROOT, path))
            self.assertEqual(samples.values.shape, (rows or len(samples.values), channels), path)
            self.assertGreater(len(samples.values), 3, path)
            if not path.endswith(".csv"):
                counts = [math.prod(grid.values()) for grid in samples.grids]
                self.assertEqual(sum(counts), len(samples.values), path)

    def test_lamps_contradict_themselves_by_less_than_a_fifth_of_a_per_cent_at_their_poles(self):
        for name in ("aerolamp", "ushio_b1", "nukit_lantern"):
            found = gridded.read(os.path.join(ROOT, "data", f"{name}.ies")).contradiction()
            self.assertTrue(0 <= found < 0.3, f"{name}: {found}")


if __name__ == "__main__":
    sys.argv[1:] or unittest.main(verbosity=0)
    sys.exit(__doc__)
