"""A service started for a long check: its address, its seeded data, its log, its memory and descriptors."""

import http.client
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT / "data"


def binary():
    """The program under test: WAVELUME_BINARY, or the debug build."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = Path(os.environ.get("WAVELUME_BINARY", target / "debug" / "wavelume"))
    if not path.is_file():
        sys.exit(f"{path} is missing; run cargo build --locked --profile test --bins")
    return path


def venv(name, packages):
    """A virtual environment in the target directory with exactly `packages`; returns its directory."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path, wanted = target / name, "\n".join(packages) + "\n"
    mark = path / "installed"
    if not mark.is_file() or mark.read_text() != wanted:
        print(f"installing {' '.join(packages)} into {path}", flush=True)
        try:
            subprocess.run([sys.executable, "-m", "venv", path], check=True)
            subprocess.run([path / "bin" / "python", "-m", "pip", "install", "--quiet", *packages], check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            sys.exit(
                f"{' '.join(packages)} cannot be installed ({error}); install Python 3.11 or newer with venv "
                "(Debian: apt install python3-venv), and see that pip reaches a registry"
            )
        mark.write_text(wanted)
    return path


def with_servers(durable=False):
    """Starts this program again under `tests/servers`, unless it has been."""
    if durable:
        os.environ["WAVELUME_TEST_DURABLE"] = "yes"
    if "WAVELUME_TEST_DATABASE" not in os.environ:
        program = [sys.executable, os.path.abspath(sys.argv[0]), *sys.argv[1:]]
        os.execv(ROOT / "tests" / "servers", ["tests/servers", *program])


def places(name, shared):
    """Options for an empty database and store: `name` on the servers that `tests/servers` has started if `shared`, else
    none, for SQLite and a directory."""
    if not shared:
        return []
    server = os.environ["WAVELUME_TEST_DATABASE"]
    words = ["psql", server, "-X", "-q", "-c", f'CREATE DATABASE "{name}"']
    subprocess.run(words, check=True)
    database = f"{server.rpartition('/')[0]}/{name}"
    subprocess.run([binary(), "migrate", "--database", database], check=True, stdout=subprocess.DEVNULL)
    return ["--database", database, "--store", f"{os.environ['WAVELUME_TEST_STORE']}/{name}"]


class Service:
    """`wavelume serve` on a free port of 127.0.0.1 with a data directory of its own.

    With `keys` it runs in that mode of access: `key` is the text of its first key, which has all scopes, and `call`
    sends it."""

    def __init__(self, *options, keys=False):
        self.key = None
        if keys:
            generated = subprocess.run([binary(), "keys", "generate"], check=True, capture_output=True, text=True)
            self.key, options = generated.stdout.strip(), (*options, "--auth", "keys")
        self.directory = tempfile.TemporaryDirectory(prefix="wavelume-night-")
        self.path = Path(self.directory.name)
        self.data = self.path / "data"
        self.log_path = self.path / "log"
        self.options = options
        self.process = None

    def __enter__(self):
        # Bugs are one line of the log, not a backtrace.
        environment = {key: value for key, value in os.environ.items() if key not in ("RUST_BACKTRACE", "RUST_LOG")}
        if self.key:
            environment["WAVELUME_BOOTSTRAP_KEY"] = self.key
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(
                [binary(), "serve", "--data", self.data, "--listen", "127.0.0.1:0", *self.options],
                stdout=subprocess.PIPE, stderr=log, text=True, env=environment,
            )
        line = self.process.stdout.readline().strip()
        if not line.startswith("listening on http://"):
            self.process.kill()
            sys.exit(f"serve did not start: {self.log_path.read_text()}")
        host, port = line.removeprefix("listening on http://").rsplit(":", 1)
        self.host, self.port = host, int(port)
        self.base = f"http://{host}:{port}"
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.directory.cleanup()

    def stop(self):
        """Asks the service to drain, and returns its exit code."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=120)

    def alive(self):
        """The process runs and answers."""
        return self.process.poll() is None and self.call("GET", "/healthz")[0] == 200

    def call(self, method, path, body=None, headers=None, timeout=120):
        """One request over a connection of its own: status, headers, body."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=timeout)
        credentials = {"authorization": f"Bearer {self.key}"} if self.key else {}
        try:
            connection.request(method, path, body=body, headers={**credentials, **(headers or {})})
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()
        finally:
            connection.close()

    def json(self, method, path, body=None, headers=None):
        """One request that must succeed, as JSON."""
        if isinstance(body, (dict, list)):
            body, headers = json.dumps(body), {"content-type": "application/json", **(headers or {})}
        status, _, text = self.call(method, path, body, headers)
        assert 200 <= status < 300, f"{method} {path}: {status} {text[:400]}"
        return json.loads(text) if text else None

    def compress(self, request):
        """A job to its end: the job."""
        job = self.json("POST", "/v1/jobs", request, {"prefer": "wait=60"})
        assert job["state"] == "succeeded", job
        return job

    def seed(self):
        """A spectrum, a luminaire and a BRDF: their measurements, materials and jobs."""
        spectrum = self.json("POST", "/v1/measurements?filename=d65.csv", (DATA / "illuminant_D65.csv").read_bytes())
        lamp = self.json("POST", "/v1/measurements?filename=lamp.ies", (DATA / "aerolamp.ies").read_bytes())
        array = self.json("POST", "/v1/measurements?filename=brdf.npy", npy((4, 64, 3)))
        wanted = [
            {"measurement": spectrum["id"], "target": {"er_l2": 0.01}, "tags": ["light"]},
            {"measurement": lamp["id"], "target": {"er_l2": 0.01}, "tags": ["lamp"]},
            {"measurement": array["id"], "quantity": "brdf", "target": {"er_l2": 0.01},
             "axes": {"axes": ["hemi:0", "hemi:2", "lambda:400:100:3"]}},
        ]
        jobs = [self.compress(request) for request in wanted]
        return {
            "measurements": [spectrum["id"], lamp["id"], array["id"]],
            "materials": [job["material"] for job in jobs],
            "jobs": [job["id"] for job in jobs],
        }

    def memory(self):
        """Resident bytes."""
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def descriptors(self):
        """Open descriptors, without the pool's connections to the catalog, which are few and come and go."""
        folder, count = f"/proc/{self.process.pid}/fd", 0
        for name in os.listdir(folder):
            try:
                count += "catalog.sqlite" not in os.readlink(f"{folder}/{name}")
            except OSError:
                pass  # Closed meanwhile.
        return count

    def settled_descriptors(self, most, seconds=60):
        """Waits until at most `most` descriptors are open; returns how many are."""
        end = time.monotonic() + seconds
        while (count := self.descriptors()) > most and time.monotonic() < end:
            time.sleep(0.5)
        return count

    def complaints(self):
        """Lines of the log that tell of a bug: panics, errors, answers of 500."""
        bad = re.compile(r"panicked|internal error|^\S+ +ERROR |status=500")
        with open(self.log_path, errors="replace") as log:
            return [line.rstrip() for line in log if bad.search(line)]

    def odd_lines(self, longest=10_000):
        """Lines of the log that are too long or have control characters."""
        with open(self.log_path, "rb") as log:
            lines = log.read().split(b"\n")
        return [line[:200] for line in lines if len(line) > longest or any(b < 32 or b == 127 for b in line)]


def npy(shape, phase=0.0):
    """An array of smooth positive float32 samples."""
    import math

    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {tuple(shape)}, }}"
    header += " " * (-(10 + len(header) + 1) % 64) + "\n"
    count = math.prod(shape)
    samples = struct.pack(f"<{count}f", *(0.2 + 0.1 * math.sin(0.1 * (i % 97) + phase) for i in range(count)))
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + samples
