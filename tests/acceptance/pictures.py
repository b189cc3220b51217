"""Pictures of docs/ that checks draw: written when asked to, else compared with what would be drawn now.

Coordinates may differ by half a pixel, as the last digit of a logarithm depends on the machine; nothing else may.
"""
import os
import re

DOCS = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "docs")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
# Pixels by which a coordinate may differ from the one in the picture that is kept.
TOLERANCE = 0.5


def is_same(kept, drawn):
    """Tells if two SVGs have the same elements and words, at nearly the same places."""
    if NUMBER.sub("#", kept) != NUMBER.sub("#", drawn):
        return False
    return all(abs(float(a) - float(b)) <= TOLERANCE for a, b in zip(NUMBER.findall(kept), NUMBER.findall(drawn)))


def keep(name, drawn, is_written, command):
    """Writes an SVG into docs/, or returns what is wrong with the one that is there: None if it is up to date."""
    path = os.path.join(DOCS, name)
    if is_written:
        with open(path, "w") as file:
            file.write(drawn)
        return None
    with open(path) as file:
        return None if is_same(file.read(), drawn) else f"docs/{name} is out of date: {command}"
