#!/usr/bin/env python3
"""examples/batch/upload-and-compress.sh, killed at random points and started again, against the real service.

Usage: batch.py BINARY [--files N]

N small spectra (default: 100), some with awkward names, are compressed by a service with a data directory of its own.
Among them is a file that is no measurement. The script is killed three times, between any two requests or within one.
Then every spectrum has its material, the lists of the service show N measurements and N jobs, and its log no upload
that came twice. Lost notes, a changed file, a changed request, a service that refuses for a while and an upload that
is left running are tried afterwards.
WAVELUME_SEED repeats a run.
"""
import argparse
import collections
import concurrent.futures
import contextlib
import http.client
import http.server
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCRIPT = os.path.join(ROOT, "examples", "batch", "upload-and-compress.sh")
KILLS = 3
# Characters that mean something to a shell, a query string, JSON, awk or curl.
AWKWARD = ["with space.csv", "quote's.csv", 'two "quotes".csv', "Übergröße ½.csv", "100%&=#?+.csv", "[1]{2}.csv", "-dash.csv",
           "$HOME `x` $(y).csv", "back\\slash.csv", "semi;colon,comma.csv", "@at.csv", " blanks around ", "1e3", "1000"]
# Requests of a third of the files; the others get the script's own.
OPTIONS, REQUEST, LOOSE, STANDARD = "quantity=reflectance", '{"target": {"er_l2": 0.03}, "tags": ["tile"]}', 0.03, 0.01


def check(claim, found):
    if not claim:
        sys.exit(f"FAILED: {found}")


def spectra(directory, count):
    """Writes `count` different spectra of 32 wavelengths; returns their names."""
    os.mkdir(directory)
    names = (AWKWARD + [f"scan-{number:05}.csv" for number in range(count)])[:count]
    for number, name in enumerate(names):
        rows = [f"{400 + 10 * k},{0.5 + 0.3 * math.sin(k / 4 + number) + number / 1e5:.6f}\n" for k in range(32)]
        with open(os.path.join(directory, name), "w") as file:
            file.write("wavelength_nm,value\n" + "".join(rows))
    return names


class Service:
    """`wavelume serve` on a free port, and what its log says."""

    def __init__(self, binary, directory):
        self.log = os.path.join(directory, "log")
        self.read, self.count = 0, 0
        with open(self.log, "w") as log:
            self.process = subprocess.Popen(
                [binary, "serve", "--data", os.path.join(directory, "data"), "--listen", "127.0.0.1:0", "--log-format", "json"],
                stdout=subprocess.PIPE, stderr=log, text=True,
                env={name: value for name, value in os.environ.items() if name != "RUST_LOG"},
            )
        line = self.process.stdout.readline()
        check(line.startswith("listening on "), f"serve did not say where it listens: {line}")
        self.address = line.split()[2].rstrip(",")

    def stop(self):
        self.process.terminate()
        self.process.wait(30)

    def events(self):
        """The events of the log, each as the dictionary of its fields."""
        with open(self.log) as log:
            return [json.loads(line)["fields"] for line in log if line.endswith("}\n")]

    def answered(self):
        """The number of requests that were answered; reads only what the log has got since the last call."""
        with open(self.log, "rb") as log:
            log.seek(self.read)
            for line in log:
                if line.endswith(b"\n"):
                    self.read += len(line)
                    self.count += b'"message":"request answered"' in line
        return self.count

    def listed(self, what):
        """All items of a list, page by page."""
        items, cursor = [], ""
        while cursor is not None:
            connection = http.client.HTTPConnection(self.address.removeprefix("http://"))
            connection.request("GET", f"/v1/{what}?limit=1000{cursor}")
            answer = connection.getresponse()
            page = json.load(answer)
            check(answer.status == 200, page)
            items += page["items"]
            cursor = page["next"] and "&cursor=" + urllib.parse.quote(page["next"])
        return items

    def done(self):
        """Returns the numbers of measurements, of uploads that were repeated and refused, and of jobs.

        An upload that a kill cut off (400) is none of these; each kill cuts off one at most. A request whose client is
        killed just before the answer may have done its work without a line in the log: the lists say what there is.
        """
        count = collections.Counter()
        for event in self.events():
            if event["message"] == "request answered" and (event["method"], event["path"]) == ("POST", "/v1/measurements"):
                count[{201: "uploaded", 200: "uploaded again", 400: "cut off"}.get(event["status"], "refused")] += 1
        check(count["cut off"] <= KILLS, f"uploads cut off: {count['cut off']}")
        there = [len(self.listed(what)) for what in ("measurements", "jobs")]
        check(count["uploaded"] <= there[0], f"{count['uploaded']} uploads made {there[0]} measurements")
        return there[0], count["uploaded again"], count["refused"], there[1]


def start(*words):
    """Starts the script in a process group of its own."""
    return subprocess.Popen(
        [SCRIPT, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )


def finish(process, code):
    """The lines that a start leaves on stderr; its exit code is `code`."""
    output, errors = process.communicate()
    check(process.returncode == code, f"exit code {process.returncode}, expected {code}: {output}{errors}")
    return errors.splitlines()


def kill(service, words, chance, count):
    """Kills the script at random points of its work; returns the numbers of requests that had been answered by then."""
    # A file takes at least five requests: a list, an upload, a job, its state and the material. The last few are left
    # out, so that the script does not end before it is killed.
    points = sorted(chance.sample(range(1, 5 * count - max(10, count // 4)), KILLS))
    for number, point in enumerate(points):
        process = start(*words)
        while service.answered() < point and process.poll() is None:
            time.sleep(0.005)
        time.sleep(chance.uniform(0, 0.03))
        check(process.poll() is None, f"the script ended before it was killed: {process.poll()}")
        if number == 1:
            process.kill()  # Its curl goes on; the next start has to wait for it.
        else:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return points


def inspect(binary, path):
    done = subprocess.run([binary, "inspect", "--json", path], capture_output=True, text=True)
    check(done.returncode == 0, f"{path}: {done.stderr}")
    return json.loads(done.stdout)


def check_materials(binary, scans, materials, names, special):
    """Every file has a material that was made of it, as the manifest asks for it."""
    found = {name for name in os.listdir(materials) if name != ".batch"}
    check(found == {f"{name}.wlm" for name in names}, f"materials that lack a file, or files that lack one: {found}")

    def one(name):
        file, material = inspect(binary, os.path.join(scans, name)), inspect(binary, os.path.join(materials, f"{name}.wlm"))
        source = material["provenance"]["source"]["content_digest"]
        check(source == file["content_digest"], f"{name}: the material was made of {source}")
        quantity, most = ("reflectance", LOOSE) if name in special else ("spectrum", STANDARD)
        check(material["quantity"] == quantity and material["er_l2"] <= most, f"{name}: {material}")

    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        list(pool.map(one, names))


class Held:
    """The first upload through a proxy, which waits for a word to go on."""

    def __init__(self):
        self.begun, self.go, self.ended = threading.Event(), threading.Event(), threading.Event()


@contextlib.contextmanager
def proxy(address, held=None):
    """A proxy that refuses the first request of each kind, with 503 and 429 in turn, or only holds the first upload.

    Yields its address and the kinds of requests that it has refused.
    """
    refused = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def answer(self, status, headers, body):
            self.send_response(status)
            for name, value in headers:
                self.send_header(name, value)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self):
            body = self.rfile.read(int(self.headers.get("content-length", 0)))
            kind = (self.command, "/".join(self.path.split("?")[0].split("/")[:3]))
            is_held = held and kind == ("POST", "/v1/measurements") and not held.begun.is_set()
            if is_held:
                held.begun.set()
                held.go.wait(60)
            if not held and kind not in refused and kind[1].startswith("/v1/"):
                refused.append(kind)
                self.answer((503, 429)[len(refused) % 2], [("retry-after", "1")], b'{"detail":"not now"}')
                return
            connection = http.client.HTTPConnection(address.removeprefix("http://"))
            kept = {name: value for name, value in self.headers.items() if name.lower() in ("content-type", "idempotency-key")}
            connection.request(self.command, self.path, body, kept)
            answer = connection.getresponse()
            body = answer.read()
            if is_held:
                held.ended.set()
            self.answer(answer.status, [("content-type", answer.getheader("content-type"))], body)

        do_POST = do_GET

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", refused
        server.shutdown()


def batch(binary, count, chance, directory, service):
    scans, materials, manifest = (os.path.join(directory, name) for name in ("scans", "materials of scans", "manifest.tsv"))
    words = [service.address, scans, materials, manifest]
    names = spectra(scans, count)
    special = set(names[::3])
    with open(manifest, "w") as file:
        file.writelines(f"{name}\t{OPTIONS}\t{REQUEST}\n" for name in names if name in special)

    # In the middle of the list: the files behind it go on. Each start sends it once more.
    broken = os.path.join(scans, "no measurement.txt")
    with open(broken, "w") as file:
        file.write("nothing to see\n")

    points = kill(service, words, chance, count)
    lines = finish(start(*words), 1)
    check(len(lines) == 1 and lines[0].startswith("no measurement.txt: "), f"lines of a failure: {lines}")
    refused = service.done()[2]
    check(1 <= refused <= KILLS + 1, f"refused {refused} times")
    check(service.done() == (count, 0, refused, count), f"measurements, again, refused, jobs: {service.done()}; killed at {points}")
    os.remove(broken)
    time.sleep(0.2)  # The last line in the log.
    asked = service.answered()
    check(finish(start(*words), 0) == [], "lines on stderr of a start that succeeds")
    check(service.answered() <= asked + 1, f"a start with nothing to do made {service.answered() - asked} requests")
    measurements, jobs = service.listed("measurements"), service.listed("jobs")
    check({item["file_name"] for item in measurements} == set(names) and len(measurements) == count, "measurements listed")
    check(len(jobs) == count and {job["state"] for job in jobs} == {"succeeded"}, f"{len(jobs)} jobs listed")
    check_materials(binary, scans, materials, names, special)

    # A kill between an answer and its note loses the note: the service is asked instead of being sent the file again.
    lost = names[: min(4, count)]
    for name in lost:
        os.remove(os.path.join(materials, ".batch", f"{name}.job"))
        os.remove(os.path.join(materials, f"{name}.wlm"))
    finish(start(*words), 0)
    check(service.done() == (count, 0, refused, count), f"after notes were lost: {service.done()}")
    check_materials(binary, scans, materials, names, special)

    # Another request for one file is a job, and no upload.
    text = REQUEST.replace(str(LOOSE), "0.02")
    with open(manifest, "r+") as file:
        lines = file.readlines()
        file.seek(0)
        file.writelines([lines[0].replace(REQUEST, text), *lines[1:]])
    finish(start(*words), 0)
    check(service.done() == (count, 0, refused, count + 1), f"after a request was changed: {service.done()}")
    check(inspect(binary, os.path.join(materials, f"{names[0]}.wlm"))["er_l2"] <= 0.02, "the material of the changed request")

    # A changed file is an upload and a job.
    with open(os.path.join(scans, names[1]), "a") as file:
        file.write("720,0.5\n")
    finish(start(*words), 0)
    check(service.done() == (count + 1, 0, refused, count + 2), f"after a file was changed: {service.done()}")
    check_materials(binary, scans, materials, names, special)

    # A service that is busy for a while is waited for; two files with the same bytes are one upload and one job.
    few, again = os.path.join(directory, "few"), os.path.join(directory, "again")
    spectra(few, count + 2)
    for name in names:
        os.remove(os.path.join(few, name))
    shutil.copy(os.path.join(few, os.listdir(few)[0]), os.path.join(few, "zz copy.csv"))
    with proxy(service.address) as (address, kinds):
        check(finish(start(address, few, again), 0) == [], "lines on stderr of a start through the proxy")
    check(len(kinds) == 5, f"refused through the proxy: {kinds}")
    check(len(os.listdir(again)) == 3 + 1, "materials through the proxy")
    check(service.done() == (count + 3, 0, refused, count + 4), f"after a service was busy: {service.done()}")

    # An upload that a script has left running, as it was killed and its curl was not, is waited for.
    one, held = os.path.join(directory, "one"), Held()
    os.mkdir(one)
    with open(os.path.join(one, "one.csv"), "w") as file:
        file.writelines(f"{wavelength},{wavelength / 999}\n" for wavelength in range(400, 701, 10))
    with proxy(service.address, held) as (address, _):
        words = [address, one, os.path.join(directory, "material of one")]
        first = start(*words)
        check(held.begun.wait(60), "no upload came")
        first.kill()
        first.wait()
        second = start(*words)
        # Without a lock the second start would send the file within this time.
        threading.Timer(4, held.go.set).start()
        finish(second, 0)
        check(held.ended.wait(60), "the upload that was held did not end")
        time.sleep(0.1)  # Its line in the log.
    check(service.done() == (count + 4, 0, refused, count + 5), f"after an upload was left running: {service.done()}")
    return points


def main():
    parser = argparse.ArgumentParser(usage="batch.py BINARY [--files N]")
    parser.add_argument("binary")
    parser.add_argument("--files", type=int, default=100)
    arguments = parser.parse_args()
    binary, count = os.path.abspath(arguments.binary), arguments.files
    check(count >= 10, f"--files {count}: expected at least 10")
    seed = int(os.environ.get("WAVELUME_SEED", random.randrange(1 << 31)))
    with tempfile.TemporaryDirectory(prefix="wavelume-batch-") as directory:
        service = Service(binary, directory)
        try:
            points = batch(binary, count, random.Random(seed), directory, service)
        except SystemExit as failed:
            sys.exit(f"{failed} (WAVELUME_SEED={seed})")
        finally:
            service.stop()
    after = ", ".join(map(str, points))
    print(f"{count} files, killed after {after} requests (seed {seed}): {count} uploads, {count} jobs, {count} materials, none twice")


if __name__ == "__main__":
    main()
