"""Processes of wavelume on one site that a check kills, stops and starts again, and what their database and store
hold."""

import contextlib
import json
import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import xml.etree.ElementTree
from pathlib import Path

from service import binary, with_servers  # noqa: F401

# Seconds after which something that should happen is taken for something that never will.
PATIENCE = 300
# Each change of a job's state into or out of an end, as its transaction committed it.
SQLITE_AUDIT = """
CREATE TABLE test_ends (job TEXT, before TEXT, after TEXT, epoch BIGINT);
CREATE TRIGGER test_ends AFTER UPDATE ON jobs WHEN OLD.state <> NEW.state
  AND (OLD.state NOT IN ('queued', 'running') OR NEW.state NOT IN ('queued', 'running'))
BEGIN INSERT INTO test_ends VALUES (NEW.id, OLD.state, NEW.state, NEW.epoch); END;
"""
POSTGRES_AUDIT = """
CREATE TABLE test_ends (job TEXT, before TEXT, after TEXT, epoch BIGINT);
CREATE FUNCTION test_ended() RETURNS trigger LANGUAGE plpgsql AS
  $$ BEGIN INSERT INTO test_ends VALUES (NEW.id, OLD.state, NEW.state, NEW.epoch); RETURN NEW; END $$;
CREATE TRIGGER test_ends AFTER UPDATE ON jobs FOR EACH ROW WHEN (OLD.state <> NEW.state
  AND (OLD.state NOT IN ('queued', 'running') OR NEW.state NOT IN ('queued', 'running'))) EXECUTE FUNCTION test_ended();
"""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Process:
    """A node or a worker: started again at its own address and data directory."""

    def __init__(self, name, words, environment, directory, port=None):
        self.name, self.words, self.environment, self.port = name, list(map(str, words)), environment, port
        self.log = Path(directory) / f"{name}.log"
        self.process, self.lock, self.paused = None, threading.Lock(), False
        # Last lines of the log when the process had ended by itself although it had worked.
        self.fell = []

    def start(self):
        with open(self.log, "ab") as log:
            log.write(b"--- started\n")
            self.begun = log.tell()
            self.process = subprocess.Popen(
                self.words, stdout=log, stderr=log, stdin=subprocess.DEVNULL, env=self.environment, start_new_session=True
            )

    def ready(self):
        """The process has said that it listens or works."""
        with open(self.log, "rb") as log:
            log.seek(self.begun)
            return re.search(rb"^(listening|working) on ", log.read(1 << 16), re.M) is not None

    def tend(self):
        """Starts a process that has ended by itself, as a supervisor would: it may not have reached its database."""
        with self.lock:
            if self.process and self.process.poll() is not None:
                if self.ready():
                    self.fell.append(self.last_line())
                self.start()

    def kill(self):
        """SIGKILL: no handler runs, nothing is flushed. Then starts the process again."""
        with self.lock:
            self.send(signal.SIGKILL)
            self.process.wait()
            self.start()

    def send(self, number):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)

    def end(self, number=signal.SIGTERM):
        """Stops the process for good; returns its exit code."""
        with self.lock:
            process, self.process = self.process, None
        if process is None:
            return 0
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGCONT)
            os.killpg(process.pid, number)
        try:
            return process.wait(PATIENCE)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)

    def last_line(self):
        return self.log.read_text(errors="replace").rstrip().rsplit("\n", 1)[-1][:500]

    def count(self, pattern):
        """Number of lines of the log in which a pattern is found."""
        with open(self.log, errors="replace") as log:
            return sum(re.search(pattern, line) is not None for line in log)


class Site:
    """Nodes and workers on SQLite and a directory (`shared` is false), or on the servers that `tests/servers` has
    started."""

    def __init__(self, shared, settings, nodes=2, workers=2, database=None, endpoint=None):
        self.shared, self.program = shared, binary().resolve()
        self.directory = tempfile.TemporaryDirectory(prefix="wavelume-night-", ignore_cleanup_errors=True)
        self.path = Path(self.directory.name)
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("WAVELUME_", "RUST_"))}
        self.environment = {**kept, "NO_COLOR": "1", **settings}
        self.own = self.environment
        if shared:
            self.database, self.bucket = os.environ["WAVELUME_TEST_DATABASE"], os.environ["WAVELUME_TEST_STORE"].removeprefix("s3://")
            self.environment |= {"WAVELUME_DATABASE": self.database, "WAVELUME_STORE": f"s3://{self.bucket}/night"}
            # The maintenance commands and the checks go to the servers themselves, whatever stands before them.
            self.own = dict(self.environment)
            self.environment |= {"WAVELUME_DATABASE": database or self.database}
            self.environment |= {"AWS_ENDPOINT_URL": endpoint} if endpoint else {}
        ports = free_ports(nodes)
        self.nodes = [self.process(f"node-{i + 1}", "serve", port) for i, port in enumerate(ports)]
        self.workers = [self.process(f"worker-{i + 1}", "worker") for i in range(workers)]
        self.processes = self.nodes + self.workers

    def process(self, name, command, port=None):
        # SQLite and its directory are shared by the processes of one machine.
        data = self.path / (name if self.shared else "data")
        words = [self.program, command, "--data", data]
        if port:
            words += ["--listen", f"127.0.0.1:{port}"] + (["--workers", "0"] if self.shared else [])
        return Process(name, words, self.environment, self.path, port)

    def __enter__(self):
        try:
            self.run("migrate")
            self.script(POSTGRES_AUDIT if self.shared else SQLITE_AUDIT)
            for process in self.processes:
                process.start()
            self.await_ready()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in self.processes:
            process.end(signal.SIGKILL)
        self.directory.cleanup()

    def await_ready(self):
        for process in self.processes:
            self.until(f"{process.name} is ready", lambda: process.tend() or process.ready())

    def until(self, what, condition, patience=PATIENCE):
        """The first true value of `condition`."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if found := condition():
                return found
            time.sleep(0.05)
        raise AssertionError(f"{what}: not within {patience} s")

    def run(self, *words, settings=None, code=0):
        """Standard output of a maintenance command on this site."""
        data = self.path / ("commands" if self.shared else "data")
        done = subprocess.run([self.program, *words], env={**self.own, "WAVELUME_DATA": str(data), **(settings or {})},
                              capture_output=True, text=True)
        assert done.returncode == code, f"wavelume {' '.join(words)}: exit code {done.returncode}: {done.stdout}{done.stderr}"
        return done.stdout

    def script(self, text):
        """Runs SQL statements in the site's database."""
        if self.shared:
            self.psql(text)
        else:
            with contextlib.closing(sqlite3.connect(self.path / "data" / "catalog.sqlite", timeout=60)) as connection:
                connection.executescript(text)

    def rows(self, query):
        """Rows of a query in the site's database, each a list of texts."""
        if self.shared:
            return [line.split("\t") for line in self.psql(query).splitlines()]
        with contextlib.closing(sqlite3.connect(self.path / "data" / "catalog.sqlite", timeout=60)) as connection:
            return [["" if value is None else str(value) for value in row] for row in connection.execute(query)]

    def number(self, query):
        return int(self.rows(query)[0][0])

    def psql(self, text):
        words = ["psql", self.own["WAVELUME_DATABASE"], "-X", "-q", "-A", "-t", "-F", "\t", "-v", "ON_ERROR_STOP=1", "-c", text]
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 0, f"{text}: {done.stderr}"
        return done.stdout

    def objects(self):
        """Names of all stored objects, as the store itself lists them."""
        if not self.shared:
            root = self.path / "data"
            return {str(path.relative_to(root)) for path in (root / "blobs").rglob("*") if path.is_file()}
        found, more = set(), ""
        while more is not None:
            url = f"{self.own['AWS_ENDPOINT_URL']}/{self.bucket}?list-type=2&prefix=night/blobs/{more}"
            with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url) as answer:
                page = xml.etree.ElementTree.fromstring(answer.read())
            space = page.tag[: page.tag.index("}") + 1]
            found |= {each.text.removeprefix("night/") for each in page.iter(f"{space}Key")}
            token = page.find(f"{space}NextContinuationToken")
            more = None if token is None else "&continuation-token=" + urllib.request.quote(token.text, safe="")
        return found

    def restart_database(self):
        """Stops PostgreSQL without a checkpoint, as a crash would, and starts it again."""
        done = subprocess.run(["sh", "-c", os.environ["WAVELUME_TEST_RESTART"]], capture_output=True, text=True)
        assert done.returncode == 0, f"PostgreSQL did not start again: {done.stdout}{done.stderr}"

    def bugs(self):
        """Lines of the logs that tell of a bug: panics, answers of 500."""
        bad = re.compile(r"panicked|problem=\"?internal|status=500|this is a bug")
        lines = []
        for process in self.processes:
            with open(process.log, errors="replace") as log:
                lines += [f"{process.name}: {line.rstrip()[:300]}" for line in log if bad.search(line)]
        return lines

    def settled(self):
        """Checks database and store of a stopped site; returns the number of stored objects.

        No job has ended twice, each stored byte has its digest, and after the grace, which the test brings forward in
        the database, the store holds the objects that rows name and nothing else.
        """
        ends = self.rows("SELECT job, COUNT(*), MAX(before), MAX(after) FROM test_ends GROUP BY job HAVING COUNT(*) > 1")
        assert not ends, f"jobs that ended twice: {ends[:5]}"
        reopened = self.rows("SELECT * FROM test_ends WHERE before NOT IN ('queued', 'running')")
        assert not reopened, f"jobs that did not stay ended: {reopened[:5]}"
        over = "SELECT COUNT(*) FROM jobs WHERE state NOT IN ('queued', 'running')"
        ended, audited = self.number(over), self.number("SELECT COUNT(*) FROM test_ends")
        assert ended == audited, f"{ended} jobs have ended, {audited} ends were written"
        # Ends the announcements of killed processes, and removes what they were deleting.
        self.script("UPDATE intents SET expires_at = 0")
        self.run("gc", settings={"WAVELUME_GRACE": "0s"})
        self.script("UPDATE doomed SET not_before = 0")
        self.run("gc")
        for table in ("intents", "unnamed", "doomed"):
            left = self.number(f"SELECT COUNT(*) FROM {table}")
            assert left == 0, f"{left} rows are left in the table {table}"
        named = {self.object(*row) for row in self.rows("SELECT digest, generation FROM blobs")}
        stored = self.objects()
        assert named == stored, f"objects without a row: {sorted(stored - named)[:5]}, rows without: {sorted(named - stored)[:5]}"
        report = json.loads(self.run("fsck", "--json"))
        assert report["faults"] == [], f"fsck: {report['faults'][:5]}"
        assert report["checked_blobs"] == len(stored), f"fsck checked {report['checked_blobs']} of {len(stored)} objects"
        return len(stored)

    @staticmethod
    def object(digest, generation):
        return f"blobs/{digest[3:5]}/{digest}" if not generation else f"blobs/default/{digest[3:5]}/{digest}.{generation}"
