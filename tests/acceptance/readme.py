#!/usr/bin/env python3
"""Writes what the program really prints into the README: the output below each `$ wavelume …`, and the figures.

Usage: readme.py BINARY [FIGURES.md]

The commands run in order in one scratch directory with the bundled data. FIGURES.md is written by run.py.
"""
import os
import re
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
README = os.path.join(ROOT, "README.md")


def output(command, directory, binary):
    """What `command` prints; the demo ends after its table, and only that is shown."""
    words = command.split()
    is_demo = words[1] == "demo"
    done = subprocess.run([binary, *words[1:], *(["--once"] if is_demo else [])], cwd=directory, capture_output=True)
    if done.returncode != 0:
        sys.exit(f"{command}: {done.stderr.decode().strip()}")
    text = done.stdout.decode()
    return text.split("\n\nthe lamp")[0] + "\n…\n" if is_demo else text


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__.splitlines()[2])
    binary = os.path.abspath(sys.argv[1])
    with open(README) as file:
        text = file.read()
    with tempfile.TemporaryDirectory() as directory:
        os.symlink(os.path.join(ROOT, "data"), os.path.join(directory, "data"))

        def block(found):
            command = found.group(1)
            return f"```console\n$ {command}\n{output(command, directory, binary)}```"

        text = re.sub(r"```console\n\$ (wavelume [^\n]*)\n.*?```", block, text, flags=re.DOTALL)
    if len(sys.argv) == 3:
        with open(sys.argv[2]) as file:
            figures = file.read()
        begin, end = "<!-- figures -->\n", "<!-- end of figures -->"
        before, rest = text.split(begin)
        text = before + begin + "\n" + figures + "\n" + end + rest.split(end)[1]
    with open(README, "w") as file:
        file.write(text)


if __name__ == "__main__":
    main()
