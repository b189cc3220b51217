#!/usr/bin/env python3
"""The cost of a process of its own for a short job: equal jobs with --isolate off and on, in turn.

    python3 tests/benches/isolation.py target/release/wavelume [--jobs 100] [--rounds 5]

Needs Python 3.9 and the standard library. A job makes a material of the spectrum of D65. Prints medians over all
rounds.
"""

import argparse
import json
import pathlib
import re
import statistics
import subprocess
import tempfile
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary", type=pathlib.Path)
    arguments.add_argument("--jobs", type=int, default=100, help="in one round")
    arguments.add_argument("--rounds", type=int, default=5)
    arguments = arguments.parse_args()
    times = {"off": [], "on": []}
    for _ in range(arguments.rounds):
        for when, found in times.items():
            found += round_of(arguments.binary.resolve(), when, arguments.jobs)
    off, on = (statistics.median(found) for found in times.values())
    print(f"{time.strftime('%Y-%m-%d')}: {1000 * off:.1f} ms a job in the worker, {1000 * on:.1f} ms in a process of its own")


def round_of(binary, when, jobs):
    with tempfile.TemporaryDirectory() as data:
        command = [binary, "serve", "--isolate", when, "--listen", "127.0.0.1:0", "--data", data]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            base = re.fullmatch(r"listening on (\S+)\n", server.stdout.readline())[1]
            spectrum = (ROOT / "data/illuminant_D65.csv").read_bytes()
            measurement = post(f"{base}/v1/measurements?filename=d65.csv", spectrum)["id"]
            body = json.dumps({"measurement": measurement, "target": {"er_l2": 0.01}}).encode()
            found = []
            for _ in range(jobs):
                start = time.perf_counter()
                job = post(f"{base}/v1/jobs", body, {"content-type": "application/json", "prefer": "wait=60"})
                found.append(time.perf_counter() - start)
                assert job["state"] == "succeeded", job
            return found
        finally:
            server.terminate()
            server.wait()


def post(url, body, headers={}):
    with urllib.request.urlopen(urllib.request.Request(url, body, headers)) as response:
        return json.load(response)


if __name__ == "__main__":
    main()
