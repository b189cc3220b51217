"""Hostile bodies: JSON, streams, uploads, bombs, lying lengths."""

import gzip
import io
import json
import struct
import zipfile
import zlib

JSON = "content-type: application/json"
LINES = "content-type: application/x-ndjson"
FLOATS = "content-type: application/octet-stream"


def gzip_bomb(decoded, rounds=1):
    """Zeros, compressed once or several times."""
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    piece = bytes(1 << 20)
    data = b"".join(packer.compress(piece) for _ in range(decoded >> 20)) + packer.flush()
    for _ in range(rounds - 1):
        data = gzip.compress(data)
    return data


def zstd_bomb(decoded, window_log=17):
    """A frame of blocks that repeat one byte: 128 KiB for 4 bytes."""
    out = struct.pack("<IBB", 0xFD2FB528, 0x00, (window_log - 10) << 3)
    blocks = decoded >> 17
    return out + b"".join(struct.pack("<I", (1 << 17) << 3 | 1 << 1 | (n == blocks - 1))[:3] + b"\0" for n in range(blocks))


def zipped(members, method=zipfile.ZIP_DEFLATED):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, data in members:
            archive.writestr(zipfile.ZipInfo(name), data, compress_type=method)
    return buffer.getvalue()


def npy(shape, data=b"", descr="<f4", version=1, length=None):
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    size = len(header) if length is None else length
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", size) + header + data


def bodies(seeded):
    """Names and cases; a case returns the statuses found and those expected (None: any below 500)."""
    material, measurement = seeded["materials"][2], seeded["measurements"][0]
    evaluate = f"/v1/materials/{material}/evaluate"
    cases = []

    def add(name, path, headers, body, expected=None, **options):
        cases.append((name, lambda talk: (talk.request(f"POST {path}", headers, body, **options), expected)))

    deep = 100_000
    job = {"measurement": measurement, "target": {"er_l2": 0.01}}
    texts = [
        b"", b" ", b"null", b"[]", b"0", b'""', b"{", b"}", b"{}", b"{}{}", b'{"a":', b"[" * deep, b'{"a":' * deep, b"[" * deep + b"]" * deep,
        b'{"wi":' + b"[" * deep + b"]" * deep + b"}", b"\xef\xbb\xbf{}", "{}".encode("utf-16"), b"{\"wi\":\"\xff\xfe\"}", b'{"wi":"\\ud800"}', b'{"\\u0000":1}',
        b'{"wi":[[0,1e400]]}', b'{"wi":[[0,1e308]],"wo":[[0,-1e308]]}', b'{"wi":[[NaN,0]]}', b'{"wi":[[-0,0]],"wo":[[180.0000001,0]]}',
        b'{"wi":[[0]]}', b'{"wi":[[0,0,0]]}', b'{"wi":[]}', b'{"wi":[[0,0]],"wi":[[0,0]]}', b'{"count":18446744073709551616}', b'{"count":-1}', b'{"seed":-1}',
        b'{"wavelengths":[1e-320]}', b'{"wavelengths":[]}', b'{"level":256}', b'{"index":[18446744073709551615]}', b'{"index":[' + b"0," * 100_000 + b"0]}",
        b'{"' + b"k" * 5_000_000 + b'":1}', b'{"interpolation":"' + b"x" * 1_000_000 + b'"}', b"9" * 1_000_000, b'{"wi":[[0,' + b"9" * 100_000 + b"]]}",
        b"{}" + b" " * 1_000_000, b"\0" * 1000, b"\x1f\x8b\x08\x00" + b"\0" * 100,
    ]
    for i, text in enumerate(texts):
        add(f"json of a job {i}", "/v1/jobs", [JSON], text, {400, 413, 422})
        add(f"json of a batch {i}", evaluate, [JSON], text)
    for i, (key, value) in enumerate([
        ("name", "a\0b"), ("name", "x" * 201), ("name", ""), ("licence", "\x1b[31m"), ("tags", ["t"] * 33), ("tags", ["\n"]), ("tags", "x"), ("kind", "x" * 10_000),
        ("measurement", "b3-" + "0" * 64), ("measurement", "../../etc/passwd"), ("target", {"er_l2": "x"}), ("target", {"bytes": -1}), ("target", "best"),
        ("target", {"er_l2": 0.01, "bytes": 1}), ("policy", "\0"), ("unknown" * 1000, 1), ("incoming_level", 256), ("metadata", "yes"), ("axes\0", []),
    ]):
        add(f"job field {i}", "/v1/jobs", [JSON], json.dumps({**job, key: value}).encode(), {422})
    for i, tables in enumerate([[], [0], [1, 1], [99999999999999999999], [-1], "1", [[1]]]):
        add(f"tables {i}", "/v1/jobs", [JSON], json.dumps({"kind": "paper", "tables": tables}).encode(), {422})
    for i, headers in enumerate([[], ["content-type: text/plain"], ["content-type: " + "x" * 10_000], [JSON, "content-encoding: gzip"], [JSON + "; charset=\"\xe9\""]]):
        add(f"json media type {i}", "/v1/jobs", [h.encode("latin-1") for h in headers], b"{}", {415, 422})
    for i, key in enumerate(["", " ", "k" * 256, "\xff", "a\tb" * 100]):
        add(f"idempotency key {i}", "/v1/jobs", [JSON, b"idempotency-key: " + key.encode("latin-1")], json.dumps(job).encode(), {400})

    # Streams.
    lines = [
        b"", b"\n" * 1_000_000, b"x", b"{}", b"null\n", b"{" * 10_000 + b"\n", b'{"wi":[0,0]}', b'{"wi":[0,0],"wo":[0,0]}\n\xff\xfe\n', b'{"wi":[0,0],"wo":[0,1e400]}\n',
        b"[" * 1_000_000, b'{"wi":[0,0],"wo":[0,0]' + b" " * 5_000_000 + b"}", b"\0\n", b'{"wi":[0,0],"wo":[0,0]}\r\n' * 3 + b"{",
    ]
    for i, text in enumerate(lines):
        add(f"lines {i}", evaluate, [LINES], text)
    floats = [b"", b"\0", b"\0" * 15, struct.pack("<4f", *[float("nan")] * 4), struct.pack("<4f", 0, 0, float("inf"), 0), struct.pack("<4f", -1, 0, 0, 0), b"\xff" * 1600]
    for i, data in enumerate(floats):
        add(f"floats {i}", evaluate, [FLOATS], data)
    add("options beside a JSON body", evaluate + "?index=0", [JSON], b"{}", {400})
    add("nothing accepted", evaluate, [JSON, "accept: text/html"], b"{}", {406})

    # Uploads.
    lamp = b"IESNA:LM-63-2002\r\nTILT=NONE\r\n"
    uploads = {
        "nothing": (b"", {422}), "zeros": (bytes(1 << 20), {422}), "text": (b"hello", {422}), "bytes": (bytes(range(256)) * 4096, {422}),
        "npy of 1e18 samples": (npy("(1000000000, 1000000000)"), {422}), "npy of a negative shape": (npy("(-1, 5)"), {422}),
        "npy of shape overflow": (npy("(4294967296, 4294967296, 4294967296)"), {422}), "npy header of 4 GiB": (npy("(1,)", version=2, length=0xFFFFFFFF), {422}),
        "npy of objects": (npy("(1,)", b"cos\nsystem\n(S'id'\ntR.", "|O"), {422}), "npy cut off": (npy("(100, 100)", bytes(8)), {422}),
        "npy of NaN": (npy("(4,)", struct.pack("<4f", *[float("nan")] * 4)), None), "npy of a deep header": (b"\x93NUMPY\x01\x00" + struct.pack("<H", 20_000) + b"(" * 20_000, {422}),
        "lamp of many angles": (lamp + b"1 1000 1 99999999 99999999 1 2 0 0 0\r\n1 1 100\r\n", {422}), "lamp of NaN": (lamp + b"1 nan 1 2 1 1 2 0 0 0\r\n1 1 1\r\n0 90\r\n0\r\n1 1\r\n", {422}),
        "lamp of long lines": (lamp + b"9" * 5_000_000, {422}), "table of many columns": (b"wavelength," + b"x," * 200_000 + b"\n400,1\n500,1\n", None),
        "table of huge numbers": (b"wavelength,v\n400,1e308\n500,1e400\n600,-1e999\n", None), "xml entities": (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "' + b"c" * 1000 + b'"><!ENTITY d "' + b"&b;" * 1000 + b'">]><a>&d;</a>', {422}),
        "xml deep": (b"<a>" * 200_000, {422}), "material of zeros": (b"WLM1" + bytes(100_000), {422}), "arrow": (b"ARROW1\0\0" + b"\xff" * 10_000, {422}),
        "zip bomb": (zipped([(f"{n}.npy", bytes(300 << 20)) for n in range(1)]), {422}), "zip of a zip": (zipped([("a.zip", zipped([("b.csv", b"1")]))]), {422}),
        "zip of traversal": (zipped([("../../../../tmp/wavelume-evil.csv", b"wavelength,v\n400,1\n500,1\n"), ("/etc/x.csv", b"1")]), None),
        "zip of many files": (zipped([(f"{n}.txt", b"x") for n in range(20_000)], zipfile.ZIP_STORED), {422}), "zip of odd names": (zipped([("a\x1b[31m\n.csv", b"x"), ("n" * 60_000, b"x")]), {422}),
        "zip cut off": (zipped([("a.csv", b"x" * 1000)])[:-30], {422}), "zip mark alone": (b"PK\x03\x04" + b"\xff" * 1000, {422}), "empty zip": (zipped([]), {422}),
    }
    honest = bytearray(zipped([("a.csv", b"wavelength,v\n400,1\n500,1\n")]))
    at = honest.rindex(b"PK\x01\x02")
    honest[at + 24 : at + 28] = b"\xff\xff\xff\x7f"
    uploads["zip of a lying size"] = (bytes(honest), {422})
    for name, (data, expected) in uploads.items():
        add(f"upload {name}", "/v1/measurements", [], data, expected)
    for name, coding, data, expected in [
        ("gzip bomb", "gzip", gzip_bomb(1 << 30), {413}), ("gzip in gzip", "gzip, gzip", gzip_bomb(64 << 20, 2), {415}), ("double gzip as one", "gzip", gzip_bomb(256 << 20, 2), None),
        ("zstd bomb", "zstd", zstd_bomb(1 << 30), {413}), ("zstd of a large window", "zstd", zstd_bomb(1 << 20, 31), {400, 413}), ("gzip cut off", "gzip", gzip.compress(b"x" * 10_000)[:-9], {400}),
        ("gzip and garbage", "gzip", gzip.compress(b"x") + b"\xff" * 1000, {400, 422}), ("no gzip", "gzip", b"plain", {400}), ("no zstd", "zstd", b"plain", {400}),
        ("brotli", "br", b"x", {415}), ("unknown coding", "x" * 5000, b"x", {415}), ("hundred codings", ",".join(["gzip"] * 100), b"x", {415}), ("empty gzip", "gzip", gzip.compress(b""), {422}),
        ("gzip of a bad checksum", "gzip", gzip.compress(b"x" * 100)[:-8] + bytes(8), {400}), ("many members", "gzip", gzip.compress(b"x") * 20_000, {422}),
    ]:
        add(f"coded {name}", "/v1/measurements", [f"content-encoding: {coding}"], data, expected)

    # Lying lengths.
    for i, header in enumerate([
        "content-length: -1", "content-length: 99999999999999999999999", "content-length: 1\r\ncontent-length: 2", "content-length: 0x10", "content-length: 5, 6", "content-length: +5",
        "content-length: 5\r\ntransfer-encoding: chunked", "transfer-encoding: gzip", "transfer-encoding: chunked, identity", "transfer-encoding: xchunked", "content-length: ",
    ]):
        add(f"length {i}", "/v1/measurements", [header], b"hello", shut=True)
    for i, chunks in enumerate([
        b"zz\r\n", b"FFFFFFFFFFFFFFFFF\r\n", b"5\r\nhello", b"5\r\nhelloX", b"-1\r\n", b"1;" + b"e" * 100_000 + b"\r\nx\r\n0\r\n\r\n", b"0\r\n" + b"t: x\r\n" * 10_000 + b"\r\n", b"5 \r\nhello\r\n0\r\n\r\n",
    ]):
        add(f"chunks {i}", "/v1/measurements", ["transfer-encoding: chunked"], chunks, shut=True)
    add("declared more than sent", "/v1/measurements", ["content-length: 1000"], b"half", {400, None}, shut=True)
    add("declared more than the limit", "/v1/measurements", ["content-length: 99999999999"], b"", {413})
    add("json declared more than sent", "/v1/jobs", [JSON, "content-length: 100000"], b"{", {400, None}, shut=True)
    add("floats declared more than sent", evaluate, [FLOATS, "content-length: 160000"], bytes(160), shut=True)
    return cases
