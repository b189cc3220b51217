#!/usr/bin/env python3
"""Reads TM-33 luminaires and Zemax BSDF files with parsers of its own and compares every sample with the library's.

    tm33_zemax.py SAMPLES           the built example `samples` of crates/formats
    tm33_zemax.py --make            writes the files of tests/fixtures/tm33 and tests/fixtures/zemax anew

Directions must agree within 1e-6 degrees, values within 1e-5 of the largest one beside them. The parser of TM-33 folds
each direction back to the planes that the file lists; that of Zemax files spans directions by vectors about the
specular ray. The same luminaire is also written in other ways (symmetries, encodings, prefixes, an archive), which must
give the same samples, and damaged ones must be refused with their place, fast and in little memory. Needs only the
standard library. Exit code 0 if all agree, 1 if not, 2 if something is missing.
"""
import csv
import math
import random
import re
import resource
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
import zipfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
FIXTURES = ROOT / "tests/fixtures"
TOLERANCE = 1e-5
LUMENS_PER_WATT = 683.002

# ---- Files.


def make():
    (FIXTURES / "tm33").mkdir(exist_ok=True)
    (FIXTURES / "zemax").mkdir(exist_ok=True)
    downlight, street, grow = downlight_xml(), street_xml(), grow_xml()
    for name, text in [("downlight.xml", downlight), ("street.xml", street), ("grow.xml", grow)]:
        (FIXTURES / "tm33" / name).write_text(text)
    with zipfile.ZipFile(FIXTURES / "tm33/product.gldf", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in [
            ("product.xml", '<?xml version="1.0"?>\n<Root xmlns:x="https://gldf.io/xsd/gldf/1.0.0/gldf.xsd"/>\n'),
            ("ldc/downlight.iesxml", downlight),
            ("ldc/street.iesxml", street),
        ]:
            archive.writestr(zipfile.ZipInfo(name, (2026, 1, 1, 0, 0, 0)), text, zipfile.ZIP_DEFLATED)
    (FIXTURES / "zemax/satin.bsdf").write_text(satin())
    (FIXTURES / "zemax/brushed.bsdf").write_text(brushed())
    (FIXTURES / "zemax/film.bsdf").write_text(film())


def downlight_xml():
    """A downlight of two planes of symmetry with a warm spectrum, revision 23."""
    planes, gammas = [0, 22.5, 45, 67.5, 90], [5 * i for i in range(19)]
    beam = lambda c, g: math.cos(math.radians(g)) ** (4 + c / 45) if g < 90 else 0.0
    data = "\n".join(f'        <IntData h="{c:g}" v="{g:g}">{800 * beam(c, g):.3f}</IntData>' for c in planes for g in gammas)
    bands = range(400, 721, 10)
    power = lambda nm: 0.35 * math.exp(-(((nm - 452) / 11) ** 2)) + math.exp(-(((nm - 605) / 62) ** 2))
    spectrum = "\n".join(f'        <PwrData w="{nm}">{power(nm):.5f}</PwrData>' for nm in bands)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<IESTM33-22>
  <Version>1.1</Version>
  <Header>
    <Manufacturer>Made up</Manufacturer>
    <CatalogNumber>D-4</CatalogNumber>
    <Description>Downlight with two planes of symmetry</Description>
    <Laboratory>none</Laboratory>
    <ReportNumber>1</ReportNumber>
    <ReportDate>2026-01-01</ReportDate>
  </Header>
  <Luminaire>
    <Dimensions><Length>0.2</Length><Width>0.2</Width><Height>0.1</Height></Dimensions>
    <NumEmitter>1</NumEmitter>
  </Luminaire>
  <Equipment>
    <Gonioradiometer><Type>IES_C</Type></Gonioradiometer>
  </Equipment>
  <Emitter>
    <Quantity>1</Quantity>
    <Description>LED, warm</Description>
    <InputWattage>12.5</InputWattage>
    <LuminousData>
      <LuminousIntensity>
        <AbsolutePhotometry>true</AbsolutePhotometry>
        <Symm>Symm_Quad</Symm>
        <Multiplier>1.25</Multiplier>
        <NumberMeasured>{len(planes) * len(gammas)}</NumberMeasured>
        <NumberHorz>{len(planes)}</NumberHorz>
        <NumberVert>{len(gammas)}</NumberVert>
{data}
      </LuminousIntensity>
      <LuminousFlux>1065</LuminousFlux>
    </LuminousData>
    <SpectralData>
      <EmitterSpectral>
        <NumberWavelength>{len(bands)}</NumberWavelength>
{spectrum}
      </EmitterSpectral>
    </SpectralData>
  </Emitter>
</IESTM33-22>
"""


def street_xml():
    """A street luminaire, symmetric about the plane 90-270, in the older layout and in the order of gamma."""
    planes, gammas = [90, 105, 120, 150, 180, 210, 240, 255, 270], [0, 10, 20, 30, 40, 50, 60, 65, 70, 80, 90]
    value = lambda c, g: (120 + g * g / 12 * (1 - math.cos(math.radians(c)))) * max(0.0, math.cos(math.radians(g))) ** 0.5
    data = "\n".join(f'      <IntensityData horz="{c}" vert="{g}">{value(c, g):.4g}</IntensityData>' for g in gammas for c in planes)
    return f"""<?xml version="1.0"?>
<LuminaireOpticalData version="1.0" xmlns="http://www.ies.org/tm-33">
  <Header><Manufacturer>Made up</Manufacturer><Description>Street luminaire</Description></Header>
  <Equipment><Goniometer><GoniometerType>Type C</GoniometerType></Goniometer></Equipment>
  <Emitter>
    <Quantity>1</Quantity>
    <RatedLumens>3000</RatedLumens>
    <InputWatts>28</InputWatts>
    <IntensityDistribution>
      <PhotometryType>C</PhotometryType>
      <Metric>Luminous</Metric>
{data}
    </IntensityDistribution>
  </Emitter>
</LuminaireOpticalData>
"""


def grow_xml():
    """Two emitters of a grow light: one in W/sr with a spectrum, one in photons without symmetry."""
    gammas = [10 * i for i in range(19)]
    side = lambda c, g: math.sin(math.radians(g)) * math.cos(math.radians(c - 30))
    value = lambda c, g: max(0.0, math.cos(math.radians(g))) * (30 + 5 * side(c, g))
    data = lambda planes: "\n".join(f'<IntData h="{c}" v="{g}">{value(c, g):.5f}</IntData>' for c in planes for g in gammas)
    wavelengths = list(range(420, 701, 20))
    values = [math.exp(-(((nm - 660) / 25) ** 2)) + 0.4 * math.exp(-(((nm - 450) / 20) ** 2)) for nm in wavelengths]
    return f"""<IESTM33>
<Version>1.0</Version>
<Header><Manufacturer>Made up</Manufacturer><Description>Grow light of two parts</Description></Header>
<Equipment><Gonioradiometer><Type>CIE_C</Type></Gonioradiometer></Equipment>
<Emitter><Quantity>1</Quantity><Description>red</Description><InputWattage>90</InputWattage>
<RadiantData><MinWavelength>400</MinWavelength><MaxWavelength>800</MaxWavelength>\
<RadiantIntensity><Absolute>true</Absolute>
<NumberMeasured>19</NumberMeasured><NumberHorz>1</NumberHorz><NumberVert>19</NumberVert>
{data([0])}
</RadiantIntensity></RadiantData>
<SpectralDistribution><Wavelengths>{" ".join(map(str, wavelengths))}</Wavelengths>
<Values>{" ".join(f"{v:.6f}" for v in values)}</Values><Units>Relative</Units></SpectralDistribution>
</Emitter>
<Emitter><Quantity>1</Quantity><Description>all</Description><InputWattage>40</InputWattage>
<PhotonData><MinWavelength>400</MinWavelength><MaxWavelength>700</MaxWavelength>\
<PhotonIntensity><Absolute>true</Absolute>
{data(range(0, 361, 45))}
</PhotonIntensity></PhotonData>
</Emitter>
</IESTM33>
"""


def zemax(comment, symmetry, scatter, rotations, incidences, azimuths, radials, channels, value):
    """The text of a Zemax BSDF file of `value(channel, rotation, direction in, direction out)`."""
    angles = lambda key, listed: f"{key}  {len(listed)}\n" + "\t".join(f"{angle:g}" for angle in listed) + "\n"
    text = f"# {comment}\nSource  Measured\nSymmetry  {symmetry}\n"
    text += f"SpectralContent  {'Monochrome' if len(channels) == 1 else 'XYZ'}\nScatterType  {scatter}\n"
    text += angles("SampleRotation", rotations) + angles("AngleOfIncidence", incidences)
    text += angles("ScatterAzimuth", azimuths) + angles("ScatterRadial", radials)
    whole = 180 if symmetry == "PlaneSymmetrical" else 360
    for channel in channels:
        text += f"\n{channel}\nDataBegin\n"
        for rotation in rotations:
            for incidence in incidences:
                out = lambda p, s: about_specular(incidence, p, s)
                table = [[value(channel, rotation, incidence, out(p, s)) if out(p, s)[2] >= 0 else 0.0 for s in radials] for p in azimuths]
                # The integral over a fine grid.
                tis, step = 0.0, 2
                for p in range(0, whole, 2 * step):
                    for s in range(1, 180, step):
                        direction = out(p + step, s)
                        if direction[2] > 0:
                            ring = math.cos(math.radians(s - 1)) - math.cos(math.radians(s + 1))
                            tis += value(channel, rotation, incidence, direction) * direction[2] * ring * math.radians(2 * step)
                text += f"TIS {tis * 360 / whole:.4f}\n"
                text += "".join("\t".join(f"{number:.4e}" for number in row) + "\n" for row in table)
        text += "DataEnd\n"
    return text


def lobe(incidence, direction, width):
    specular = about_specular(incidence, 0, 0)
    cosine = sum(a * b for a, b in zip(direction, specular))
    return math.exp((cosine - 1) / width**2)


def satin():
    value = lambda _, __, incidence, out: 0.12 + (0.8 + incidence / 60) * lobe(incidence, out, 0.25)
    radials = [0, 3, 6, 10, 15, 20, 30, 40, 55, 70, 90, 110, 130]
    azimuths = list(range(0, 181, 15))
    comment = "Satin paint, made up\n# Wavelength: 550 nm"
    return zemax(comment, "PlaneSymmetrical", "BRDF", [0], [0, 15, 30, 45, 60], azimuths, radials, ["Monochrome"], value)


def brushed():
    def value(_, rotation, incidence, out):
        width = 0.2 + 0.1 * math.cos(math.radians(2 * rotation))
        return 0.05 + lobe(incidence, out, width) * (1 + 0.3 * out[1])

    radials, azimuths = [0, 5, 10, 20, 30, 50, 80], list(range(0, 361, 30))
    rotations = list(range(0, 361, 45))
    return zemax("Brushed metal, made up", "ASymmetrical4D", "BRDF", rotations, [10, 40], azimuths, radials, ["Monochrome"], value)


def film():
    tint = {"TristimulusX": 0.9, "TristimulusY": 1.0, "TristimulusZ": 0.7}
    value = lambda channel, _, incidence, out: tint[channel] * (0.05 + 2 * lobe(incidence, out, 0.15))
    radials, azimuths = [0, 2, 5, 10, 20, 40, 70], list(range(0, 181, 30))
    return zemax("Film, made up", "PlaneSymmetrical", "BTDF", [0], [0, 30, 60], azimuths, radials, list(tint), value)


# ---- Parsers.


def about_specular(incidence, azimuth, radial):
    """Direction at `radial` degrees from the mirror image of light from azimuth 0; azimuth 0 leads to the normal."""
    i = math.radians(incidence)
    mirror = (-math.sin(i), 0.0, math.cos(i))
    upward = (math.cos(i), 0.0, math.sin(i))
    aside = tuple(mirror[j - 2] * upward[j - 1] - mirror[j - 1] * upward[j - 2] for j in range(3))
    s, p = math.radians(radial), math.radians(azimuth)
    along, across = math.sin(s) * math.cos(p), math.sin(s) * math.sin(p)
    return tuple(math.cos(s) * m + along * u + across * a for m, u, a in zip(mirror, upward, aside))


def zemax_samples(text, channel):
    """Values of a file by pair of directions."""
    words = " ".join(line for line in text.splitlines() if not line.lstrip().startswith("#")).split()
    lists, at = {}, 0
    while words[at] not in ("Monochrome", "TristimulusX"):
        if words[at] in ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"):
            count = int(words[at + 1])
            lists[words[at]] = [float(word) for word in words[at + 2 : at + 2 + count]]
            at += 2 + count
        else:
            lists[words[at]] = words[at + 1]
            at += 2
    numbers = iter(words[words.index(channel, at) + 2 :])
    found = defaultdict(list)
    for rotation in lists["SampleRotation"]:
        for incidence in lists["AngleOfIncidence"]:
            assert next(numbers) == "TIS"
            next(numbers)
            for azimuth in lists["ScatterAzimuth"]:
                for radial in lists["ScatterRadial"]:
                    value = float(next(numbers))
                    x, y, z = about_specular(incidence, azimuth, radial)
                    if z < -1e-12:
                        continue
                    theta, phi = math.degrees(math.acos(min(1.0, z))), math.degrees(math.atan2(y, x)) + rotation
                    if math.hypot(x, y) < 1e-9:
                        theta, phi = 0.0, 0.0
                    if lists["ScatterType"] == "BTDF":
                        theta = 180 - theta
                    found[key((incidence, rotation, theta, phi))].append(value)
    assert next(numbers) == "DataEnd"
    return {place: [sum(values) / len(values)] for place, values in found.items()}


def local(element):
    return element.tag.rsplit("}", 1)[-1]


def tm33_samples(text, emitter, with_spectrum):
    """Intensities of a file, or spectral ones, by direction on every plane that its symmetry gives."""
    root = ElementTree.fromstring(text)
    part = [child for child in root if local(child) == "Emitter"][emitter]
    listed, factor, points, lists = {}, 1.0, [], {}
    for element in part.iter():
        name, attributes = local(element), element.attrib
        if name in ("IntData", "IntensityData"):
            place = (float(attributes.get("h", attributes.get("horz"))), float(attributes.get("v", attributes.get("vert"))))
            listed[place] = float(element.text)
        elif name == "Multiplier":
            factor = float(element.text)
        elif name == "PwrData":
            points.append((float(attributes["w"]), float(element.text)))
        elif name in ("Wavelengths", "Values"):
            lists[name] = [float(word) for word in element.text.split()]
    points += zip(lists.get("Wavelengths", []), lists.get("Values", []))
    is_luminous = any(local(e) in ("LuminousData", "IntensityDistribution") for e in part)
    spectrum = spectral_factors(points, is_luminous) if with_spectrum else [1.0]
    planes = sorted({c for c, _ in listed})
    first, last = planes[0], planes[-1]
    if len(planes) == 1:
        turns = {0.0: planes[0]}
    elif (first, last) == (0, 90):
        turns = {image: c for c in planes for image in (c, 180 - c)}
    elif (first, last) == (90, 270):
        turns = {image % 360: c for c in planes for image in (c, (180 - c if c <= 180 else 540 - c))}
    else:
        turns = {c: c for c in planes if c < 360}
    found = {}
    for (c, gamma), value in listed.items():
        for image in (image for image, plane in turns.items() if plane == c):
            found[key((None, None, 180 - gamma, image))] = [value * factor * band for band in spectrum]
    return found


def spectral_factors(points, is_luminous):
    """Factor of each band: the spectrum over its integral, for candela over 683 lm/W and V(lambda)."""
    points = sorted(points)
    at = lambda table, nm: interpolate(table, nm)
    if is_luminous:
        with open(ROOT / "data/cmfs_CIE_1931_2_Degree_Standard_Observer.csv") as file:
            v = [(float(row["wavelength_nm"]), float(row["ybar"])) for row in csv.DictReader(file)]
        nodes = sorted({nm for nm, _ in points} | {nm for nm, _ in v if points[0][0] <= nm <= points[-1][0]})
        curve = [(nm, LUMENS_PER_WATT * at(points, nm) * at(v, nm)) for nm in nodes]
    else:
        curve = points
    total = sum((b[0] - a[0]) * (a[1] + b[1]) / 2 for a, b in zip(curve, curve[1:]))
    return [value / total for _, value in points]


def interpolate(table, nm):
    for (a, low), (b, high) in zip(table, table[1:]):
        if a <= nm <= b:
            return low + (high - low) * (nm - a) / (b - a)
    return 0.0


# ---- Comparison.


def key(angles):
    """Place of a sample: angles in steps of 1e-6 degrees, azimuths within a turn, none at a pole."""
    theta_i, phi_i, theta_o, phi_o = angles
    place = []
    for theta, phi in ((theta_i, phi_i), (theta_o, phi_o)):
        place += [None, None] if theta is None else [round(theta * 1e6), round(phi % 360 * 1e6) % 360_000_000]
    return tuple(place)


def library(samples, path, *options):
    done = subprocess.run([samples, path, *options], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{path} {' '.join(options)}: {done.stderr.strip()}")
    head, *rows = done.stdout.splitlines()
    found = {}
    for row in rows:
        cells = row.split(",")
        angles = [float(cell) if cell else None for cell in cells[:4]]
        found[key(angles)] = [float(cell) for cell in cells[4:]]
    return head, found


def near(expected, place):
    """The expected values at a place, which may be rounded to either side."""
    for around in [place] + [
        tuple(None if p is None else p + d for p, d in zip(place, steps))
        for steps in [(0, 0, a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    ]:
        if around in expected:
            return expected[around]
    return None


def compare(name, head, expected, found, poles_average):
    worst, missing = 0.0, len(expected) - len(found)
    largest = max(max(map(abs, values)) for values in expected.values())
    for place, values in found.items():
        wanted = near(expected, place)
        if wanted is None or len(wanted) != len(values):
            missing += 1
            continue
        if poles_average and place[2] in (0, 180_000_000):
            of_pole = [v for p, v in expected.items() if p[2] == place[2]]
            wanted = [sum(band) / len(band) for band in zip(*of_pole)]
        for a, b in zip(wanted, values):
            worst = max(worst, abs(a - b) / max(abs(a), 1e-3 * largest))
    agrees = missing == 0 and worst <= TOLERANCE
    print(f"{'ok ' if agrees else 'NOT'} {name}: {head}, {len(found)} directions, largest deviation {worst:.1e}")
    return agrees


# ---- The same luminaire in other words.


def plain_xml(planes, symmetry, value, head="", gammas=range(0, 181, 15), count=None):
    """A luminaire of revision 23 with the intensities `value(c, gamma)`."""
    data = [f'<IntData h="{c}" v="{g}">{value(c, g):.6f}</IntData>' for c in planes for g in gammas]
    count = len(planes) if count is None else count
    return (
        '<?xml version="1.0"?>\n<IESTM33-22><Version>1.1</Version><Header><Manufacturer>A</Manufacturer></Header>\n'
        f"<Emitter><Quantity>1</Quantity><Description>d</Description><LuminousData><LuminousIntensity>\n"
        f"<AbsolutePhotometry>true</AbsolutePhotometry><Symm>{symmetry}</Symm>{head}<NumberHorz>{count}</NumberHorz>\n"
        + "\n".join(data)
        + "\n</LuminousIntensity></LuminousData></Emitter></IESTM33-22>\n"
    )


def quadrant_value(c, gamma):
    """Intensity with two planes of symmetry."""
    return 10 + 90 * math.cos(math.radians(gamma / 2)) ** 2 * (1 + 0.3 * math.sin(math.radians(gamma)) * math.cos(math.radians(2 * c)))


def flux_of(found):
    """Flux in lumens of samples on whole planes: trapezia in the polar angle and in the azimuth."""
    rings = defaultdict(dict)
    for (_, __, theta, phi), values in found.items():
        rings[theta / 1e6][phi / 1e6] = values[0]
    mean = {}
    for theta, ring in rings.items():
        if len(ring) > 1 and max(ring) <= 180:
            ring |= {360 - phi: value for phi, value in ring.items() if 0 < phi < 180}
        phis = sorted(ring)
        turns = [(b - a) % 360 or 360 for a, b in zip(phis, phis[1:] + phis[:1])]
        mean[theta] = sum(t * (ring[a] + ring[b]) / 2 for t, a, b in zip(turns, phis, phis[1:] + phis[:1])) / 360
    total, thetas = 0.0, sorted(mean)
    for a, b in zip(thetas, thetas[1:]):
        for i in range(100):
            theta = a + (b - a) * (i + 0.5) / 100
            between = mean[a] + (mean[b] - mean[a]) * (i + 0.5) / 100
            total += 2 * math.pi * between * math.sin(math.radians(theta)) * math.radians((b - a) / 100)
    return total


def same(name, expected, found):
    """Returns true if two sets of samples agree where they share directions, which must be those of `found`."""
    shared = [place for place in found if place in expected]
    worst = max((abs(a - b) / abs(a) for p in shared for a, b in zip(expected[p], found[p]) if a), default=1.0)
    agrees = len(shared) == len(found) and worst <= TOLERANCE
    print(f"{'ok ' if agrees else 'NOT'} {name}: {len(found)} directions, largest deviation {worst:.1e}")
    return agrees


def other_words(samples, folder):
    """Returns true if the ways to write one luminaire give the same samples."""

    def read(name, content, *options):
        path = folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return library(samples, path, *options)[1]

    circle = list(range(0, 361, 15))
    whole_text = plain_xml(circle, "Symm_None", quadrant_value)
    whole = read("whole.xml", whole_text)
    agree = True
    for symmetry, planes in [
        ("Symm _ Quad", range(0, 91, 15)),
        ("Symm_Bi_0", range(0, 181, 15)),
        ("Symm _ Bi _90", range(90, 271, 15)),
        ("Symm_None", circle[:-1]),
        ("Symm_Quad", range(0, 181, 15)),
    ]:
        agree &= same(f"{symmetry}, {len(planes)} planes", whole, read("part.xml", plain_xml(list(planes), symmetry, quadrant_value)))
    lines = whole_text.split("\n")
    data = [line for line in lines if "<IntData" in line]
    random.Random(1).shuffle(data)
    shuffled = "\n".join(lines[:4] + data + lines[-2:])
    older = re.sub(r'<IntData h="(.*?)" v="(.*?)">(.*?)</IntData>', r'<IntensityData vert="\2" horz="\1">\3</IntensityData>', whole_text)
    older = older.replace("LuminousData>", "IntensityDistribution>").replace("<LuminousIntensity>", "").replace("</LuminousIntensity>", "")
    older = older.replace("IESTM33-22", "LuminaireOpticalData")
    prefixed = re.sub(r"<(/?)([A-Z])", r"<\1t:\2", whole_text).replace("<t:IESTM33-22>", '<t:IESTM33-22 xmlns:t="urn:x">')
    doubled = plain_xml(circle, "Symm_None", lambda c, g: quadrant_value(c, g) / 2.5, "<Multiplier>2.5</Multiplier>")
    for name, content in {
        "byte order mark": "\ufeff" + whole_text,
        "UTF-16": whole_text.encode("utf-16"),
        "CR LF": whole_text.replace("\n", "\r\n"),
        "a line before the declaration": "Written by a tool, 12 files <ok>\n" + whole_text,
        "namespace prefix": prefixed,
        "another order": shuffled,
        "older layout": older,
        "multiplier": doubled,
        "root of UNI 11733": whole_text.replace("IESTM33-22", "UNI11733"),
        "numbers of angles not counted": plain_xml(circle, "Symm_None", quadrant_value, count=0),
    }.items():
        agree &= same(name, whole, read("other.xml", content))
    archive = folder / "many.gldf"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("product.xml", '<?xml version="1.0"?><Root xmlns:x="https://gldf.io/xsd/gldf/1.0.0/gldf.xsd"/>')
        for i in range(243):
            file.writestr(f"ldc/star_{i}.iesxml", whole_text)
    agree &= same("one of 243 in an archive", whole, library(samples, archive, "member=star_117.iesxml")[1])
    # The integral of a distribution with a closed form: 10 + 90·cos²(γ/2) over the sphere makes 4π·55.
    found, wanted = flux_of(whole), 4 * math.pi * 55
    agree &= abs(found / wanted - 1) < 5e-3
    print(f"{'ok ' if abs(found / wanted - 1) < 5e-3 else 'NOT'} flux: {found:.2f} lm, {wanted:.2f} expected")
    found = flux_of(library(samples, FIXTURES / "tm33/downlight.xml", "unit=cd")[1])
    agree &= abs(found / 1065 - 1) < 5e-3
    print(f"{'ok ' if abs(found / 1065 - 1) < 5e-3 else 'NOT'} flux of downlight.xml: {found:.2f} lm, the file states 1065")
    return agree


def refused(samples, folder):
    """Returns true if damaged files are refused with their place and words, fast and in little memory."""
    good = plain_xml([0, 45, 90], "Symm_Quad", quadrant_value)
    spectrum = "<SpectralData><EmitterSpectral><PwrData w=\"400\">1</PwrData><PwrData w=\"5OO\">1</PwrData></EmitterSpectral></SpectralData>"
    bsdf = (FIXTURES / "zemax/satin.bsdf").read_text()
    huge = 10**9
    agree = True
    for name, text, place, words in [
        ("element cut off", good[: len(good) // 2], r"line \d+", "expected its end"),
        ("attribute", good.replace('h="45" v="30"', 'h="4S" v="30"'), r"line 20, column 1", "`4S` in IntData"),
        ("intensity", good.replace(">100.000000<", ">1OO<", 1), r"line 5, column 1", "`1OO`"),
        ("missing intensity", good.replace('<IntData h="45" v="30">', '<IntData h="46" v="30">').replace("Horz>3", "Horz>4"), r"line 3", "4 horizontal"),
        ("second intensity", good.replace('h="45" v="30"', 'h="45" v="15"'), r"line 20", "a second intensity"),
        ("NumberHorz", good.replace("Horz>3", f"Horz>{huge}"), r"line 4", f"NumberHorz {huge}, expected 3"),
        ("NumberVert", good.replace("<NumberHorz>", f"<NumberVert>{huge}</NumberVert><NumberHorz>"), r"line 4", f"NumberVert {huge}"),
        ("symmetry", good.replace("Symm_Quad", "Symm_None"), r"line 4", "expected quadrant symmetric"),
        ("goniometer", good.replace("<Emitter>", "<Equipment><Gonioradiometer><Type>IES_B</Type></Gonioradiometer></Equipment><Emitter>"), r"line 3", "`IES_B`"),
        ("spectrum", good.replace("</Emitter>", spectrum + "</Emitter>"), r"line \d+", "`5OO` in PwrData"),
        ("entity", good.replace(">A<", ">&x;<"), r"line 2", "entity"),
        ("document type", good.replace("<IESTM33", '<!DOCTYPE x SYSTEM "/etc/passwd"><IESTM33', 1), r"line 2", "document type"),
        ("nesting", good.replace("<Emitter>", "<Emitter>" + "<a>" * 100_000), r"line 3", "nested"),
        ("ScatterRadial", bsdf.replace("ScatterRadial  13", f"ScatterRadial  {13 * 10_000}"), r"line 13", "a whole number from 1"),
        ("AngleOfIncidence", bsdf.replace("AngleOfIncidence  5", f"AngleOfIncidence  {huge}"), r"line 9", "number of angles AngleOfIncidence"),
        ("value", bsdf.replace("9.2000e-01", "9.2O00e-01", 1), r"line 19, column 1", "`9.2O00e-01`"),
        ("a value too many", bsdf.replace("9.2000e-01", "9.2000e-01 1.0", 1), r"line \d+", "TIS and the next table"),
        ("end of the file", bsdf[:2500], r"line \d+", "the file ends"),
    ]:
        path = folder / "damaged"
        path.write_text(text)
        limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
        done = subprocess.run([samples, path], capture_output=True, text=True, check=False, timeout=20, preexec_fn=limit)
        told = done.stderr.strip()
        good_words = done.returncode in (1, 2) and re.search(place, told) and words in told
        print(f"{'ok ' if good_words else 'NOT'} {name}: {told.removeprefix(str(path))[:150]}")
        agree &= bool(good_words)
    return agree


def main(samples):
    samples = Path(samples).resolve()
    if not samples.exists():
        print(f"tm33_zemax.py: {samples} is missing; build the examples", file=sys.stderr)
        return 2
    agree = True
    for name, emitter, spectrum, options in [
        ("downlight.xml", 0, True, []),
        ("downlight.xml", 0, False, ["unit=cd"]),
        ("street.xml", 0, False, []),
        ("grow.xml", 0, True, ["column=1"]),
        ("grow.xml", 1, False, ["column=all"]),
    ]:
        path = FIXTURES / "tm33" / name
        head, found = library(samples, path, *options)
        agree &= compare(name, head, tm33_samples(path.read_text(), emitter, spectrum), found, True)
    head, found = library(samples, FIXTURES / "tm33/product.gldf", "member=downlight.iesxml")
    text = zipfile.ZipFile(FIXTURES / "tm33/product.gldf").read("ldc/downlight.iesxml").decode()
    agree &= compare("product.gldf", head, tm33_samples(text, 0, True), found, True)
    for name, channel, options in [
        ("satin.bsdf", "Monochrome", []),
        ("brushed.bsdf", "Monochrome", []),
        ("film.bsdf", "TristimulusY", ["column=Y"]),
        ("film.bsdf", "TristimulusZ", ["column=3"]),
    ]:
        path = FIXTURES / "zemax" / name
        head, found = library(samples, path, *options)
        agree &= compare(name, head, zemax_samples(path.read_text(), channel), found, False)
    with tempfile.TemporaryDirectory() as folder:
        agree &= other_words(samples, Path(folder))
        agree &= refused(samples, Path(folder))
    return 0 if agree else 1


if __name__ == "__main__":
    if sys.argv[1:] == ["--make"]:
        make()
    elif len(sys.argv) == 2:
        sys.exit(main(sys.argv[1]))
    else:
        sys.exit(__doc__)
