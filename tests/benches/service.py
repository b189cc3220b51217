#!/usr/bin/env python3
"""The service under load, beside nginx: batches as f32, one spectrum at a steady rate, a small file.

    python3 tests/benches/service.py target/release/wavelume [--seconds 5] [--rounds 3] [--only batch,latency,blob]
    [--keys] [--logs] [--hold]

Needs Python 3.9 and the standard library; for the file also nginx and wrk (Debian: apt install nginx-light wrk).
Everything runs on this machine over the loopback interface, the clients on the same cores as the servers. Memory is the
peak of the server's resident set above what it holds with the material open. Prints Markdown.
"""

import argparse
import json
import os
import pathlib
import shutil
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAIRS = 1_000_000
# Targets: spectra a second of a batch, and the share of nginx's requests a second.
SPECTRA, SHARE = 1_000_000, 0.85
RATE = 200


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary", type=pathlib.Path)
    arguments.add_argument("--seconds", type=float, default=5.0, help="of one run of load")
    arguments.add_argument("--rounds", type=int, default=3, help="of everything, one after the other")
    arguments.add_argument("--only", default="batch,latency,blob")
    arguments.add_argument("--keys", action="store_true", help="every request carries an access key")
    arguments.add_argument("--logs", action="store_true", help="nginx writes a line for each request, too")
    arguments.add_argument("--hold", action="store_true", help="exit code 1 below 85 %% of nginx or a million spectra a second")
    arguments = arguments.parse_args()
    missed = []
    only = arguments.only.split(",")
    if "blob" in only:
        for program in ("nginx", "wrk"):
            if not find(program):
                sys.exit(f"{program} is missing; Debian: apt install nginx-light wrk; or leave it out with --only batch,latency")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        with Server(arguments.binary.resolve(), scratch, arguments.keys) as server:
            print(f"{time.strftime('%Y-%m-%d')}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before\n")
            if "batch" in only or "latency" in only:
                material = server.material("data/virtual/plastic.json", {"er_l2": 0.01})
            if "batch" in only:
                missed += batch(server, material, arguments.rounds)
            if "latency" in only:
                latency(server, material, arguments.seconds, arguments.rounds)
            if "blob" in only:
                missed += blob(server, scratch, arguments.seconds, arguments.rounds, arguments.logs)
    if arguments.hold and missed:
        sys.exit("\n".join(missed))


def find(program):
    return shutil.which(program, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")


class Server:
    """`wavelume serve` on a free port, its log in a file as a service has it."""

    def __init__(self, binary, scratch, keys):
        self.binary, self.scratch, self.headers, self.auth, self.environment = binary, scratch, {}, [], dict(os.environ)
        if keys:
            key = subprocess.run([binary, "keys", "generate"], check=True, capture_output=True, text=True).stdout.strip()
            self.headers, self.auth = {"authorization": f"Bearer {key}"}, ["--auth", "keys"]
            self.environment["WAVELUME_BOOTSTRAP_KEY"] = key

    def __enter__(self):
        command = [self.binary, "serve", "--data", self.scratch / "data", "--listen", "127.0.0.1:0", *self.auth]
        log = open(self.scratch / "log", "wb")
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=self.environment)
        line = self.process.stdout.readline()
        if not line.startswith("listening on http://"):
            sys.exit(f"the server does not start: {(self.scratch / 'log').read_text()}")
        self.base = line.split()[2]
        self.address = (self.base.rsplit(":", 1)[0].removeprefix("http://"), int(self.base.rsplit(":", 1)[1]))
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)

    def lines(self):
        """Headers of every request, as lines of HTTP."""
        return "".join(f"{name}: {value}\r\n" for name, value in self.headers.items())

    def call(self, path, body=None, headers=None):
        request = urllib.request.Request(self.base + path, body, {**self.headers, **(headers or {})})
        with urllib.request.urlopen(request) as answer:
            return answer.read()

    def material(self, file, target):
        """Uploads and compresses a file of the source."""
        measurement = json.loads(self.call("/v1/measurements", (ROOT / file).read_bytes()))
        job = json.dumps({"measurement": measurement["id"], "target": target}).encode()
        headers = {"content-type": "application/json", "prefer": "wait=60"}
        job = json.loads(self.call("/v1/jobs", job, headers))
        while job["state"] in ("queued", "running"):
            time.sleep(0.2)
            job = json.loads(self.call(job["links"]["self"]))
        if job["state"] != "succeeded":
            sys.exit(f"{file} was not compressed: {job}")
        return f"/v1/materials/{job['material']}"

    def memory(self, field):
        for line in pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith(field):
                return int(line.split()[1]) / 1024
        return 0.0

    def forget_peak(self):
        pathlib.Path(f"/proc/{self.process.pid}/clear_refs").write_text("5")


def pairs(count):
    """Well spread directions: theta to 80 and 88 degrees, any phi."""
    packed = bytearray()
    for i in range(count):
        packed += struct.pack(
            "<4f", 80 * (i * 0.7548776662 % 1), 360 * (i * 0.5698402910 % 1), 88 * (i * 0.6180339887 % 1), 360 * (i * 0.4142135624 % 1)
        )
    return bytes(packed)


def batch(server, material, rounds):
    """Prints the rates of batches, and returns a line for each that misses its target."""
    body = pairs(PAIRS)
    few = json.dumps({"wi": [list(struct.unpack_from("<2f", body, 16 * i)) for i in range(8)],
                      "wo": [list(struct.unpack_from("<2f", body, 16 * i + 8)) for i in range(8)]}).encode()
    expected = json.loads(server.call(material + "/evaluate", few, {"content-type": "application/json"}))["values"]
    found = server.call(material + "/evaluate", body[:128], {"content-type": "application/octet-stream"})
    width = len(expected[0])
    same = struct.pack(f"<{8 * width}f", *(value for row in expected for value in row)) == found
    if not same:
        sys.exit("JSON and f32 disagree")
    print(f"| {PAIRS:,} pairs × {width} wavelengths in f32 | spectra/s | MB/s | memory above the open material, MiB |")
    print("|---|--:|--:|--:|")
    missed = []
    for how in ("constant", "smooth"):
        runs, peak = [], 0.0
        for _ in range(rounds + 1):
            resident = server.memory("VmRSS")
            server.forget_peak()
            seconds = send(server, f"{material}/evaluate?interpolation={how}", body, PAIRS * width * 4)
            runs.append(seconds)
            peak = max(peak, server.memory("VmHWM") - resident)
        # The first run warms up.
        best, middle = min(runs[1:]), statistics.median(runs[1:])
        print(
            f"| {how} | {PAIRS / middle:,.0f} (best {PAIRS / best:,.0f}) | {PAIRS * width * 4 / middle / 1e6:,.0f} | {peak:.0f} |"
        )
        if PAIRS / middle < SPECTRA:
            missed.append(f"{how}: {PAIRS / middle:,.0f} spectra/s, expected {SPECTRA:,}")
    print()
    return missed


def send(server, path, body, expected):
    """Seconds for a body out and its answer in, both at the same time."""
    head = (
        f"POST {path} HTTP/1.1\r\nhost: localhost\r\n{server.lines()}content-type: application/octet-stream\r\n"
        f"content-length: {len(body)}\r\nconnection: close\r\n\r\n"
    ).encode()
    with socket.create_connection(server.address) as stream:
        start = time.perf_counter()
        writer = threading.Thread(target=lambda: stream.sendall(head + body))
        writer.start()
        room, got, header = memoryview(bytearray(1 << 20)), 0, b""
        while not header.endswith(b"\r\n\r\n"):
            header += stream.recv(1)
        if not header.startswith(b"HTTP/1.1 200"):
            sys.exit(f"the batch was refused: {header.decode()}")
        while count := stream.recv_into(room):
            got += count
        seconds = time.perf_counter() - start
        writer.join()
    if got != expected:
        sys.exit(f"{got} bytes came, expected {expected}")
    return seconds


def latency(server, material, seconds, rounds):
    # Opening the material is not what is measured.
    server.call(material + "/spectrum?wi=30,0&wo=45,170")
    one = json.dumps({"wi": [[30, 0]], "wo": [[45, 170]]})
    requests = {
        "GET /healthz, for comparison": f"GET /healthz HTTP/1.1\r\nhost: localhost\r\n{server.lines()}\r\n",
        "GET spectrum": f"GET {material}/spectrum?wi=30,0&wo=45,170 HTTP/1.1\r\nhost: localhost\r\n{server.lines()}\r\n",
        "POST evaluate": f"POST {material}/evaluate HTTP/1.1\r\nhost: localhost\r\n{server.lines()}content-type: application/json\r\n"
        f"content-length: {len(one)}\r\n\r\n{one}",
    }
    print(f"| one spectrum as JSON, {RATE} requests/s | p50, ms | p99, ms | largest, ms |")
    print("|---|--:|--:|--:|")
    for name, request in requests.items():
        taken = []
        for _ in range(rounds):
            taken += steady(server.address, request.encode(), int(seconds * RATE))
        taken.sort()
        at = lambda share: taken[min(int(share * len(taken)), len(taken) - 1)] * 1e3
        print(f"| {name} | {at(0.5):.2f} | {at(0.99):.2f} | {taken[-1] * 1e3:.2f} |")
    print()


def steady(address, request, count):
    """Seconds from when each request was due to the end of its answer."""
    taken = []
    with socket.create_connection(address) as stream:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        begin = time.perf_counter() + 0.05
        for i in range(count):
            due = begin + i / RATE
            wait = due - time.perf_counter()
            if wait > 0:
                time.sleep(wait)
                # A sleeper that wakes late is the client's own delay.
                due = max(due, time.perf_counter())
            stream.sendall(request)
            answer = b""
            while b"\r\n\r\n" not in answer:
                answer += stream.recv(1 << 16)
            head, _, body = answer.partition(b"\r\n\r\n")
            if not head.startswith(b"HTTP/1.1 200"):
                sys.exit(f"a question was refused: {answer.decode()}")
            length = next(int(line.split(b":")[1]) for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
            while len(body) < length:
                body += stream.recv(1 << 16)
            taken.append(time.perf_counter() - due)
    return taken


def blob(server, scratch, seconds, rounds, logs):
    """Prints requests a second beside nginx, and returns a line if they miss their target."""
    material = server.material("data/carpaint_blue.mbsdf", {"bytes": 100 << 10})
    content = server.call(material + "/content")
    pages = scratch / "pages"
    pages.mkdir()
    (pages / "material.wlm").write_bytes(content)
    for directory in (scratch, pages):
        directory.chmod(0o755)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = scratch / "nginx.conf"
    settings.write_text(
        f"worker_processes auto;\ndaemon off;\npid {scratch}/nginx.pid;\nerror_log {scratch}/nginx.log;\n"
        "events { worker_connections 1024; }\n"
        f"http {{ access_log {scratch / 'requests.log' if logs else 'off'}; sendfile on; tcp_nopush on; keepalive_requests 1000000000;\n"
        f"  server {{ listen 127.0.0.1:{port}; root {pages}; }} }}\n"
    )
    nginx = subprocess.Popen([find("nginx"), "-p", scratch, "-c", settings])
    try:
        addresses = {"nginx": f"http://127.0.0.1:{port}/material.wlm", "wavelume": f"{server.base}{material}/content"}
        for _ in range(100):
            try:
                if urllib.request.urlopen(addresses["nginx"]).read() != content:
                    sys.exit("nginx has other bytes")
                break
            except OSError:
                time.sleep(0.05)
        found = {name: [] for name in addresses}
        for round in range(rounds + 1):
            # One after the other, first one then the other first.
            for name in sorted(addresses, reverse=round % 2 == 1):
                headers = server.headers if name == "wavelume" else {}
                found[name].append(requests(addresses[name], headers, seconds if round else 1.0))
        shares = [ours / theirs for ours, theirs in zip(found["wavelume"][1:], found["nginx"][1:])]
        print(f"| a material of {len(content):,} bytes, 16 connections | requests/s | MB/s |")
        print("|---|--:|--:|")
        for name, rates in found.items():
            middle = statistics.median(rates[1:])
            print(f"| {name} | {middle:,.0f} | {middle * len(content) / 1e6:,.0f} |")
        print(f"| wavelume / nginx, of the same round | {100 * statistics.median(shares):.0f} % ({', '.join(f'{100 * s:.0f}' for s in shares)}) | |")
        share = statistics.median(shares)
        return [] if share >= SHARE else [f"{100 * share:.0f} % of nginx, expected {100 * SHARE:.0f} % or more"]
    finally:
        nginx.terminate()
        nginx.wait(10)


def requests(address, headers, seconds):
    command = [find("wrk"), "-t1", "-c16", f"-d{seconds:.0f}s", *(f"-H{name}: {value}" for name, value in headers.items()), address]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    if "Non-2xx" in output:
        sys.exit(f"refused: {output}")
    return next(float(line.split()[1]) for line in output.splitlines() if line.startswith("Requests/sec:"))


if __name__ == "__main__":
    main()
