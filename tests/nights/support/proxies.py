"""Proxies that fail: one before an S3 server, one before PostgreSQL. Each is a process of its own that obeys lines on
stdin.

    proxies.py s3 URL SEED
    proxies.py postgres URL SEED

Each prints the port that it listens on. `share P` lets this share of calls to S3 fail, or of commits lose its
connection. `out KIND` lets all calls to S3 fail: `refused`, `silent`, `absent` (404), `denied` (403) or `slow`. `in`
lets none. `counts` prints what has happened so far as JSON.
"""

import asyncio
import collections
import json
import random
import socket
import struct
import subprocess
import sys
import threading
import urllib.parse

# Failures of a call to S3. Of `cut` and `late reset` the server has done what it was asked for.
KINDS = ("503", "500", "early reset", "late reset", "cut", "delay")
# Failures of calls during an outage.
OUT = {"refused": ("503", "early reset"), "silent": ("silence",), "absent": ("404",), "denied": ("403",), "slow": ("late",)}
# Errors by which S3 itself, or a gateway before it, answers.
ERRORS = {"503": "SlowDown", "500": "InternalError", "404": "NoSuchBucket", "403": "AccessDenied"}
# Seconds by which a call is delayed, in a share of them and in an outage, and after which a silent one is closed.
DELAY, LATE, SILENCE = 1.0, 5.0, 300
# Ends of a connection to PostgreSQL: before the commit reaches the server, while it works, and after its answer was
# lost.
CUTS = ("before", "during", "after")
WRITES = ("INSERT", "UPDATE", "DELETE", "WITH")


class Proxy:
    """A proxy as its user sees it: started, told what to do, stopped."""

    def __init__(self, kind, url, seed):
        self.process = subprocess.Popen(
            [sys.executable, __file__, kind, url, str(seed)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            start_new_session=True,
        )
        self.port = int(self.process.stdout.readline())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def tell(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def counts(self):
        return collections.Counter(json.loads(self.tell("counts")))


class Faulty:
    """The common part of both proxies: the upstream server, the share of failures, and their counts."""

    def __init__(self, url, seed):
        parts = urllib.parse.urlsplit(url)
        self.host, self.upstream = parts.hostname, parts.port
        self.chance, self.share, self.out, self.counts = random.Random(seed), 0.0, None, collections.Counter()

    def obey(self, line):
        word, *rest = line.split()
        if word == "counts":
            return json.dumps(self.counts)
        if word == "share":
            self.share = float(rest[0])
        else:
            self.out = OUT[rest[0]] if word == "out" else None
        return "ok"

    async def handle(self, reader, writer):
        try:
            await self.serve(reader, writer)
        except (OSError, asyncio.IncompleteReadError):
            pass
        finally:
            writer.close()


def reset(writer):
    """Ends a connection by RST instead of FIN."""
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


class S3(Faulty):
    async def serve(self, reader, writer):
        while True:
            head = await self.head(reader)
            if not head:
                return
            body = await self.body(reader, head)
            self.counts["calls"] += 1
            kinds = self.out or (KINDS if self.chance.random() < self.share else (None,))
            kind = self.chance.choice(kinds)
            if kind:
                self.counts[kind] += 1
            if word := ERRORS.get(kind):
                text = f'<?xml version="1.0"?><Error><Code>{word}</Code><Message>a failure of the test</Message></Error>'
                shown = "" if head.startswith(b"HEAD ") else text
                writer.write(f"HTTP/1.1 {kind} {word}\r\ncontent-length: {len(text)}\r\n\r\n{shown}".encode())
                await writer.drain()
                continue
            if kind == "early reset":
                return reset(writer)
            if kind == "silence":
                return await asyncio.sleep(SILENCE)
            if kind in ("delay", "late"):
                await asyncio.sleep(DELAY if kind == "delay" else LATE)
            answer, content = await self.ask(head, body)
            if kind == "late reset":
                return reset(writer)
            if kind == "cut":
                writer.write(answer + content[: len(content) // 2])
                await writer.drain()
                return reset(writer) if not content else None
            writer.write(answer + content)
            await writer.drain()

    @staticmethod
    async def head(reader):
        try:
            return await reader.readuntil(b"\r\n\r\n")
        except asyncio.IncompleteReadError:
            return b""

    @staticmethod
    def field(head, name):
        for line in head.split(b"\r\n")[1:]:
            key, _, value = line.partition(b":")
            if key.lower() == name:
                return value.strip()
        return None

    async def body(self, reader, head):
        length = self.field(head, b"content-length")
        if length is None and self.field(head, b"transfer-encoding"):
            raise OSError("a chunked request, which this proxy does not know")
        return await reader.readexactly(int(length or 0))

    async def ask(self, head, body):
        """The answer of the server: its head, with the length of its content, and its content."""
        reader, writer = await asyncio.open_connection(self.host, self.upstream)
        try:
            lines = [line for line in head[:-4].split(b"\r\n") if not line.lower().startswith(b"connection:")]
            writer.write(b"\r\n".join(lines) + b"\r\nconnection: close\r\n\r\n" + body)
            await writer.drain()
            answer = await reader.readuntil(b"\r\n\r\n")
            length = self.field(answer, b"content-length")
            is_bare = head.startswith(b"HEAD ") or answer.split(b" ")[1] in (b"204", b"304")
            if is_bare:
                content = b""
            elif length is not None:
                content = await reader.readexactly(int(length))
            else:
                content = await reader.read()
                answer = answer[:-2] + b"content-length: %d\r\n\r\n" % len(content)
            lines = [line for line in answer[:-4].split(b"\r\n") if not line.lower().startswith((b"connection:", b"transfer-encoding:"))]
            return b"\r\n".join(lines) + b"\r\n\r\n", content
        finally:
            writer.close()


class Postgres(Faulty):
    """Reads the messages of both sides, to know which of them makes a transaction last."""

    async def serve(self, reader, writer):
        back, front = await asyncio.open_connection(self.host, self.upstream)
        talk, answering = Talk(), None
        try:
            await self.begin(reader, writer, back, front)
            answering = asyncio.ensure_future(self.answer(back, writer, talk))
            while True:
                message = await self.message(reader)
                if not talk.commits(message) or self.chance.random() >= self.share:
                    front.write(message)
                    await front.drain()
                    continue
                how = self.chance.choice(CUTS)
                self.counts[how] += 1
                if how != "before":
                    talk.silent = True
                    talk.answered.clear()
                    front.write(message)
                    await front.drain()
                if how == "after":
                    await talk.answered.wait()
                return reset(writer)
        finally:
            if answering:
                answering.cancel()
            front.close()

    @staticmethod
    async def begin(reader, writer, back, front):
        """Passes on the messages that have no type: questions for encryption, which the server denies, and the
        start."""
        while True:
            length = await reader.readexactly(4)
            rest = await reader.readexactly(struct.unpack("!i", length)[0] - 4)
            front.write(length + rest)
            await front.drain()
            if struct.unpack("!i", rest[:4])[0] not in (80877103, 80877104):
                return
            writer.write(await back.readexactly(1))

    @staticmethod
    async def message(reader):
        head = await reader.readexactly(5)
        return head + await reader.readexactly(struct.unpack("!i", head[1:])[0] - 4)

    async def answer(self, back, writer, talk):
        try:
            while True:
                message = await self.message(back)
                if message[:1] == b"Z":
                    talk.status = message[5:6]
                    talk.answered.set()
                if not talk.silent:
                    writer.write(message)
                    await writer.drain()
        except (OSError, asyncio.IncompleteReadError):
            talk.answered.set()
            writer.close()


class Talk:
    """The state of one connection to PostgreSQL."""

    def __init__(self):
        self.silent, self.answered = False, asyncio.Event()
        self.status, self.statements, self.bound, self.writes = b"I", {}, b"", False

    def commits(self, message):
        """The message commits: COMMIT, or the end of a writing statement outside a transaction."""
        kind, body = message[:1], message[5:]
        if kind == b"Q":
            return body.strip(b"\0 ;").upper() == b"COMMIT"
        if kind == b"P":
            name, query = body.split(b"\0")[:2]
            self.statements[name] = query.lstrip().upper().startswith(tuple(word.encode() for word in WRITES))
        elif kind == b"B":
            self.bound = body.split(b"\0")[1]
        elif kind == b"E":
            self.writes |= self.statements.get(self.bound, False)
        elif kind == b"S":
            writes, self.writes = self.writes, False
            return writes and self.status == b"I"
        return False


async def main():
    kind, url, seed = sys.argv[1:]
    proxy = {"s3": S3, "postgres": Postgres}[kind](url, seed)
    server = await asyncio.start_server(proxy.handle, "127.0.0.1", 0, limit=1 << 20)
    print(server.sockets[0].getsockname()[1], flush=True)
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def listen():
        for line in sys.stdin:
            print(asyncio.run_coroutine_threadsafe(obey(line), loop).result(), flush=True)
        # Standard input has ended: the user of the proxies is gone.
        loop.call_soon_threadsafe(ended.set)

    async def obey(line):
        return proxy.obey(line)

    threading.Thread(target=listen, daemon=True).start()
    await ended.wait()


if __name__ == "__main__":
    asyncio.run(main())
