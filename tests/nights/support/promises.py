"""Clients that upload, compress, cancel and delete while processes die, and what they were promised."""

import collections
import contextlib
import http.client
import json
import random
import socket
import struct
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from service import npy

# Request of a client; each spectrum is another one, so that each job makes a material of its own.
SPECTRUM = {"quantity": "spectrum", "target": {"er_l2": 0.01}}
# A BRDF of 16 incoming and 256 outgoing triangles at 31 wavelengths: a second of work, so that its worker dies in the
# middle.
LONG = {"quantity": "brdf", "axes": {"axes": ["hemi:1", "hemi:3", "lambda:400:10:31"]}, "target": {"er_l2": 0.001}}
# Materials that are compared with those that the command line makes of the same files.
COMPARED = 20
# Seconds after which a client no longer waits for an answer, and no longer uses a connection that it has left idle.
ANSWER, IDLE = 120, 15


def spectrum(number):
    """A small spectrum that no other client uploads."""
    rows = (f"{400 + 5 * i},{(number * 31 + i * 7) % 997 + 1}.5\n" for i in range(40))
    return (f"wavelength,{number}\n" + "".join(rows)).encode()


class Upload:
    def __init__(self, body, request, deleted=None):
        # False once the deletion was asked for, True once it was answered.
        self.body, self.request, self.deleted = body, request, deleted


class Job:
    def __init__(self, upload):
        self.upload, self.cancelled, self.end = upload, False, None


class Ledger:
    """The answers of the service with 2xx, and all faults."""

    def __init__(self, addresses, forgiven=("broken", "503")):
        self.addresses, self.forgiven, self.lock = addresses, forgiven, threading.Lock()
        self.uploads, self.jobs, self.deleted = {}, {}, {}
        self.counts, self.wrong, self.seconds = collections.Counter(), [], []
        self.local = threading.local()

    def note(self, what):
        with self.lock:
            self.counts[what] += 1

    def accuse(self, text):
        with self.lock:
            self.wrong.append(text)

    def once(self, address, method, path, body, headers):
        """One request; None if its connection broke. Connections are kept, as clients do."""
        kept = self.local.__dict__.setdefault("connections", {})
        start = time.monotonic()
        if address in kept and start - kept[address].used > IDLE:
            kept.pop(address).close()
        try:
            if address not in kept:
                kept[address] = http.client.HTTPConnection("127.0.0.1", address, timeout=ANSWER)
                kept[address].connect()
                kept[address].sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            kept[address].request(method, path, body=body, headers=headers)
            answer = kept[address].getresponse()
            found = answer.status, dict((name.lower(), value) for name, value in answer.getheaders()), answer.read()
            kept[address].used = time.monotonic()
        except (OSError, http.client.HTTPException) as error:
            with contextlib.suppress(KeyError):
                kept.pop(address).close()
            if isinstance(error, TimeoutError):
                self.accuse(f"{method} {path}: no answer within {ANSWER} s")
            return None
        with self.lock:
            self.seconds.append(time.monotonic() - start)
        return found

    def ask(self, chance, expected, method, path, body=None, headers=None):
        """A request that is repeated, each time to a node drawn anew, until it is answered by a status other than 503.

        Returns status and body; None, which is noted as wrong, for a status that is not expected. A 503 must say when
        to come back. What the ledger does not forgive is noted as wrong, too.
        """
        if isinstance(body, dict):
            body, headers = json.dumps(body).encode(), {"content-type": "application/json", **(headers or {})}
        end = time.monotonic() + ANSWER
        while time.monotonic() < end:
            answer = self.once(chance.choice(self.addresses), method, path, body, headers or {})
            if answer is None:
                self.note("broken")
                if "broken" not in self.forgiven:
                    self.accuse(f"{method} {path}: the connection broke")
                time.sleep(0.05)
                continue
            status, fields, text = answer
            if status == 503:
                self.note("503")
                if "503" not in self.forgiven or "retry-after" not in fields:
                    self.accuse(f"{method} {path}: 503, Retry-After {fields.get('retry-after')}: {text[:200]}")
                time.sleep(min(0.3, float(fields.get("retry-after", 1))))
                continue
            if status not in expected:
                self.accuse(f"{method} {path}: {status}, expected {expected}: {text[:300]}")
                return None
            return status, text
        self.accuse(f"{method} {path}: refused for {ANSWER} s")
        return None

    def upload(self, chance, body, request):
        """The id of an upload that was accepted."""
        answer = self.ask(chance, (200, 201), "POST", "/v1/measurements", body)
        if answer is None:
            return None
        id = json.loads(answer[1])["id"]
        with self.lock:
            self.uploads[id] = Upload(body, request)
        self.note("uploads")
        return id

    def delete_upload(self, chance, id):
        self.uploads[id].deleted = False
        # 404: an earlier try was carried out, and its answer was lost.
        if self.ask(chance, (204, 404), "DELETE", f"/v1/measurements/{id}"):
            self.uploads[id].deleted = True
            self.note("uploads deleted")

    def submit(self, chance, upload, key):
        """The id of a job that was accepted. Its key makes a repetition the same job."""
        request = {"measurement": upload, **self.uploads[upload].request}
        answer = self.ask(chance, (200, 202), "POST", "/v1/jobs", request, {"idempotency-key": key})
        if answer is None:
            return None
        id = json.loads(answer[1])["id"]
        with self.lock:
            self.jobs[id] = Job(upload)
        self.note("jobs")
        return id

    def cancel(self, chance, id):
        self.jobs[id].cancelled = True
        answer = self.ask(chance, (200, 202, 409), "POST", f"/v1/jobs/{id}/cancel", b"")
        if answer and answer[0] != 409:
            self.note("cancels")

    def look(self, chance, id):
        """The job as it is now; what it says of its end must never change."""
        answer = self.ask(chance, (200,), "GET", f"/v1/jobs/{id}")
        if answer is None:
            return None
        found, known = json.loads(answer[1]), self.jobs[id]
        if known.end is not None and known.end != found:
            self.accuse(f"the job {id} ended twice: {known.end}, then {found}")
        if found["state"] in ("queued", "running"):
            return None
        known.end = found
        if not (found["state"] == "succeeded" or found["state"] == "cancelled" and known.cancelled):
            self.accuse(f"the job {id} is {found['state']}: {found['problem']}")
        return found

    def wait(self, chance, id, stop):
        """The job once it has ended, or None if the check ends first."""
        while not stop.is_set():
            if found := self.look(chance, id):
                return found
            time.sleep(0.1)
        return None

    def delete_material(self, chance, material):
        self.deleted[material] = False
        if self.ask(chance, (204, 404), "DELETE", f"/v1/materials/{material}"):
            self.deleted[material] = True
            self.note("materials deleted")

    def fetch(self, chance, material):
        """The bytes of a material that was not deleted."""
        expected = (404,) if self.deleted.get(material) else (200, 404) if material in self.deleted else (200,)
        answer = self.ask(chance, expected, "GET", f"/v1/materials/{material}/content")
        return answer[1] if answer and answer[0] == 200 else None

    def kept(self, site, threads=8):
        """Looks at every promise: the same bytes, an end that was allowed, and no trace of what was deleted."""
        seeds = iter(range(1 << 30))

        def upload(item):
            id, promised = item
            expected = {None: (200,), False: (200, 404), True: (404,)}[promised.deleted]
            answer = self.ask(random.Random(next(seeds)), expected, "GET", f"/v1/measurements/{id}/content")
            if answer and answer[0] == 200 and answer[1] != promised.body:
                self.accuse(f"the measurement {id} has other bytes")

        def job(id):
            chance = random.Random(next(seeds))
            found = self.look(chance, id)
            if found is None:
                self.accuse(f"the job {id} has not ended")
            elif found["state"] == "succeeded":
                self.fetch(chance, found["material"])

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(upload, list(self.uploads.items())))
            list(pool.map(job, list(self.jobs)))
        self.compare(site)

    def compare(self, site):
        """Some materials have the bytes that the command line makes of the same measurement."""
        chance = random.Random(0)
        made = [(id, job) for id, job in self.jobs.items() if job.end and job.end["state"] == "succeeded"
                and job.end["material"] not in self.deleted and self.uploads[job.upload].request is SPECTRUM]
        source, target = site.path / "compared.csv", site.path / "compared.wlm"
        for id, job in chance.sample(made, min(COMPARED, len(made))):
            source.write_bytes(self.uploads[job.upload].body)
            subprocess.run([site.program, "compress", source, "-o", target, "--quantity", "spectrum", "--er-l2", "0.01"],
                           check=True, capture_output=True)
            if self.fetch(chance, job.end["material"]) != target.read_bytes():
                self.accuse(f"the material of the job {id} has other bytes than the command line's")
            self.note("compared with the command line")


class Clients:
    """Threads that use the service until they are told to stop."""

    def __init__(self, ledger, seed, small=4, long=2, slow=1, first=0):
        self.ledger, self.stop, self.seed = ledger, threading.Event(), seed
        self.samples = npy((16, 256, 31))
        # Clients of other parts of a check upload other spectra.
        self.first = first * 1_000_000_000
        acts = [self.small] * small + [self.long] * long + [self.slow] * slow
        self.threads = [threading.Thread(target=self.run, args=(act, i)) for i, act in enumerate(acts)]

    def __enter__(self):
        for thread in self.threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        for thread in self.threads:
            thread.join()

    def run(self, act, index):
        chance, number = random.Random(f"{self.seed} {index}"), self.first + index * 10_000_000
        while not self.stop.is_set():
            try:
                act(chance, number)
            except Exception as error:  # The check must hear of it, whatever it is.
                self.ledger.accuse(f"{act.__name__}: {type(error).__name__}: {error}")
                return
            number += 1

    def small(self, chance, number):
        """One spectrum: uploaded, perhaps deleted, perhaps compressed, perhaps cancelled; perhaps a material is
        deleted."""
        ledger = self.ledger
        id = ledger.upload(chance, spectrum(number), SPECTRUM)
        if id is None:
            return
        if number % 5 == 4:
            ledger.delete_upload(chance, id)
            if number % 10 == 4:
                return
            # Repeats the upload beside the sweep that removes its bytes.
            id = ledger.upload(chance, spectrum(number), SPECTRUM)
        job = id and ledger.submit(chance, id, f"{self.seed} {number}")
        if job is None:
            return
        if number % 4 == 1:
            ledger.cancel(chance, job)
        if number % 3 == 0:
            # Left alone: looked at when all is over.
            return
        ended = ledger.wait(chance, job, self.stop)
        if ended is None or ended["state"] != "succeeded":
            return
        content = ledger.fetch(chance, ended["material"])
        if content is not None and number % 4 == 2:
            ledger.delete_material(chance, ended["material"])

    def long(self, chance, number):
        """A job that takes long enough to be killed, or taken from a worker that is stopped."""
        own = struct.pack("<2f", 1 + number // 10_000_000 / 1024, 1 + number % 10_000_000 / 4096)
        id = self.ledger.upload(chance, self.samples[:-8] + own, LONG)
        job = id and self.ledger.submit(chance, id, f"{self.seed} {number}")
        if job is None:
            return
        if number % 5 == 4:
            self.stop.wait(chance.random())
            self.ledger.cancel(chance, job)
        self.ledger.wait(chance, job, self.stop)

    def slow(self, chance, _):
        """An upload that never ends."""
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", chance.choice(self.ledger.addresses))) as stream:
            stream.sendall(b"POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\ntransfer-encoding: chunked\r\n\r\n")
            while not self.stop.is_set():
                stream.sendall(b"10000\r\n" + b"#" * 0x10000 + b"\r\n")
                self.stop.wait(0.05)
        self.stop.wait(0.2)
