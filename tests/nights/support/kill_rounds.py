"""Rounds of kill -9 under load on one site, with stopped workers and restarts of the database between them."""

import argparse
import os
import random
import signal
import threading
import time

from promises import Clients, Ledger
from sites import Site

# Short times, so that leases run out, sweeps come and graces end within seconds. A job may lose any number of workers.
SETTINGS = {
    "WAVELUME_LEASE": "2s", "WAVELUME_SWEEP": "3s", "WAVELUME_GRACE": "1s", "WAVELUME_BACKOFF": "200ms", "WAVELUME_ATTEMPTS": "100",
    "WAVELUME_LOST": "100000", "WAVELUME_NOTICE": "0s", "WAVELUME_DRAIN": "5s",
}
# One in so many rounds stops a worker for longer than its lease, unless one is stopped; one in so many restarts the
# database.
STOPPED, RESTARTED = 5, 20
# Seconds that a round waits at most for its share of accepted requests before it kills all the same.
PATIENCE = 20
# Minutes after which no further round begins, as what follows takes some more. Fewer rounds than asked for are a
# failure.
MINUTES = 26


def run(shared, rounds):
    """Kills `rounds` times, and checks what is left."""
    parser = argparse.ArgumentParser()
    parser.add_argument("rounds", nargs="?", type=int, default=rounds)
    rounds = parser.parse_args().rounds
    seed = int(os.environ.get("WAVELUME_SEED", random.randrange(1 << 30)))
    start, chance = time.monotonic(), random.Random(seed)
    end = start + 60 * float(os.environ.get("WAVELUME_MINUTES", MINUTES))
    kills, restarts, stops = dict.fromkeys(("node", "worker"), 0), 0, []
    with Site(shared, SETTINGS, nodes=2 if shared else 1, workers=2 if shared else 1) as site:
        ledger = Ledger([node.port for node in site.nodes])
        with Clients(ledger, seed):
            try:
                for round in range(rounds):
                    accepted = ledger.counts["jobs"] + ledger.counts["uploads"]
                    # Three of four rounds get as far as two more accepted requests; the fourth may be killed before its
                    # first.
                    wanted, patience = accepted + (2 if round % 4 else 0), time.monotonic() + PATIENCE
                    while ledger.counts["jobs"] + ledger.counts["uploads"] < wanted and time.monotonic() < patience:
                        tend(site)
                        time.sleep(0.01)
                    time.sleep(chance.uniform(0, 0.6))
                    if shared and round % RESTARTED == RESTARTED - 2:
                        site.restart_database()
                        restarts += 1
                    if round % STOPPED == STOPPED - 2 and not any(worker.paused for worker in site.workers):
                        stops.append(paused(chance.choice(site.workers), chance.uniform(2.5, 5)))
                    victim = chance.choice([process for process in site.processes if not process.paused])
                    victim.kill()
                    kills[victim.name.split("-")[0]] += 1
                    if ledger.wrong or time.monotonic() > end:
                        break
                    if round % 100 == 99:
                        print(f"{round + 1} rounds, {time.monotonic() - start:.0f} s: {summary(ledger)}", flush=True)
            finally:
                for each in stops:
                    each.join()
        site.until("all jobs end", lambda: tend(site) or site.number(
            "SELECT COUNT(*) FROM jobs WHERE state IN ('queued', 'running')") == 0)
        site.await_ready()
        ledger.kept(site)
        queued = site.number("SELECT COUNT(*) FROM jobs")
        fell = [f"{process.name}: {line}" for process in site.processes for line in process.fell]
        codes = {process.name: process.end() for process in site.processes}
        taken, refused = (sum(process.count(text) for process in site.processes)
                          for text in ("taken back from a lost worker", "another worker's"))
        wrong = ledger.wrong + site.bugs() + [f"ended by itself: {line}" for line in fell]
        wrong += [f"{name} ended with {code}" for name, code in codes.items() if code != 0]
        if queued != len(ledger.jobs):
            wrong.append(f"{queued} jobs are in the catalog, {len(ledger.jobs)} were accepted")
        print(f"seed {seed}: {sum(kills.values())} kills ({kills['node']} of nodes, {kills['worker']} of workers), {len(stops)} workers "
              f"stopped past their lease, {restarts} immediate restarts of the database in {time.monotonic() - start:.0f} s")
        print(f"{summary(ledger)}; {taken} jobs taken back, {refused} late workers refused")
        if wrong:
            for line in wrong[:20]:
                print(f"WRONG: {line}")
            raise SystemExit(1)
        stored = site.settled()
        print(f"nothing lost, no job ended twice, fsck clean, {stored} objects stored and named, no orphan", flush=True)
        if (done := sum(kills.values())) < rounds:
            raise SystemExit(f"{done} of {rounds} rounds, as the time is over: run it on an idle machine, or set WAVELUME_MINUTES")


def tend(site):
    for process in site.processes:
        process.tend()


def paused(worker, seconds):
    """Stops a worker for longer than its lease, while others are killed."""
    def pause():
        time.sleep(seconds)
        worker.send(signal.SIGCONT)
        worker.paused = False

    worker.paused = True
    worker.send(signal.SIGSTOP)
    thread = threading.Thread(target=pause)
    thread.start()
    return thread


def summary(ledger):
    return ", ".join(f"{count:,} {what}" for what, count in sorted(ledger.counts.items()))
