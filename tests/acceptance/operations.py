#!/usr/bin/env python3
"""Two nodes and two workers on PostgreSQL and an S3 server, as ops/local.sh starts them: what is uploaded through one
node is compressed and fetched through the other, a killed worker's job goes on elsewhere, stopped processes hand back
what they hold, the store is left without a fault, and no process is left. Before that, every command line and variable
of ops/compose.yaml and of the systemd units is read by the program.

Usage: operations.py BINARY
"""
import contextlib
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
LOCAL = os.path.join(ROOT, "ops", "local.sh")
# Seconds after which something that should happen is taken for something that never will. No time is asserted.
PATIENCE = 300
NODES, WORKERS = ("node-1", "node-2"), ("worker-1", "worker-2")
# A request must not leave the machine through a proxy of the environment.
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def fail(reason):
    sys.exit(f"operations.py: {reason}")


def until(what, condition):
    """The first true value of `condition`."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.1)
    fail(f"{what}: not within {PATIENCE} s")


def text_of(*path):
    with open(os.path.join(*path)) as file:
        return file.read()


def call(url, body=None, method=None, **headers):
    """Status and body of the answer."""
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    request = urllib.request.Request(url, data=body, method=method, headers=headers)
    try:
        with opener.open(request, timeout=PATIENCE) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as refusal:
        return refusal.code, refusal.read()


def asked(expected, url, body=None, method=None, **headers):
    """The JSON of an answer with a status in `expected`."""
    body = json.dumps(body).encode() if isinstance(body, dict) else body
    status, answer = call(url, body, method, **headers)
    if status not in expected:
        fail(f"{method or ('POST' if body else 'GET')} {url}: {status} {answer[:500].decode(errors='replace')}")
    return json.loads(answer) if answer[:1] in (b"{", b"[") else answer


def options_of(binary, command):
    """Flag of each environment variable that a command of the program reads."""
    text = subprocess.run([binary, command, "--help"], capture_output=True, text=True, check=True).stdout
    found = re.finditer(r"^ +(?:-\w, )?(--[\w-]+)(?:(?!^ +--).)*?\[env: (\w+)", text, re.M | re.S)
    return {each[2]: each[1] for each in found}


def understood(binary):
    """Reads the command lines and variables of the files in ops/ by the program; returns the number of them."""
    compose = text_of(ROOT, "ops", "compose.yaml")
    lines = [json.loads(found) for found in re.findall(r'^ +command: (\[".*\])$', compose, re.M)]
    lines += [json.loads(found)[2:] for found in re.findall(r'^ +test: (\["CMD", "wavelume".*\])$', compose, re.M)]
    lines = [line for line in lines if not line[0].startswith("/garage")]
    # The variables of each file apart, as the same ones stand in both.
    files = [dict(re.findall(r"^ +(WAVELUME_\w+): (\S.*)$", compose, re.M))]
    environment = text_of(ROOT, "ops", "wavelume.env")
    for unit in ("wavelume.service", "wavelume-worker.service"):
        text = text_of(ROOT, "ops", unit)
        lines += [shlex.split(found) for found in re.findall(r"^ExecStart=\S+/wavelume (.*)$", text, re.M)]
        environment += "\n".join(re.findall(r"^Environment=(.*)$", text, re.M)) + "\n"
    files.append(dict(re.findall(r"^(WAVELUME_\w+)=(.*)$", environment, re.M)))
    if {line[0] for line in lines} != {"serve", "worker", "migrate", "health"}:
        fail(f"found the commands {sorted({line[0] for line in lines})} in ops/, expected serve, worker, migrate and health")
    flags = options_of(binary, "serve")
    # A key is no flag, which every user of the machine could read.
    if "WAVELUME_BOOTSTRAP_KEY" not in subprocess.run([binary, "serve", "--help"], capture_output=True, text=True).stdout:
        fail("wavelume serve --help does not name WAVELUME_BOOTSTRAP_KEY")
    files[0].pop("WAVELUME_BOOTSTRAP_KEY")
    for variables in files:
        if missing := [name for name in variables if name not in flags]:
            fail(f"variables in ops/ that the program does not read: {', '.join(missing)}")
        # Values of variables are read like those of their flags; what Compose puts in is any text here.
        plain = {flags[name]: re.sub(r"\$\{\w+:\?[^}]*\}", "x", value) for name, value in variables.items()}
        lines.append(["serve", *(word for pair in plain.items() for word in pair)])
    for line in lines:
        # The program reads all that stands before --help, and refuses what it does not know.
        done = subprocess.run([binary, *line, "--help"], capture_output=True, text=True)
        if done.returncode != 0:
            fail(f"wavelume {' '.join(line)}: {done.stderr.strip()}")
    stopped_in_time(compose)
    return len(lines) + sum(map(len, files))


def seconds(text):
    number, unit = re.fullmatch(r"(\d+)([a-z]*)", text).groups()
    return int(number) * {"": 1, "s": 1, "m": 60, "min": 60}[unit]


def stopped_in_time(compose):
    """The time after which a supervisor kills is above the time that the command asks for."""
    parts = []
    for name in ("x-node", "x-worker"):
        block = re.search(rf"^{name}:.*?(?=^\S)", compose, re.M | re.S).group()
        parts.append((f"{name} of compose.yaml", block, r"stop_grace_period: (\w+)"))
    for unit in ("wavelume.service", "wavelume-worker.service"):
        parts.append((unit, text_of(ROOT, "ops", unit), r"^TimeoutStopSec=(\w+)"))
    for name, text, stop in parts:
        command = re.search(r"^ *(command: |ExecStart=).*$", text, re.M).group()
        asked_for = sum(seconds(found) for found in re.findall(r'--(?:notice|drain)"?,? "?(\w+)', command))
        kills = seconds(re.search(stop, text, re.M).group(1))
        if not 0 < asked_for < kills:
            fail(f"{name} kills after {kills} s, expected more than the {asked_for} s of its command")


def verified(binary, directory):
    """Checks the units by systemd-analyze, where there is one. Returns their number."""
    if not shutil.which("systemd-analyze"):
        return 0
    units = []
    for unit in ("wavelume.service", "wavelume-worker.service"):
        units.append(os.path.join(directory, unit))
        with open(units[-1], "w") as file:
            file.write(text_of(ROOT, "ops", unit).replace("/usr/local/bin/wavelume", binary))
    done = subprocess.run(["systemd-analyze", "verify", *units], capture_output=True, text=True)
    complaints = [line for line in done.stderr.splitlines() if "wavelume" in line]
    if complaints:
        fail("systemd-analyze: " + "; ".join(complaints))
    return len(units)


class Site:
    """The processes that ops/local.sh has started in a directory."""

    def __init__(self, binary, directory):
        self.binary, self.directory = binary, directory
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("WAVELUME_", "AWS_", "PG"))}
        python = os.environ.get("WAVELUME_PYTHON", sys.executable)
        # A short lease, so that a killed worker's job is soon taken over, and a drain that no job of minutes ends in.
        self.environment = {**kept, "WAVELUME": binary, "WAVELUME_PYTHON": python, "NODE_PORT": "0", "WAVELUME_LEASE": "2s",
                            "WAVELUME_DRAIN": "1s", "NO_COLOR": "1"}

    def local(self, verb, expected=0):
        done = subprocess.run([LOCAL, self.directory, verb], env=self.environment, capture_output=True, text=True)
        if done.returncode != expected:
            fail(f"ops/local.sh {verb} ended with {done.returncode}: {done.stdout}{done.stderr}")
        return done.stdout

    def pid(self, name):
        return int(text_of(self.directory, "pids", name).split("\n")[0])

    def log(self, name):
        return text_of(self.directory, "logs", f"{name}.log")

    def address(self, name):
        return re.findall(r"^listening on (\S+)$", self.log(name), re.M)[-1]

    def signal(self, name, number):
        """Sends a signal, and waits until the process has ended."""
        pid = self.pid(name)
        os.kill(pid, number)
        until(f"{name} ends", lambda: not alive(pid))

    def run(self, *command):
        """Output of a command on the same database and store."""
        variables = dict(line.split("=", 1) for line in text_of(self.directory, "environment").splitlines())
        done = subprocess.run([self.binary, *command], env={**self.environment, **variables}, capture_output=True, text=True)
        if done.returncode != 0:
            fail(f"wavelume {' '.join(command)}: {done.stdout}{done.stderr}")
        return done.stdout


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout
    return bool(state) and not state.startswith("Z")


def shared_work(site, one, two, scratch):
    """A lamp uploaded through one node, compressed through the other, fetched through the first. Returns its
    material."""
    path = os.path.join(ROOT, "data", "aerolamp.ies")
    with open(path, "rb") as file:
        lamp = file.read()
    id = asked((201,), f"{one}/v1/measurements?filename=aerolamp.ies", lamp)["id"]
    request = {"measurement": id, "target": {"er_l2": 0.01}}
    job = asked((200, 201, 202), f"{two}/v1/jobs", request, content_type="application/json", prefer="wait=60")
    job = until("the lamp is compressed", lambda: state_of(two, job["id"], "succeeded"))
    content = asked((200,), f"{one}/v1/materials/{job['material']}/content")
    own = os.path.join(scratch, "own.wlm")
    subprocess.run([site.binary, "compress", path, "-o", own, "--er-l2", "0.01"], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    with open(own, "rb") as file:
        if content != file.read():
            fail("the nodes and the command line made different bytes")
    return job["material"]


def state_of(node, id, state):
    job = asked((200,), f"{node}/v1/jobs/{id}")
    if job["state"] != state and job["state"] in ("failed", "dead", "cancelled", "succeeded"):
        fail(f"the job {id} is {job['state']}, expected {state}: {job['problem']}")
    return job if job["state"] == state else None


def takeover(site, one, two):
    """A worker is killed in the middle of a job, and the other goes on with it."""
    # With one worker there is no doubt whose the job is.
    site.signal("worker-2", signal.SIGTERM)
    site.local("status", expected=1)
    job = asked((202,), f"{one}/v1/jobs", {"kind": "paper"}, content_type="application/json")["id"]
    until("a worker takes the job", lambda: state_of(two, job, "running"))
    site.local("start")
    names = NODES + ("worker-2",)
    before = {name: len(site.log(name)) for name in names}
    site.signal("worker-1", signal.SIGKILL)
    taken = f'job taken back from a lost worker job="{job}"'
    until("the killed worker's job is taken back", lambda: any(taken in site.log(name)[before[name]:] for name in names))
    until("the other worker takes the job", lambda: state_of(one, job, "running"))
    asked((200, 202), f"{two}/v1/jobs/{job}/cancel", b"")
    until("the job is cancelled", lambda: state_of(one, job, "cancelled"))
    until("worker-2 ends the job", lambda: re.search(f'job ended job="{job}" state=cancelled', site.log("worker-2")))
    # Put back, begun again, and handed back by a worker that is asked to stop.
    asked((200, 202), f"{two}/v1/jobs/{job}/retry", b"")
    until("the job is begun again", lambda: state_of(one, job, "running"))
    site.signal("worker-2", signal.SIGTERM)
    if not state_of(two, job, "queued"):
        fail("a stopped worker did not hand its job back")
    asked((200, 202), f"{one}/v1/jobs/{job}/cancel", b"")
    until("the job is cancelled", lambda: state_of(two, job, "cancelled"))


def looked_after(site, node, material):
    """The store is without a fault, and what is deleted leaves it after its grace, or at once if it is told so."""
    if site.run("migrate").strip() != "up to date":
        fail("the schema is not up to date")
    checked = json.loads(site.run("fsck", "--json"))
    if checked["faults"] or checked["checked_blobs"] != 2:
        fail(f"fsck: {checked}, expected the lamp and its material without faults")
    asked((204,), f"{node}/v1/materials/{material}", method="DELETE")
    swept = json.loads(site.run("gc", "--json"))
    if (swept["removed_blobs"], swept["waiting_blobs"]) != (0, 1):
        fail(f"gc: {swept}, expected one blob in its grace")
    swept = json.loads(site.run("gc", "--now", "--json"))
    if (swept["removed_blobs"], swept["waiting_blobs"], swept["kept_blobs"]) != (1, 0, 1):
        fail(f"gc --now: {swept}, expected one blob removed and one kept")
    if faults := json.loads(site.run("fsck", "--json"))["faults"]:
        fail(f"fsck after gc: {faults}")


def is_open(address):
    host, port = address.removeprefix("http://").split(":")
    with contextlib.closing(socket.socket()) as asking:
        return asking.connect_ex((host, int(port))) == 0


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[-1])
    binary = os.path.abspath(sys.argv[1])
    read = understood(binary)
    with tempfile.TemporaryDirectory() as scratch:
        # PostgreSQL runs as another user where this one is root.
        os.chmod(scratch, 0o755)
        units = verified(binary, scratch)
        site = Site(binary, os.path.join(scratch, "site"))
        try:
            site.local("start")
            started = [site.pid(name) for name in ("s3", *NODES, *WORKERS)]
            one, two = map(site.address, NODES)
            material = shared_work(site, one, two, scratch)
            takeover(site, one, two)
            site.signal("node-2", signal.SIGTERM)
            if " stopped" not in site.log("node-2") or is_open(two):
                fail("node-2 was not stopped properly")
            looked_after(site, one, material)
        finally:
            site.local("stop")
        if left := [pid for pid in started if alive(pid)]:
            fail(f"processes are left: {left}")
        every = subprocess.run(["ps", "-eo", "stat=,args="], capture_output=True, text=True).stdout.splitlines()
        if left := [line for line in every if site.directory in line and not line.startswith("Z")]:
            fail("processes are left:\n" + "\n".join(left))
    print(f"two nodes and two workers held: a job taken over, another handed back, no fault, no process left; "
          f"{read} lines and variables of ops/ understood, {units} units verified")


if __name__ == "__main__":
    main()
