#!/usr/bin/env python3
"""Resumable uploads by clients that this project has not written, broken at random offsets and continued through
another node.

Usage: tests/servers tests/acceptance/tus.py BINARY [--uploads N] [--node MODULES] [--rolling MIB]

Two nodes share the PostgreSQL and the S3 store that tests/servers has started. A proxy in front of them cuts each
upload a few times, at a random number of bytes or by killing the client, and hands the next connection to the other
node. N uploads (default: 20) come from tuspy; with --node, a directory with the node_modules of tus-js-client, every
second one comes from that client. Each becomes a measurement whose bytes are read back and compared. WAVELUME_SEED
repeats a run.

With --rolling nothing is cut: N uploads of MIB MiB each run at once while the nodes are stopped with SIGTERM and
started again, one after the other. No client may send more than 16 MiB twice for a stop that it has met.
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
# Seconds in which one upload must be complete; with --rolling all that run at once.
PATIENCE, ROLLING = 120, 900
# Bytes that a client may send twice for each stop that it meets.
TWICE = 16 << 20
# Bytes a second of one upload with --rolling: slow enough that every upload meets a stop.
RATE = 2 << 20


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
    """`wavelume serve` without workers, on a free port that it keeps when it is started again."""

    def __init__(self, binary, directory, number):
        self.log = os.path.join(directory, f"node-{number}.log")
        self.command = [binary, "serve", *places(directory, number), "--workers", "0", "--uploads-each", "32"]
        self.port, self.is_up = 0, True
        self.start()

    def start(self):
        with open(self.log, "a") as log:
            self.process = subprocess.Popen([*self.command, "--listen", f"127.0.0.1:{self.port}"],
                                            stdout=subprocess.PIPE, stderr=log, text=True)
        line = self.process.stdout.readline()
        check(line.startswith("listening on "), f"serve did not say where it listens: {open(self.log).read()}")
        self.url = line.split()[2].rstrip(",")
        self.port = int(self.url.rsplit(":", 1)[1])
        self.is_up = True

    def stop(self):
        self.is_up = False
        self.process.terminate()
        code = self.process.wait(60)
        check(code == 0, f"a node ended with {code}: {open(self.log).read()[-2000:]}")


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


class Meter:
    """Passes the connections of one client to nodes that are not being stopped, at a bounded rate, and counts the bytes
    that the client sends and the stops that it meets."""

    def __init__(self, nodes):
        self.nodes, self.turn, self.sent, self.stops, self.open = nodes, 0, 0, 0, []
        self.lock = threading.Lock()
        self.listener = socket.create_server(("127.0.0.1", 0))
        # The rate is that of the client, too.
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 256 << 10)
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            self.turn += 1
            up = [node for node in self.nodes if node.is_up] or self.nodes
            node = up[self.turn % len(up)]
            try:
                server = socket.create_connection(("127.0.0.1", node.port))
            except OSError:
                client.close()
                continue
            with self.lock:
                self.open.append((node, client))
            threading.Thread(target=self.pass_on, args=(client, server, node), daemon=True).start()
            threading.Thread(target=self.answer, args=(server, client), daemon=True).start()

    def pass_on(self, client, server, node):
        try:
            while piece := client.recv(65536):
                self.sent += len(piece)
                server.sendall(piece)
                time.sleep(len(piece) / RATE)
        except OSError:
            pass
        with self.lock:
            self.open.remove((node, client))
        for end in (client, server):
            end.close()

    def answer(self, server, client):
        try:
            while piece := server.recv(65536):
                client.sendall(piece)
        except OSError:
            pass
        # The client, which may be sending, is told that nobody listens any more.
        for end in (client, server):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def stopping(self, node):
        """Counts the stop of a node to which the client has a connection."""
        with self.lock:
            self.stops += any(other is node for other, _ in self.open)


def rolling(nodes, directory, args, chance):
    """Runs uploads at once while the nodes are stopped and started again in turn. Returns a line about it."""
    meters, threads, addresses = [Meter(nodes) for _ in range(args.uploads)], [], {}
    paths = [os.path.join(directory, f"array-{number}.npy") for number in range(args.uploads)]
    size = args.rolling << 20

    def upload(number):
        array(paths[number], size, random.Random(args.seed + number))
        chunk = [os.path.getsize(paths[number]) + 1, size // 3][number // 2 % 2]
        if args.node and number % 2:
            addresses[number] = with_tus_js(meters[number], paths[number], chunk, args.node, None, ROLLING)
        else:
            addresses[number] = with_tuspy(meters[number], paths[number], chunk, ROLLING)

    for number in range(args.uploads):
        threads.append(threading.Thread(target=upload, args=(number,)))
        threads[-1].start()
    while not any(meter.sent > RATE for meter in meters):
        time.sleep(0.2)
    stops = 0
    while any(thread.is_alive() for thread in threads):
        node = nodes[stops % len(nodes)]
        for meter in meters:
            meter.stopping(node)
        node.stop()
        node.start()
        stops += 1
        time.sleep(chance.uniform(1, 3))
    check(len(addresses) == args.uploads, f"only {len(addresses)} uploads have ended")
    met = [meter for meter in meters if meter.stops]
    check(met, "no upload has met a stop")
    # Heads of requests are not of the file.
    twice = [max(0, meter.sent - size - (64 << 10)) / max(1, meter.stops) for meter in meters]
    for meter, bytes_twice in zip(meters, twice):
        most = TWICE if meter.stops else 0
        check(bytes_twice <= most, f"{bytes_twice:.0f} bytes were sent twice a stop, seed {args.seed}")
    for number, path in enumerate(paths):
        used(nodes[number % 2], addresses[number], path, args)
    met_stops = sum(meter.stops for meter in met)
    return (f"{args.uploads} uploads of {args.rolling} MiB, {stops} stops, {met_stops} times met by {len(met)} uploads, "
            f"after each {max(twice) / (1 << 20):.1f} MiB at most sent twice")


def with_tuspy(proxy, path, chunk, patience=PATIENCE):
    """Uploads a file; after each break another client, which knows the address of the upload only, goes on."""
    from tusclient import client
    address, deadline = None, time.monotonic() + patience
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
            # A node that stops answers 503.
            check(status in (None, 409, 423) or (status == 503 and patience == ROLLING), f"tuspy: {status} {error!r}")
            time.sleep(0.05)


def with_tus_js(proxy, path, chunk, modules, kill, patience=PATIENCE):
    """Uploads a file with tus-js-client, which repeats by itself; it is killed after `kill` seconds and started
    again."""
    notes, deadline = path + ".notes", time.monotonic() + patience
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
    used(node, address, path, args)


def used(node, address, path, args):
    """Makes a measurement of a complete upload, and compares its bytes with those of the file."""
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


def broken(nodes, directory, args, chance):
    """Runs uploads one after another, each broken a few times. Returns a line about them."""
    proxy = Proxy([node.port for node in nodes])
    for number in range(args.uploads):
        path = os.path.join(directory, f"array-{number}.npy")
        array(path, chance.randint(*SIZES), chance)
        uploaded(proxy, nodes[number % 2], path, args, number, chance)
        os.remove(path)
    check(proxy.made >= args.uploads, f"only {proxy.made} breaks")
    return f"{args.uploads} uploads, {proxy.made} breaks"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("binary")
    parser.add_argument("--uploads", type=int, default=20)
    parser.add_argument("--node")
    parser.add_argument("--rolling", type=int, metavar="MIB")
    args = parser.parse_args()
    args.seed = int(os.environ.get("WAVELUME_SEED", random.randrange(1 << 30)))
    chance = random.Random(args.seed)
    binary = os.path.abspath(args.binary)
    with tempfile.TemporaryDirectory(prefix="wavelume-tus-") as directory:
        done = subprocess.run([binary, "migrate", *places(directory, 0)], capture_output=True, text=True)
        check(done.returncode == 0, f"migrate: {done.stderr}")
        nodes = [Node(binary, directory, number) for number in (1, 2)]
        try:
            if args.rolling:
                done = rolling(nodes, directory, args, chance)
            else:
                done = broken(nodes, directory, args, chance)
            line = f"{done}, 0 wrong digests, seed {args.seed}"
            done = subprocess.run([binary, "fsck", *places(directory, 0)], capture_output=True, text=True)
            check(done.returncode == 0, f"fsck: {done.stdout}{done.stderr}")
        finally:
            for node in nodes:
                node.stop()
    print(line)


main()
