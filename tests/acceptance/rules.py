#!/usr/bin/env python3
"""Checks ops/prometheus-rules.yml: by promtool, with the figures of rules.yml that raise alerts, and each metric in it
against those that a running service shows.

Usage: rules.py BINARY

Most metrics with labels are shown only once they have counted, so the service is made to do what they count: an upload,
a job, a refusal and damaged bytes. It has a certificate, made by openssl, whose end is a metric.
"""
import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
RULES = os.path.join(ROOT, "ops", "prometheus-rules.yml")
# Figures, and the alerts that they raise.
TESTS = os.path.join(ROOT, "tests", "acceptance", "rules.yml")
# The metric that Prometheus itself makes for each target.
OWN = {"up"}
LAMP = os.path.join(ROOT, "data", "aerolamp.ies")
# Without checks: the certificate is not what is tested here.
UNCHECKED = ssl._create_unverified_context()
opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), urllib.request.HTTPSHandler(context=UNCHECKED))


def call(url, body=None, **headers):
    """Status and body of the answer."""
    request = urllib.request.Request(url, data=body, headers={name.replace("_", "-"): value for name, value in headers.items()})
    try:
        with opener.open(request, timeout=120) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as refusal:
        return refusal.code, refusal.read()


def expressions():
    """The expressions of the rules."""
    with open(RULES) as file:
        text = file.read()
    found = re.findall(r"^ +expr: (?:\|\n((?:^ {10,}.*\n)+)|(.*)$)", text, re.M)
    return ["".join(pair) for pair in found]


def metrics_of(expression):
    """Metrics of an expression, each with the labels that are asked of it."""
    wanted = {}
    for name, labels in re.findall(r"\b(wavelume_\w+|up)\b(?:\{([^}]*)\})?", expression):
        wanted.setdefault(name, set()).update(re.findall(r"(\w+) ?(?:=~|!=|!~|=)", labels or ""))
    return wanted


def shown(base):
    """Metrics of a running service, each with its labels."""
    metrics = {}
    for line in call(f"{base}/metrics")[1].decode().splitlines():
        if line and not line.startswith("#"):
            name, labels = re.match(r"(\w+)(?:\{(.*)\})? ", line).groups()
            metrics.setdefault(name, set()).update(re.findall(r'(\w+)="', labels or ""))
    return metrics


def counted(binary, scratch):
    """Metrics of a service that has had an upload, a job, a refusal and damaged bytes."""
    data = os.path.join(scratch, "data")
    cert, key = os.path.join(scratch, "cert.pem"), os.path.join(scratch, "key.pem")
    make = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    subprocess.run([*make, "-keyout", key, "-out", cert, "-subj", "/CN=localhost"], check=True, stderr=subprocess.DEVNULL)
    command = [binary, "serve", "--data", data, "--listen", "127.0.0.1:0", "--exports-each", "0", "--content-bytes", "0"]
    command += ["--tls-cert", cert, "--tls-key", key]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("WAVELUME_")}
    with open(os.path.join(scratch, "log"), "w") as log:
        service = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment)
        try:
            base = service.stdout.readline().split()[-1]
            with open(LAMP, "rb") as file:
                id = json.loads(call(f"{base}/v1/measurements?filename=aerolamp.ies", file.read())[1])["id"]
            body = json.dumps({"measurement": id, "target": {"er_l2": 0.01}}).encode()
            job = json.loads(call(f"{base}/v1/jobs", body, content_type="application/json", prefer="wait=60")[1])
            while job["state"] in ("queued", "running"):
                job = json.loads(call(f"{base}/v1/jobs/{job['id']}")[1])
            call(f"{base}/v1/materials/{job['material']}/export?format=npy")
            for folder, _, files in os.walk(os.path.join(data, "blobs")):
                for name in files:
                    with open(os.path.join(folder, name), "r+b") as file:
                        file.write(b"damaged")
            call(f"{base}/v1/materials/{job['material']}/content")
            return shown(base)
        finally:
            service.terminate()
            service.wait()


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[3])
    if not shutil.which("promtool"):
        sys.exit("rules.py: promtool is missing; install Prometheus (Debian: apt install prometheus)")
    if not shutil.which("openssl"):
        sys.exit("rules.py: openssl is missing (Debian: apt install openssl)")
    for command in (["check", "rules", RULES], ["test", "rules", TESTS]):
        if subprocess.run(["promtool", *command]).returncode != 0:
            sys.exit(1)
    with tempfile.TemporaryDirectory() as scratch:
        live = counted(os.path.abspath(sys.argv[1]), scratch)
    wrong, every, wanted = [], expressions(), {}
    for one in every:
        metrics = metrics_of(one)
        if not metrics:
            wrong.append(f"{one}: names no metric")
        for name, labels in metrics.items():
            wanted.setdefault(name, set()).update(labels)
    for name, labels in wanted.items():
        if name in OWN:
            continue
        if name not in live:
            wrong.append(f"{name}: the service has no such metric")
        elif missing := labels - live[name]:
            wrong.append(f"{name}: has no label {', '.join(sorted(missing))}")
    if wrong:
        sys.exit("\n".join(["rules.py:", *wrong]))
    print(f"the metrics of {len(every)} alerts are those of the service")


if __name__ == "__main__":
    main()
