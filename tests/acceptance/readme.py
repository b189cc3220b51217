#!/usr/bin/env python3
"""Runs the commands that the README and other pages show, and writes or compares what they print.

Usage: readme.py BINARY [FIGURES.md]   writes the outputs, docs/previews.png, and the figures of run.py in FIGURES.md
       readme.py --check BINARY        changes nothing; exit code 1 where an output, the picture or a number is outdated

Every line `$ COMMAND` in a block of ```console is run by bash, in order, in a directory of the page's own that holds
data, examples, ops and tests of the repository, and what the page writes: the block after `<!-- file NAME -->`, and the
output of each block of Python that opens with `# writes NAME`, if a command reads it. What is below a command, up to
the next one, is its output. `wavelume serve` and `wavelume demo` listen on a free port, which the pages call
127.0.0.1:8080. `cargo run … --example NAME -- ARGUMENTS` runs the example that was built beside the program or by the
tests. Times, identifiers of jobs and dates may differ; nothing else may.
"""
import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import zlib
from concurrent.futures import ThreadPoolExecutor

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PAGES = [
    "README.md", "docs/cli.md", "docs/formats.md", "docs/http.md", "docs/labs.md", "docs/library.md", "docs/operations.md",
    "docs/settings.md", "examples/batch/README.md",
]
# The page that starts a database, a store, two nodes and two workers. Its lease of 30 s and the pause for it are cut
# short.
SITE, LEASE, PAUSES = "docs/operations.md", "4s", ("sleep 35", "sleep 9")
FIGURES_PAGE = "docs/performance.md"
PICTURE = "docs/previews.png"
# The page whose commands draw the parts of the picture, and the files that they write, from left to right.
DRAWN_IN, DRAWN = "docs/cli.md", ["paint.png", "lantern.png", "checker.png"]
# Pages that have the numbers between the marks `numbers` of the README.
NUMBERS_FROM = ["README.md", "docs/performance.md"]
SHOWN = "127.0.0.1:8080"
SHOWN_NODES, SHOWN_DIRECTORY = ("127.0.0.1:8081", "127.0.0.1:8082"), "/srv"
CONSOLE = r"```console\n(.*?)```"
LIMIT = 120
VARYING = [
    (r"(?m)^( *seconds) +[\d.]+$", r"\1 #"),
    (r"(?m)( %) +\d+\.\d+$", r"\1 #"),
    (r"[0-9a-f]{8}-[0-9a-f]{4}-7[0-9a-f]{3}-[0-9a-f]{4}-[0-9a-f]{12}", "#"),
    (r'("\w+_ms"):\d+', r"\1:#"),
    (r"\d{4}-\d\d-\d\dT[\d:.]+Z", "#"),
    (r"(?m)^([\w-]+ +running +)process \d+", r"\1process #"),
    (r"(postgres://wavelume@127\.0\.0\.1):\d+", r"\1:#"),
    (r"(running +\w+) +\d+ %", r"\1 #"),
    # Ages in the list of jobs.
    (r"(?m)^(# .*?[#%]) +\d+ (?:s|min|h|d)\b", r"\1 #"),
    (r"\b\d+ ms\b", "# ms"),
    # Findings of `doctor` that depend on the installation, and its verdicts on the machine.
    (r"(?m)^(ok +database (?:version|clock)) .*$", r"\1"),
    (r"\b\d+ in use\b", "# in use"),
    (r"(?m)^\w+ +(local \w+( \w+)?) .*$", r"\1"),
]


def comparable(text):
    for pattern, by in VARYING:
        text = re.sub(pattern, by, text)
    return text


def free_ports(count):
    """The first of some free ports in a row."""
    while True:
        with contextlib.ExitStack() as taken:
            first = taken.enter_context(socket.socket())
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                for i in range(1, count):
                    taken.enter_context(socket.socket()).bind(("127.0.0.1", port + i))
            except (OSError, OverflowError):
                continue
            return port


class Session:
    """A bash that runs the commands of one page in a directory of its own."""

    def __init__(self, page, binary, directory):
        self.page, self.binary, self.directory = page, binary, directory
        for name in ("data", "examples", "ops", "tests"):
            os.symlink(os.path.join(ROOT, name), os.path.join(directory, name))
        programs = tempfile.mkdtemp(dir=directory, prefix=".programs")
        os.symlink(binary, os.path.join(programs, "wavelume"))
        self.address = f"127.0.0.1:{free_ports(1)}"
        self.places = {SHOWN: self.address}
        kept = {name: value for name, value in os.environ.items() if not name.startswith("WAVELUME_")}
        path = ":".join([programs, os.path.dirname(sys.executable), os.environ["PATH"]])
        self.environment = {**kept, "PATH": path, "LC_ALL": "C.UTF-8", "NO_COLOR": "1"}
        if page == SITE:
            node = free_ports(2)
            self.places |= {SHOWN_DIRECTORY: directory, **{shown: f"127.0.0.1:{node + i}" for i, shown in enumerate(SHOWN_NODES)}}
            self.environment |= {"WAVELUME_PYTHON": sys.executable, "WAVELUME_LEASE": LEASE, "NODE_PORT": str(node)}
            # PostgreSQL runs as another user where this one is root.
            os.chmod(directory, 0o755)
        self.errors = os.path.join(programs, "errors")
        self.shell = self.start(["bash", "--noprofile", "--norc"], stdin=subprocess.PIPE)
        self.service = None

    def start(self, words, **options):
        return subprocess.Popen(
            words, cwd=self.directory, env=self.environment, stdout=subprocess.PIPE, text=True, start_new_session=True,
            **{"stderr": subprocess.DEVNULL, **options},
        )

    def close(self):
        if self.page == SITE:
            subprocess.run(["ops/local.sh", "site", "stop"], cwd=self.directory, env=self.environment, capture_output=True)
        for process in [self.service, self.shell]:
            if process and process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
                process.wait()

    def run(self, command):
        """Returns what a terminal shows: standard output, and after a failure the error."""
        words = command.split()
        if words[:2] == ["wavelume", "serve"]:
            self.service = self.start([*words, "--listen", self.address])
            return self.shown(self.service.stdout.readline())
        if words[:2] == ["wavelume", "demo"]:
            done = subprocess.run(
                [*words, "--once", "--listen", self.address], cwd=self.directory, env=self.environment, capture_output=True, text=True
            )
            if done.returncode != 0:
                raise RuntimeError(f"{self.page}: {command}: {done.stderr}")
            return self.shown(done.stdout.split("\n\nthe lamp")[0] + "\n…\n")
        example = re.fullmatch(r"cargo run .*--example (\w+)(?: -- (.*))?", command)
        if example:
            builds = os.path.dirname(self.binary), os.path.join(os.path.dirname(os.path.dirname(self.binary)), "debug")
            program = next(filter(os.path.exists, (os.path.join(build, "examples", example[1]) for build in builds)), None)
            if not program:
                raise RuntimeError(f"the example {example[1]} is missing: cargo test --workspace --no-run")
            command = f"(cd {ROOT} && {program} {example[2] or ''})"
        end = "end of the command: "
        for shown, place in self.places.items():
            command = command.replace(shown, place)
        if self.page == SITE:
            command = command.replace(*PAUSES)
        self.shell.stdin.write(f"{{\n{command}\n}} 2>{self.errors}\nprintf '%s%s\\n' '{end}' $?\n")
        self.shell.stdin.flush()
        timer = threading.Timer(LIMIT, lambda: os.killpg(self.shell.pid, signal.SIGKILL))
        timer.start()
        lines = []
        for line in self.shell.stdout:
            before, found, status = line.partition(end)
            lines.append(before)
            if found:
                break
        else:
            raise RuntimeError(f"{self.page}: {command}: the shell ended, or {LIMIT} s were over")
        timer.cancel()
        text = "".join(lines)
        if int(status) != 0:
            print(f"{self.page}: failed, as the page shows: {command}", file=sys.stderr)
            with open(self.errors) as file:
                text += file.read()
        return self.shown(text if text.endswith("\n") or not text else text + "\n")

    def shown(self, text):
        for shown, place in self.places.items():
            text = text.replace(place, shown)
        return text


def commands(block):
    """The commands of a block, each with the output that stands below it; a backslash continues a command."""
    found = []
    for line in block.splitlines(keepends=True):
        if line.startswith("$ "):
            found.append([line[2:], ""])
        elif found and not found[-1][1] and found[-1][0].endswith("\\\n"):
            found[-1][0] += line
        elif found:
            found[-1][1] += line
    return found


def prepare(page, text, directory):
    """Writes the files that the page shows, and those that its Python writes and its commands read."""
    for name, block in re.findall(r"<!-- file (\S+) -->\n```\w*\n(.*?)```", text, flags=re.DOTALL):
        with open(os.path.join(directory, name), "w") as file:
            file.write(block)
    asked = "".join(command for block in re.findall(CONSOLE, text, flags=re.DOTALL) for command, _ in commands(block))
    for script, name in re.findall(r"```python\n(# writes (\S+)\n.*?)```", text, flags=re.DOTALL):
        if re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", asked):
            done = subprocess.run([sys.executable, "-c", script], cwd=directory, capture_output=True, text=True)
            if done.returncode != 0:
                raise RuntimeError(f"{page}: the block that writes {name}: {done.stderr}")


def remade(page, text, session, stale):
    """The page with the outputs of now; those that differ are named in `stale`."""

    def block(found):
        lines = []
        for command, old in commands(found.group(1)):
            new = session.run(command.rstrip("\n"))
            if comparable(new) != comparable(old):
                stale.append(f"{page}: $ {command}--- the page\n{old}--- now\n{new}")
            lines.append(f"$ {command}{new}")
        return "```console\n" + "".join(lines) + "```"

    return re.sub(CONSOLE, block, text, flags=re.DOTALL)


def between(text, mark, new=None):
    """Returns the text between the marks, or the whole text with `new` there."""
    begin, end = f"<!-- {mark} -->\n", f"<!-- end of {mark} -->"
    before, rest = text.split(begin)
    old, after = rest.split(end)
    return old if new is None else f"{before}{begin}\n{new}\n{end}{after}"


def section(text, anchor):
    """A section of a page, by the anchor that GitHub makes of its heading, up to the next heading of its level or
    above."""
    lines = text.splitlines(keepends=True)
    for start, line in enumerate(lines):
        marks, _, heading = line.partition(" ")
        if set(marks) == {"#"} and re.sub(r"[^\w -]", "", heading.strip().lower()).replace(" ", "-") == anchor:
            ends = (i for i in range(start + 1, len(lines)) if re.match(rf"#{{1,{len(marks)}}} ", lines[i]))
            return "".join(lines[start : next(ends, len(lines))])
    return ""


def unfounded(texts):
    """The numbers of the README's first table that stand, as whole numbers, neither in the section to which their row
    links nor, without a link, in one of the pages that they come from."""
    numbers = between(texts["README.md"], "numbers")
    everywhere = "".join(texts[page] for page in NUMBERS_FROM).replace(numbers, "")
    missing = []
    for row in numbers.splitlines():
        link = re.search(r"\]\(([^)#]+)#([^)]+)\)", row)
        source = section(texts[link[1]], link[2]) if link else everywhere
        found = re.findall(r"\*\*(.*?)\*\*", row)
        missing += [one for one in found if not re.search(rf"(?<![\d.,]){re.escape(one)}(?![\d]|[.,]\d)", source)]
    return missing


def pixels(path):
    """Width, height and rows of an RGB picture of 8 bits a channel."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed, size = 8, b"", None
    while at < len(data):
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            size = int.from_bytes(body[:4], "big"), int.from_bytes(body[4:8], "big")
            if body[8:] != bytes([8, 2, 0, 0, 0]):
                sys.exit(f"{path}: expected RGB of 8 bits")
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    raw, (width, height) = zlib.decompress(packed), size
    rows, above = [], bytes(3 * width)
    for y in range(height):
        kind, *row = raw[y * (3 * width + 1) : (y + 1) * (3 * width + 1)]
        for i, value in enumerate(row):
            a, b, c = (row[i - 3] if i > 2 else 0), above[i], (above[i - 3] if i > 2 else 0)
            p = a + b - c
            paeth = min((a, b, c), key=lambda near: abs(p - near))
            row[i] = (value + (0, a, b, (a + b) // 2, paeth)[kind]) & 255
        above = bytes(row)
        rows.append(above)
    return width, height, rows


def beside(parts):
    """Pictures of one height as one picture."""
    pictures = [pixels(path) for path in parts]
    return sum(width for width, _, _ in pictures), pictures[0][1], [b"".join(row) for row in zip(*(rows for _, _, rows in pictures))]


def png(picture):
    width, height, rows = picture

    def chunk(kind, body):
        return len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")

    packed, above = b"", bytes(3 * width)
    for row in rows:
        left = bytes(3) + row[:-3]
        kinds = [row, bytes((x - a) & 255 for x, a in zip(row, left)), bytes((x - b) & 255 for x, b in zip(row, above))]
        best = min(range(3), key=lambda kind: sum(min(x, 256 - x) for x in kinds[kind]))
        packed += bytes([best]) + kinds[best]
        above = row
    head = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(packed, 9)) + chunk(b"IEND", b"")


def main():
    arguments = sys.argv[1:]
    is_check = arguments[:1] == ["--check"]
    arguments = arguments[is_check:]
    if len(arguments) not in ((1,) if is_check else (1, 2)):
        sys.exit(__doc__)
    binary = os.path.abspath(arguments[0])
    stale, texts = [], {}
    for page in sorted({*PAGES, *NUMBERS_FROM, FIGURES_PAGE}):
        with open(os.path.join(ROOT, page)) as file:
            texts[page] = file.read()
    drawn = []

    def remake(page):
        directory = tempfile.mkdtemp()
        prepare(page, texts[page], directory)
        session = Session(page, binary, directory)
        try:
            texts[page] = remade(page, texts[page], session, stale)
            if page == DRAWN_IN:
                drawn.extend(beside([os.path.join(directory, name) for name in DRAWN]))
        finally:
            session.close()
            shutil.rmtree(directory)

    with ThreadPoolExecutor(3) as pool:
        # The site waits for most of its time, so the others go on beside it.
        list(pool.map(remake, sorted(PAGES, key=lambda page: page != SITE)))
    picture = os.path.join(ROOT, PICTURE)
    is_new = not os.path.exists(picture) or list(pixels(picture)) != drawn
    if is_new:
        stale.append(f"{PICTURE}: not what the commands of {DRAWN_IN} draw")
    missing = unfounded(texts)
    if is_check:
        stale += [f"README.md: {found} stands in none of {', '.join(NUMBERS_FROM)}" for found in missing]
        if stale:
            sys.exit("\n".join([*stale, "", f"{len(stale)} out of date: python3 tests/acceptance/readme.py {arguments[0]}"]))
        print(f"the outputs of {', '.join(PAGES)} and {PICTURE} are those of the program")
        return
    if len(arguments) == 2:
        with open(arguments[1]) as file:
            texts[FIGURES_PAGE] = between(texts[FIGURES_PAGE], "figures", file.read())
    for page, text in texts.items():
        with open(os.path.join(ROOT, page), "w") as file:
            file.write(text)
    if is_new:
        with open(picture, "wb") as file:
            file.write(png(drawn))
    for found in missing:
        print(f"README.md: {found} stands in none of {', '.join(NUMBERS_FROM)}: change it by hand", file=sys.stderr)


if __name__ == "__main__":
    main()
