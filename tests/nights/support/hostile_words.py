"""Hostile request lines, paths, query strings and headers."""

from urllib.parse import quote

REFUSED = {400, None}


def words(seeded):
    """Names and cases; a case returns the statuses found and those expected (None: any below 500)."""
    material, measurement, job = seeded["materials"][2], seeded["measurements"][0], seeded["jobs"][0]
    content = f"/v1/measurements/{measurement}/content"
    cases = []

    def add(name, line, expected=None, headers=(), body=b"", **options):
        cases.append((name, lambda talk: (talk.request(line, headers, body, **options), expected)))

    def raw(name, data, expected=None, shut=False):
        cases.append((name, lambda talk: (talk.raw(data, shut), expected)))

    for i, data in enumerate([
        b"\0" * 100, b"\r\n" * 500, b"GET\r\n\r\n", b"GET /\r\n\r\n", b"GET  / HTTP/1.1\r\nhost: localhost\r\n\r\n",
        b"GET / HTTP/9.9\r\nhost: localhost\r\n\r\n", b"GET / HTTP/1.1\nhost: localhost\n\n", b"\xff\xfe" * 64,
        b"GET /\x00 HTTP/1.1\r\nhost: localhost\r\n\r\n", b"GET /\x7f HTTP/1.1\r\nhost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: localhost\r\n folded: x\r\n\r\n", b"SSH-2.0-OpenSSH_9.2\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x55" * 200, b"G" * 100_000, b"GET " + b"/" * 1_000_000,
        b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 5000 + b"\r\n", b"GET / HTTP/1.1\r\nx: " + b"y" * 1_000_000,
        b"PRI * HTTP/2.0\r\n\r\nXX\r\n\r\n", b"GET / HTTP/1.1\r\nhost : localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: localhost\r\nbad name: x\r\n\r\n", b"GET / HTTP/1.1\r\nhost: localhost\r\n: x\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: localhost\r\nx: a\x00b\r\n\r\n", b"GET http:// HTTP/1.1\r\nhost: localhost\r\n\r\n",
        b"GET localhost HTTP/1.1\r\nhost: localhost\r\n\r\n", b"GET ?a=b HTTP/1.1\r\nhost: localhost\r\n\r\n",
    ]):
        raw(f"request line {i}", data, shut=True)

    # Hosts.
    for i, host in enumerate(["evil.example", "localhost.evil.example", "0.0.0.0", "127.0.0.1.nip.io", "10.1.2.3:80", "localhost."]):
        add(f"foreign host {i}", "GET /v1/formats", {421}, host=host)
    for i, host in enumerate(["", "a b", "user:pass@localhost", "localhost:port", "localhost:99999999", "[::1", "x" * 5000 + "/"]):
        add(f"no host {i}", "GET /v1/formats", {400}, host=host)
    raw("host missing", b"GET / HTTP/1.1\r\nconnection: close\r\n\r\n", {400})
    raw("host twice", b"GET / HTTP/1.1\r\nhost: localhost\r\nhost: localhost\r\nconnection: close\r\n\r\n", {400})
    raw("absolute form of another host", b"GET http://evil.example/ HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n", {400})
    raw("HTTP/1.0 without a host", b"GET / HTTP/1.0\r\n\r\n", {421})
    for i, origin in enumerate(["https://evil.example", "null", "http://localhost:1", "\xff", "http://localhost:1 http://x", ""]):
        add(f"foreign origin {i}", "POST /v1/jobs", {403}, [b"origin: " + origin.encode("latin-1"), "content-type: application/json"], b"{}")
    add("cross-site delete", f"DELETE /v1/materials/{material}", {403}, ["sec-fetch-site: cross-site"])
    add("cross-site question", f"POST /v1/materials/{material}/evaluate", {403}, ["sec-fetch-site: same-site"], b"{}")

    # Methods.
    for i, method in enumerate(["PUT", "PATCH", "TRACE", "BREW", "get", "X" * 500, "PROPFIND", "OPTIONS", "DELETE"]):
        add(f"method {i}", f"{method} /v1/materials/{material}/content", {405, 400})
    raw("CONNECT", b"CONNECT localhost:80 HTTP/1.1\r\nhost: localhost:80\r\nconnection: close\r\n\r\n")
    raw("OPTIONS of all", b"OPTIONS * HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n", {404})

    # Paths.
    for i, path in enumerate([
        "/../etc/passwd", "/v1/../../etc/passwd", "/v1/blobs/../../../etc/passwd", "/v1/blobs/..%2f..%2fetc%2fpasswd",
        "/v1/blobs/%2e%2e/%2e%2e/catalog.sqlite", "/v1/blobs/%2fetc%2fpasswd", "/v1/blobs/b3-%00", "/v1/blobs/%00",
        "/v1/blobs/b3-..", "/v1/blobs/" + "b3-" + "0" * 63 + "g", "/v1/blobs/B3-" + "0" * 64, "/v1/blobs/%ff%fe",
        "/v1/blobs/" + "a" * 60_000, "/v1/measurements/%", "/v1/measurements/%zz", "/v1/measurements/%c3%28",
        "/v1/measurements//content", "/v1/materials/" + material + "/../content", "/v1/materials/..\\..\\x/content",
        "/v1/materials/" + material + "%00/content", "/v1/materials/" + material + "/preview.png/x", "//v1/formats", "/v1//formats",
        "/v1/formats/../bases", "/v1/formats/%ff/template", "/v1/formats/..%2f..%2fsecret/template", "/v1/formats/%00/template",
        "/v1/jobs/..", "/v1/jobs/%00", "/v1/jobs/00000000-0000-0000-0000-000000000000", "/v1/jobs/urn:uuid:" + job[:8],
        "/v1/jobs/" + "9" * 10_000, "/V1/FORMATS", "/v1/formats/", "/%2e%2e%2f%2e%2e%2f", "/v1/formats%00", "/.git/config", "/wp-login.php",
    ]):
        # 431: with its request line the head of the request is longer than the limit.
        add(f"path {i}", f"GET {path}", {404, 400, 414, 431})
    raw("path of raw bytes", b"GET /v1/formats/\xc3\x28/template HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")

    # Query strings.
    spectrum, color = f"/v1/materials/{material}/spectrum", f"/v1/materials/{material}/color"
    for i, query in enumerate([
        "q=%00", "q=a%00b", "q=%ff", "q=%c3%28", "q=" + "x" * 300, "q=" + "%25" * 5000, "q=" + "x" * 60_000, "limit=0", "limit=-1",
        "limit=1001", "limit=99999999999999999999", "limit=1e3", "limit=", "limit=%00", "limit=1&limit=2", "cursor=", "cursor=x",
        "cursor=zz.b3", "cursor=" + "f" * 17 + ".b3-0", "cursor=1." + "x" * 200, "cursor=%00.%00", "quantity=brd", "quantity=", "unknown=1",
        "q[]=1", "q=a&q=b", "tag=" + "y" * 256, "measurement=b3-0", "measurement=../../etc", "&&&&", "=", "q", "%00=1", "q=%F0%9F%92",
    ]):
        expected = None if query in ("&&&&", "q") else {400, 414, 431}
        add(f"list query {i}", f"GET /v1/materials?{query}", expected)
    for i, query in enumerate([
        "wi=nan,0", "wi=0,inf", "wi=-1,0", "wi=181,0", "wi=1e400,0", "wi=0", "wi=0,0,0", "wi=,", "wi=" + "1," * 9000, "wi=0,0&wo=0,1e308",
        "wi=0,0&wo=0,0&wavelengths=nan", "wi=0,0&wo=0,0&wavelengths=1:1e300:1e-300", "wi=0,0&wo=0,0&wavelengths=1:1e12:1",
        "wi=0,0&wo=0,0&wavelengths=::", "wi=0,0&wo=0,0&wavelengths=-5", "wi=0,0&wo=0,0&index=99999999999999999999",
        "wi=0,0&wo=0,0&index=" + "1," * 5000 + "1", "wi=0,0&wo=0,0&index=-1", "wi=0,0&wo=0,0&interpolation=cubic", "wi=%00,0",
    ]):
        add(f"spectrum query {i}", f"GET {spectrum}?{query}")
    for i, query in enumerate([
        "illuminant=" + "b3-" + "0" * 64, "illuminant=" + measurement, "illuminant=D" + "5" * 1000, "observer=%00", "observer=" + material,
        "illuminant=A&illuminant_column=1", "wi=0,0&wo=0,0&illuminant=E&observer=1964", "index=4294967296",
    ]):
        add(f"color query {i}", f"GET {color}?{query}")
    for i, query in enumerate([
        "format=rgl&side=99999999999", "format=rgl&side=0", "format=rgl&step=1e-300", "format=rgl&step=nan", "format=rgl&step=-1", "format=rgl&step=inf",
        "format=npy&index=99", "format=npy&side=4", "format=%00", "format=" + "x" * 1000, "format=lm63", "format=eulumdat", "format=mbsdf&side=18446744073709551616",
        "format=tabphase&wavelength=nan", "format=csv", "format=spd&wavelength=-1", "rgb=maybe&format=rgl", "format=manifest&step=0",
    ]):
        add(f"export query {i}", f"GET /v1/materials/{material}/export?{query}")
    for i, query in enumerate(["size=63", "size=513", "size=99999999999", "size=-1", "index=1", "size=64&illuminant=x", "size=64&size=65"]):
        add(f"preview query {i}", f"GET /v1/materials/{material}/preview.png?{query}", {400, 422})

    # Ranges and conditions.
    for i, value in enumerate([
        "bytes=0-", "bytes=-0", "bytes=-1", "bytes=5-2", "bytes=99999999999999999999-", "bytes=0-99999999999999999999", "bytes=a-b", "bytes=",
        "bytes=0-0,2-2", "bytes=" + ",".join(f"{n}-{n}" for n in range(2000)), "lines=1-2", "bytes=--1", "bytes=0-0;x", "bytes=\t0-1", "bytes=0x1-2",
        "bytes 0-1/2", "bytes=1-18446744073709551615", "bytes=18446744073709551615-18446744073709551616", "bytes=\xff",
    ]):
        add(f"range {i}", f"GET {content}", {200, 206, 416, 400}, [b"range: " + value.encode("latin-1")])
    for i, header in enumerate([
        "if-none-match: " + '"x",' * 5000, "if-none-match: *", 'if-none-match: W/"', "if-range: \xff", "if-range: *", "accept: " + "a/b," * 5000,
        "accept-encoding: gzip;q=nan", "prefer: wait=99999999999999999999999", "prefer: wait=-1", "prefer: " + ";" * 5000, "request-id: " + "r" * 50_000,
        "request-id: \x1b[31mred", "request-id: a\tb", "cookie: " + "c" * 50_000, "x-forwarded-for: \xff\xfe", "referer: \xff", "user-agent: \x1b]0;title\x07",
        "upgrade: h2c\r\nconnection: upgrade, http2-settings\r\nhttp2-settings: AAMAAABkAAQAAP__", "upgrade: websocket\r\nconnection: upgrade",
        "te: trailers, deflate;q=0.5", "expect: 200-ok", "expect: 100-continue", "authorization: Basic " + "A" * 20_000, "content-type: \xff",
    ]):
        add(f"header {i}", f"GET {content}", None, [header.encode("latin-1")])
    return cases
