#!/usr/bin/env python3
"""A client that a generator makes of the HTTP description, used for the first five minutes with the service.

Usage: client.py BINARY

openapi-python-client writes the client; every warning of the generator is a failure, as it stands for a part of the
interface that the client lacks. The client then uploads a lamp and its spectrum, compresses them to 1 %, and asks for
the material, a spectrum, directions, a colour and the file.
"""
import compileall
import contextlib
import importlib
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# Types of content that the generator does not know, all of which are bytes to it.
BYTES = ("application/vnd.wavelume.material", "image/png", "application/x-ndjson", "application/offset+octet-stream")


def generate(binary, directory):
    """Writes the client package `wavelume_client` into `directory`."""
    description = os.path.join(directory, "openapi.yaml")
    with open(description, "w") as file:
        subprocess.run([binary, "openapi"], stdout=file, check=True)
    config = os.path.join(directory, "config.json")
    with open(config, "w") as file:
        json.dump({"content_type_overrides": dict.fromkeys(BYTES, "application/octet-stream")}, file)
    tools = os.path.dirname(sys.executable)
    command = ["openapi-python-client", "generate", "--path", description, "--config", config, "--meta", "none"]
    command += ["--output-path", os.path.join(directory, "wavelume_client"), "--fail-on-warning"]
    path = os.pathsep.join([tools, os.environ.get("PATH", "")])
    done = subprocess.run([os.path.join(tools, command[0]), *command[1:]], capture_output=True, text=True,
                          env={**os.environ, "PATH": path})
    if done.returncode != 0 or "WARNING" in done.stdout:
        sys.exit(f"the generator cannot read the description:\n{done.stdout}{done.stderr}")
    if not compileall.compile_dir(os.path.join(directory, "wavelume_client"), quiet=1):
        sys.exit("the generated client does not compile")


@contextlib.contextmanager
def service(binary, directory):
    """Runs the service on a free port and yields its address."""
    log = open(os.path.join(directory, "log"), "w+")
    data = os.path.join(directory, "data")
    server = subprocess.Popen([binary, "serve", "--data", data, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                              stderr=log, text=True)
    try:
        line = server.stdout.readline()
        if not line.startswith("listening on "):
            sys.exit(f"serve did not say where it listens: {line}")
        yield line.split()[2].rstrip(",")
    finally:
        server.terminate()
        server.wait(30)


def check(claim, found):
    if not claim:
        sys.exit(f"FAILED: {found}")


def use(address):
    """Does with the client what the first five minutes do with the command line."""
    def call(tag, name):
        return importlib.import_module(f"wavelume_client.api.{tag}.{name}").sync

    models = importlib.import_module("wavelume_client.models")
    client = importlib.import_module("wavelume_client").Client(base_url=address, timeout=120)
    types = importlib.import_module("wavelume_client.types")

    def upload(name, **options):
        with open(os.path.join(ROOT, "data", name), "rb") as file:
            body = types.File(payload=io.BytesIO(file.read()), file_name=name)
        return call("measurements", "post_measurement")(client=client, body=body, filename=name, **options)

    spectrum = upload("aerolamp.csv")
    check(spectrum.quantity == models.Quantity.SPECTRUM and spectrum.axes[-1].count == 1644, spectrum)
    lamp = upload("aerolamp.ies", spectrum=spectrum.id)
    kinds = [axis.kind.value for axis in lamp.axes]
    check(kinds == ["theta_o", "phi_o", "wavelength"] and lamp.options.spectrum == spectrum.id, lamp)
    request = models.CompressRequest(measurement=lamp.id, target=models.TargetErL2(er_l2=0.01), name="lamp")
    job = call("jobs", "post_job")(client=client, body=request, prefer="wait=60", idempotency_key="lamp")
    start = time.monotonic()
    while job.state in (models.JobState.QUEUED, models.JobState.RUNNING) and time.monotonic() - start < 300:
        time.sleep(0.5)
        job = call("jobs", "get_job")(job.id, client=client)
    check(job.state == models.JobState.SUCCEEDED, job)

    material = call("materials", "get_material")(job.material, client=client)
    check(material.er_l2 <= 0.01 and material.samples == 2007324 and material.name == "lamp", material)
    check(material.provenance.request.target.er_l2 == 0.01, material.provenance)
    check(material.notes and all(note.message for note in material.notes), material.notes)
    page = call("materials", "list_materials")(client=client, measurement=lamp.id)
    check([item.id for item in page.items] == [material.id], page)
    answer = call("evaluation", "get_spectrum")(material.id, client=client, wo="180,0", wavelengths="300,350")
    check(len(answer.values) == 2 and all(value >= 0 for value in answer.values), answer)
    body = models.SampleRequest(count=16, seed=1)
    drawn = call("evaluation", "sample")(material.id, client=client, body=body)
    check(len(drawn.directions) == 16 and all(math.isfinite(pdf) and pdf > 0 for pdf in drawn.pdf), drawn)
    content = call("materials", "get_material_content")(material.id, client=client)
    check(len(content.payload.read()) == material.bytes_, "the size of the file")

    request = models.CompressRequest(measurement=lamp.id, target=models.TargetErL2(er_l2=-1.0))
    refusal = call("jobs", "post_job")(client=client, body=request)
    check(isinstance(refusal, models.Problem) and refusal.type_.endswith(":bad-setting"), refusal)


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[2])
    binary = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as directory:
        generate(binary, directory)
        sys.path.insert(0, directory)
        with service(binary, directory) as address:
            use(address)
    print("the generated client does the five minutes")


if __name__ == "__main__":
    main()
