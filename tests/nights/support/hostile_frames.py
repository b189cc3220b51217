"""Hostile HTTP/2: floods, resets, continuations, broken frames and header blocks."""

import struct

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RESET, SETTINGS, PUSH, PING, GOAWAY, WINDOW, CONTINUATION = range(10)
END_STREAM, END_HEADERS, PADDED = 1, 4, 8


def frame(kind, flags=0, stream=0, payload=b"", length=None):
    size = len(payload) if length is None else length
    return struct.pack(">I", size)[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


def integer(value, bits, first=0):
    """An integer of HPACK with a prefix of `bits`."""
    most = (1 << bits) - 1
    if value < most:
        return bytes([first | value])
    out, value = [first | most], value - most
    while value >= 128:
        out.append(value % 128 + 128)
        value //= 128
    return bytes([*out, value])


def block(fields):
    """A header block without any table."""
    text = lambda word: integer(len(word), 7) + word  # noqa: E731
    return b"".join(b"\0" + text(name) + text(value) for name, value in fields)


def asked(path=b"/healthz", method=b"GET", authority=b"localhost", more=(), scheme=b"http"):
    fields = [(b":method", method), (b":scheme", scheme), (b":path", path), (b":authority", authority), *more]
    return [field for field in fields if field[1] is not None]


def get(stream=1, flags=END_HEADERS | END_STREAM, **options):
    return frame(HEADERS, flags, stream, block(asked(**options)))


def talk_frames(talk, data):
    """Sends frames; the status of the first answer (indexed or literal), or None if there is none."""
    with talk.connect() as connection:
        connection.settimeout(5)
        try:
            for start in range(0, len(data), 1 << 16):
                connection.sendall(data[start : start + (1 << 16)])
        except OSError:
            pass
        received = b""
        try:
            while True:
                while len(received) >= 9:
                    size = int.from_bytes(received[:3], "big")
                    if len(received) < 9 + size:
                        break
                    kind, payload = received[3], received[9 : 9 + size]
                    received = received[9 + size :]
                    if kind == HEADERS:
                        return status(payload)
                    if kind in (GOAWAY, RESET):
                        return None
                piece = connection.recv(1 << 16)
                if not piece:
                    return None
                received += piece
        except OSError:
            return None


INDEXED = {8: 200, 9: 204, 10: 206, 11: 304, 12: 400, 13: 404, 14: 500}


def status(payload):
    """The status that a header block begins with; h2 writes it first."""
    first = payload[0]
    if first & 0x80:
        return INDEXED.get(first & 0x7F)
    # A literal with the name of entry 8; its value plain or in Huffman code, where digits 0, 1, 2 have 5 bits, others
    # 6.
    size, coded = payload[1] & 0x7F, payload[1] & 0x80
    value = payload[2 : 2 + size]
    if not coded:
        return int(value)
    bits = "".join(f"{byte:08b}" for byte in value)
    codes = {"00000": "0", "00001": "1", "00010": "2", **{f"{25 + n:06b}": str(3 + n) for n in range(7)}}
    digits, word = "", ""
    for bit in bits:
        word += bit
        if word in codes and len(digits) < 3:
            digits, word = digits + codes[word], ""
    return int(digits)


def frames(seeded):
    """Names and cases; a case returns the statuses found and those expected (None: any below 500)."""
    start = PREFACE + frame(SETTINGS)
    material = seeded["materials"][2].encode()
    evaluate = b"/v1/materials/" + material + b"/evaluate"
    post = asked(evaluate, b"POST", more=[(b"content-type", b"application/json")])
    rapid = b"".join(get(2 * n + 1) + frame(RESET, 0, 2 * n + 1, struct.pack(">I", 8)) for n in range(5000))
    slow = b"".join(get(2 * n + 1, path=b"/v1/materials/" + material + b"/albedo?wi=0,0") + frame(RESET, 0, 2 * n + 1, bytes(4)) for n in range(500))
    endless = frame(HEADERS, END_STREAM, 1, block(asked())) + b"".join(frame(CONTINUATION, 0, 1, block([(b"x", b"y" * 8000)])) for _ in range(500))
    empty = frame(HEADERS, END_STREAM, 1, block(asked())) + frame(CONTINUATION, 0, 1) * 20_000
    # Entries of the dynamic table, named again and again.
    table = b"\x40" + integer(1, 7) + b"x" + integer(4000, 7) + b"z" * 4000
    bomb = frame(HEADERS, END_HEADERS | END_STREAM, 1, block(asked()) + table + b"\xbe" * 12_000)
    good = {
        "an honest request": get(), "no settings of its own": get(), "unknown frames": frame(0xEE, 0xFF, 7, b"?" * 100) + get(),
        "priority": frame(PRIORITY, 0, 1, struct.pack(">IB", 0, 15)) + get(), "pings": frame(PING, 0, 0, bytes(8)) * 50 + get(),
        "padding": frame(HEADERS, END_HEADERS | END_STREAM | PADDED, 1, b"\x05" + block(asked()) + bytes(5)),
        "unknown settings": frame(SETTINGS, 0, 0, struct.pack(">HI", 0x99, 1) * 100) + get(),
        "split header block": frame(HEADERS, END_STREAM, 1, block(asked())[:5]) + frame(CONTINUATION, END_HEADERS, 1, block(asked())[5:]),
    }
    cases = [(f"h2 {name}", lambda talk, data=data: (talk_frames(talk, start + data), {200})) for name, data in good.items()]
    for name, data, expected in [
        ("foreign authority", get(authority=b"evil.example"), {421}), ("no authority", get(authority=None), {400, None}),
        ("authority and another host", get(more=[(b"host", b"evil.example")]), {400, None}), ("foreign host alone", get(authority=None, more=[(b"host", b"evil.example")]), {421}),
        ("foreign origin", frame(HEADERS, END_HEADERS, 1, block([*post, (b"origin", b"https://evil.example")])) + frame(DATA, END_STREAM, 1, b"{}"), {403}),
        ("traversal", get(path=b"/v1/blobs/../../etc/passwd"), {404}), ("NUL in the query", get(path=b"/v1/materials?q=%00"), {400}), ("long path", get(path=b"/" + b"a" * 15_000), {404, 414, 431, None}),
        ("deep JSON", frame(HEADERS, END_HEADERS, 1, block(post)) + frame(DATA, END_STREAM, 1, b"[" * 16_000), {400, 422}),
    ]:
        cases.append((f"h2 {name}", lambda talk, data=data, expected=expected: (talk_frames(talk, start + data), expected)))
    broken = {
        "preface alone": b"", "garbage": b"\xff" * 1000, "zeros": bytes(1000), "rapid reset": rapid, "resets of work": slow, "endless continuations": endless,
        "empty continuations": empty, "table bomb": bomb, "settings flood": frame(SETTINGS) * 20_000, "ping flood": frame(PING, 0, 0, bytes(8)) * 20_000,
        "priority flood": frame(PRIORITY, 0, 1, struct.pack(">IB", 0, 1)) * 20_000, "window of nothing": frame(WINDOW, 0, 0, bytes(4)),
        "window overflow": frame(WINDOW, 0, 0, struct.pack(">I", 0x7FFFFFFF)) * 2, "data before headers": frame(DATA, 0, 1, b"x"), "reset of an idle stream": frame(RESET, 0, 5, bytes(4)),
        "even stream": get(2), "stream 0": get(0), "streams backwards": get(5) + get(3), "one stream twice": get(1) + get(1), "depends on itself": frame(PRIORITY, 0, 3, struct.pack(">IB", 3, 1)),
        "push": frame(PUSH, END_HEADERS, 1, struct.pack(">I", 2) + block(asked())), "goaway": frame(GOAWAY, 0, 0, bytes(8)) + get(), "oversized frame": frame(DATA, 0, 1, b"", 0xFFFFFF),
        "length of a ping": frame(PING, 0, 0, b"x"), "settings of 5 bytes": frame(SETTINGS, 0, 0, b"12345"), "settings out of range": frame(SETTINGS, 0, 0, struct.pack(">HI", 4, 0xFFFFFFFF)),
        "settings on a stream": frame(SETTINGS, 0, 1), "too much padding": frame(HEADERS, END_HEADERS | END_STREAM | PADDED, 1, b"\xff" + block(asked())),
        "continuation of nothing": frame(CONTINUATION, END_HEADERS, 1, block(asked())), "headers within headers": frame(HEADERS, 0, 1, block(asked())) + get(3),
        "upper-case name": get(more=[(b"X-Upper", b"1")]), "no method": get(method=None), "no path": get(path=None), "empty path": get(path=b""), "two paths": get(more=[(b":path", b"/")]),
        "unknown pseudo header": get(more=[(b":x", b"1")]), "pseudo header at the end": frame(HEADERS, END_HEADERS | END_STREAM, 1, block([(b"x", b"y"), *asked()])), "connection header": get(more=[(b"connection", b"close")]),
        "transfer-encoding": get(more=[(b"transfer-encoding", b"chunked")]), "newline in a value": get(more=[(b"x", b"a\r\nb")]), "NUL in a value": get(more=[(b"x", b"a\0b")]),
        "bad HPACK index": frame(HEADERS, END_HEADERS | END_STREAM, 1, b"\xff\xff\xff\xff\x0f"), "bad HPACK integer": frame(HEADERS, END_HEADERS | END_STREAM, 1, b"\x00\x7f" + b"\xff" * 20), "bad Huffman": frame(HEADERS, END_HEADERS | END_STREAM, 1, b"\x00\x81\x00\x84\xff\xff\xff\xff"),
        "table size": frame(HEADERS, END_HEADERS | END_STREAM, 1, b"\x3f" + b"\xff" * 4 + b"\x07" + block(asked())), "header of 1 MiB": frame(HEADERS, END_STREAM, 1, block(asked())) + frame(CONTINUATION, 0, 1, b"\0\x01x\x7f\x81\xff\x3f" + b"y" * 16_000) * 64,
        "length that lies": frame(HEADERS, END_HEADERS, 1, block([*post, (b"content-length", b"1000")])) + frame(DATA, END_STREAM, 1, b"{}"), "length too short": frame(HEADERS, END_HEADERS, 1, block([*post, (b"content-length", b"1")])) + frame(DATA, END_STREAM, 1, b"{}"),
        "body cut by a reset": frame(HEADERS, END_HEADERS, 1, block(post)) + frame(DATA, 0, 1, b"{") + frame(RESET, 0, 1, bytes(4)), "CONNECT": get(method=b"CONNECT", scheme=None, path=None), "200 streams at once": b"".join(get(2 * n + 1, path=b"/v1/formats") for n in range(200)),
        "trailers": frame(HEADERS, END_HEADERS, 1, block(post)) + frame(DATA, 0, 1, b"{}") + frame(HEADERS, END_HEADERS | END_STREAM, 1, block([(b"x", b"y")])), "half a frame": get()[:20],
    }
    for name, data in broken.items():
        cases.append((f"h2 {name}", lambda talk, data=data: (talk_frames(talk, start + data), None)))
    return cases
