#!/usr/bin/env python3
"""Resumable uploads by clients that this project has not written, broken at random offsets and continued through
another node.

Usage: tests/servers tests/acceptance/tus.py BINARY [--uploads N] [--node MODULES]

Two nodes share the PostgreSQL and the S3 store that tests/servers has started. A proxy in front of them cuts each
upload a few times, at a random number of bytes or by killing the client, and hands the next connection to the other
node. N uploads (default: 20) come from tuspy; with --node, a directory with the node_modules of tus-js-client, every
second one comes from that client. Each becomes a measurement whose bytes are read back and compared. WAVELUME_SEED
repeats a run.
"""
import argparse
import hashlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

HERE = os.path.dirname(os.path.abspath(__file__))
# Bytes of the smallest and the largest upload.
SIZES = 20_000, 6_000_000
# Breaks of one upload, at most.
BREAKS = 4
# Seconds in which one upload must be complete.
PATIENCE = 120


def check(claim, found):
    if not claim:
        sys.exit(f"FAILED: {found}")


def array(path, size, chance):
    """Writes a float32 array of about `size` bytes, whose content is random and whose axes a job would name."""
    count = size // 4
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({count},), }}"
    header += " " * (-(len(header) + 11) % 64) + "\n"
    # The exponents of 0.5 to 2, so that no sample is infinite or not a number.
    body = bytearray(chance.randbytes(4 * count))
    body[3::4] = b"\x3f" * count
    with open(path, "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(body))


class Node:
    """`wavelume serve` without workers, on a free port."""

    def __init__(self, binary, directory, number):
        self.log = os.path.join(directory, f"node-{number}.log")
        with open(self.log, "w") as log:
            self.process = subprocess.Popen(
                [binary, "serve", *places(directory, number), "--workers", "0", "--listen", "127.0.0.1:0"],
                stdout=subprocess.PIPE, stderr=log, text=True,
            )
        line = self.process.stdout.readline()
        check(line.startswith("listening on "), f"serve did not say where it listens: {open(self.log).read()}")
        self.url = line.split()[2].rstrip(",")
        self.port = int(self.url.rsplit(":", 1)[1])

    def stop(self):
        self.process.terminate()
        self.process.wait(30)


def places(directory, number):
    return ["--data", os.path.join(directory, f"data-{number}"), "--database", os.environ["WAVELUME_TEST_DATABASE"],
            "--store", os.environ["WAVELUME_TEST_STORE"] + "/tus"]


class Proxy:
    """Passes connections to the nodes in turn, and cuts them when the client has sent a planned number of bytes."""

    def __init__(self, ports):
        self.ports, self.turn, self.cuts, self.made = ports, 0, [], 0
        self.lock = threading.Lock()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            node = socket.create_connection(("127.0.0.1", self.ports[self.turn % len(self.ports)]))
            left = [client, node]
            threading.Thread(target=self.pass_on, args=(client, node, True, left), daemon=True).start()
            threading.Thread(target=self.pass_on, args=(node, client, False, left), daemon=True).start()

    def pass_on(self, source, target, is_sent, left):
        try:
            while piece := source.recv(65536):
                if is_sent and (rest := self.before_cut(len(piece))) is not None:
                    target.sendall(piece[:rest])
                    break
                target.sendall(piece)
        except OSError:
            pass
        for end in (source, target):
            # Both directions, so that the other thread ends, too.
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
        with self.lock:
            left.remove(source)
            if not left:
                # Only now a client that is still sending is told.
                source.close()
                target.close()

    def before_cut(self, count):
        """Returns how many of `count` bytes pass before the planned cut, or None if all do."""
        with self.lock:
            if not self.cuts:
                return None
            if self.cuts[0] >= count:
                self.cuts[0] -= count
                return None
            self.turn += 1
            self.made += 1
            return self.cuts.pop(0)

    def plan(self, cuts):
        with self.lock:
            self.cuts = list(cuts)
            self.turn += 1


def with_tuspy(proxy, path, chunk):
    """Uploads a file; after each break another client, which knows the address of the upload only, goes on."""
    from tusclient import client
    address, deadline = None, time.monotonic() + PATIENCE
    while True:
        check(time.monotonic() < deadline, f"tuspy did not end the upload {address}")
        try:
            uploader = client.TusClient(proxy.url + "/v1/uploads").uploader(
                path, chunk_size=chunk, metadata={"filename": os.path.basename(path)}, url=address)
            address = address or uploader.create_url()
            uploader.set_url(address)
            uploader.offset = uploader.get_offset()
            uploader.upload()
            return address
        except Exception as error:  # Each break looks different: a reset, an answer without a body, a status.
            status = getattr(error, "status_code", None)
            check(status in (None, 409, 423), f"tuspy: {status} {error!r}")
            time.sleep(0.05)


def with_tus_js(proxy, path, chunk, modules, kill):
    """Uploads a file with tus-js-client, which repeats by itself; it is killed after `kill` seconds and started
    again."""
    notes, deadline = path + ".notes", time.monotonic() + PATIENCE
    environment = {**os.environ, "NODE_PATH": os.path.join(modules, "node_modules")}
    while True:
        check(time.monotonic() < deadline, "tus-js-client did not end the upload")
        process = subprocess.Popen(
            ["node", os.path.join(HERE, "tus_client.cjs"), proxy.url + "/v1/uploads", path, str(chunk), notes],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        try:
            out, error = process.communicate(timeout=kill)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            kill = None
            continue
        check(process.returncode == 0, f"tus-js-client: {error}")
        return out.strip()


def fetched(request):
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read()


def uploaded(proxy, node, path, args, number, chance):
    size = os.path.getsize(path)
    proxy.plan(chance.randrange(size // 2) for _ in range(chance.randint(1, BREAKS)))
    chunk = chance.choice([size + 1, size // 2 + 1, 200_000, 1_000_000])
    if args.node and number % 2:
        kill = chance.choice([None, chance.uniform(0.1, 0.6)])
        address = with_tus_js(proxy, path, chunk, args.node, kill)
    else:
        address = with_tuspy(proxy, path, chunk)
    proxy.plan([])
    upload = address.rsplit("/", 1)[1]
    answer = json.loads(fetched(urllib.request.Request(f"{node.url}/v1/measurements?upload={upload}", method="POST")))
    check(answer["file_name"] == os.path.basename(path), f"the name of the file is {answer['file_name']}")
    kept = fetched(f"{node.url}{answer['links']['content']}")
    with open(path, "rb") as file:
        sent = file.read()
    check(hashlib.sha256(kept).digest() == hashlib.sha256(sent).digest(), f"{path}: other bytes were kept, seed {args.seed}")
    request = urllib.request.Request(f"{node.url}/v1/uploads/{upload}", method="HEAD", headers={"Tus-Resumable": "1.0.0"})
    try:
        fetched(request)
        check(False, f"{upload} is there after its use")
    except urllib.error.HTTPError as error:
        check(error.code == 404, f"{upload}: {error.code} after its use")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("binary")
    parser.add_argument("--uploads", type=int, default=20)
    parser.add_argument("--node")
    args = parser.parse_args()
    args.seed = int(os.environ.get("WAVELUME_SEED", random.randrange(1 << 30)))
    chance = random.Random(args.seed)
    binary = os.path.abspath(args.binary)
    with tempfile.TemporaryDirectory(prefix="wavelume-tus-") as directory:
        done = subprocess.run([binary, "migrate", *places(directory, 0)], capture_output=True, text=True)
        check(done.returncode == 0, f"migrate: {done.stderr}")
        nodes = [Node(binary, directory, number) for number in (1, 2)]
        try:
            proxy = Proxy([node.port for node in nodes])
            for number in range(args.uploads):
                path = os.path.join(directory, f"array-{number}.npy")
                array(path, chance.randint(*SIZES), chance)
                uploaded(proxy, nodes[number % 2], path, args, number, chance)
                os.remove(path)
            done = subprocess.run([binary, "fsck", *places(directory, 0)], capture_output=True, text=True)
            check(done.returncode == 0, f"fsck: {done.stdout}{done.stderr}")
        finally:
            for node in nodes:
                node.stop()
    check(proxy.made >= args.uploads, f"only {proxy.made} breaks")
    print(f"{args.uploads} uploads, {proxy.made} breaks, 0 wrong digests, seed {args.seed}")


main()
