"""The smallest file of each peer within an error: the search that run_peers.py and grids.py share.

A peer's knob is searched for the smallest file with an error within the target, from the loosest target on. The best
of its settings is its entry, and a setting with 1.5 times its bytes is not followed further. The search is bounded by
a number of encodings, so the same arrays give the same results. Arrays above 10 MB get fewer encodings and settings,
and no slow peers.
"""

import hashlib
import math
import resource
import time

import numpy as np

import others

LARGE = 10e6
HOPELESS = 1.5
FIELDS = """array samples digest target group peer setting bytes er_l1 er_l2 max_relative encode_mb_s decode_mb_s
seconds note noise bound_bytes over_bound""".split()


class Truth:
    """An array, and the errors of what stands for it.

    Scored are samples > 0 and not below `least`. `weights`, of the array's shape, say how often each sample counts.
    """

    encodings = 6  # at most, for a setting at a target
    near = 0.98  # of the target: an error from there on ends the search

    def __init__(self, name, values, axes, least=0.0, weights=None):
        self.name, self.axes = name, axes
        self.values = np.ascontiguousarray(values, np.float32)
        self.digest = hashlib.sha256(self.values.tobytes()).hexdigest()[:16]
        known = (values > 0) & (values >= least)
        self.scored = np.flatnonzero(known)
        self.wanted = values.reshape(-1)[self.scored].astype(np.float64)
        self.weights = None if weights is None else weights.reshape(-1)[self.scored]
        self.megabytes = self.values.nbytes / 1e6
        self.large = self.values.nbytes > LARGE
        if self.large:
            self.encodings = 4
        self.provide(*self.filled(known))

    def filled(self, known):
        """The input of peers, as values and as logarithms: 0 and the least logarithm where a sample is not scored."""
        clean = np.where(known, self.values, np.float32(0))
        return clean, np.log(np.maximum(clean, np.float32(self.wanted.min())))

    def provide(self, linear, log):
        self.for_peers = {"linear": linear, "log": log}
        self.rms = float(np.sqrt((linear.astype(np.float64) ** 2).mean()))

    def errors(self, found):
        """er(L1), er(L2) and the largest relative error, as fractions."""
        relative = np.abs(found.reshape(-1)[self.scored].astype(np.float64) - self.wanted) / self.wanted
        mean = lambda of_each: float(np.average(of_each, weights=self.weights))
        with np.errstate(over="ignore"):
            return mean(relative), mean(relative**2) ** 0.5, float(relative.max())

    def row(self, target, group, peer, setting, **more):
        base = {"array": self.name, "samples": self.values.size, "digest": self.digest, "target": f"{target:g}"}
        return {**dict.fromkeys(FIELDS, ""), **base, "group": group, "peer": peer, "setting": setting, **more}


# ---- peers: the smallest file within a target


def processor():
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


class Family:
    """One peer on one layout and domain of one array, and every encoding of it so far."""

    def __init__(self, truth, peer, layout, domain):
        self.truth, self.peer, self.setting, self.domain = truth, peer, f"{layout} {domain}", domain
        self.layout = others.Layout(truth.values.shape, truth.axes, layout == "grid")
        start = processor()
        self.x = self.layout.forward(truth.for_peers[domain])
        self.state = peer.prepare(self.x, truth.axes)
        self.prepared = processor() - start
        self.tried = {}

    def measure(self, knob):
        """Encodes, decodes and scores at a knob: a dictionary of what came out."""
        if knob in self.tried:
            return self.tried[knob]
        truth, start = self.truth, processor()
        b = self.peer.encode(self.x, truth.axes, self.state, knob)
        encoded = processor()
        y = self.peer.decode(b, self.layout.out, truth.axes)
        y = self.layout.inverse(np.exp(y) if self.domain == "log" else y)
        decoded = processor()
        er_l1, er_l2, largest = truth.errors(y)
        speed = lambda seconds: truth.megabytes / max(seconds, 1e-4)
        self.tried[knob] = {
            "bytes": len(b), "er_l1": er_l1, "er_l2": er_l2 if math.isfinite(er_l2) else math.inf,
            "max_relative": largest, "encode_mb_s": speed(encoded - start + self.prepared),
            "decode_mb_s": speed(decoded - encoded),
        }  # fmt: skip
        return self.tried[knob]

    def search(self, target, budget):
        if self.peer.steps:
            self.bisect(target, self.peer.steps(self.x))
        else:
            self.close_in(target, budget)

    def bisect(self, target, steps):
        """The coarsest step within the target."""
        low, high = 0, len(steps) - 1
        while low < high:
            middle = (low + high) // 2
            if self.measure(steps[middle])["er_l2"] <= target:
                high = middle
            else:
                low = middle + 1
        self.measure(steps[low])

    def close_in(self, target, budget):
        """Log-log interpolation of the error in the knob, between the nearest knobs on both sides."""
        unit = 1.0 if self.domain == "log" else self.truth.rms * 0.1
        for _ in range(budget):
            inside = [(k, t["er_l2"]) for k, t in self.tried.items() if t["er_l2"] <= target]
            outside = [(k, t["er_l2"]) for k, t in self.tried.items() if t["er_l2"] > target]
            below, above = max(inside, default=None), min(outside, default=None)
            if below and (below[1] >= self.truth.near * target or above and above[0] < below[0] * 1.01):
                return
            if below and above and above[0] > below[0]:
                share = 0.5
                if 0 < below[1] < above[1] < math.inf:
                    share = math.log(0.995 * target / below[1]) / math.log(above[1] / below[1])
                knob = below[0] * (above[0] / below[0]) ** min(max(share, 0.1), 0.9)
            elif above:
                knob = above[0] * max(0.9 * target / above[1], 1 / 16)
            elif below:
                knob = below[0] * min(0.99 * target / max(below[1], 1e-9), 16)
            else:
                knob = target * unit
            self.measure(knob)

    def best(self, target):
        within = [(t["bytes"], k) for k, t in self.tried.items() if t["er_l2"] <= target]
        return (*min(within), self) if within else None


def families_of(truth, peer):
    """The settings of a peer on an array, and why others cannot be had."""
    grids = any(axis.kind == "triangles" and n >= 256 for axis, n in zip(truth.axes, truth.values.shape))
    layouts = [layout for layout in peer.layouts if layout == "array" or grids]
    domains = peer.domains
    if truth.large:
        layouts, domains = layouts[-1:], domains[-1:]
    families, failed = [], []
    for layout in layouts:
        for domain in domains:
            try:
                families.append(Family(truth, peer, layout, domain))
            except Exception as why:  # a peer's failure is a result, whatever it raised
                failed.append(f"{layout} {domain}: {type(why).__name__}: {why}")
    return families, failed


def narrowed(families, target, budget, failed):
    """Searches each setting at a target; returns those worth a search at a tighter one."""
    left, found = [], []
    for family in families:
        try:
            family.search(target, budget)
            left.append(family)
            found.append(family.best(target))
        except Exception as why:
            failed.append(f"{family.setting}: {type(why).__name__}: {why}")
    found = [one for one in found if one]
    least = min((size for size, _, _ in found), default=math.inf)
    hopeless = [family for size, _, family in found if size > HOPELESS * least]
    return [family for family in left if family not in hopeless]


def entry(truth, peer, target, families, failed):
    """A peer's row at a target in %, from all that was tried, for tighter targets too."""
    found = [one for one in (family.best(target / 100) for family in families) if one]
    if not found:
        note = "; ".join(failed) or "error not reached in the encodings allowed"
        return truth.row(target, peer.group, peer.name, "", note=note)
    _, knob, family = min(found, key=lambda one: one[0])
    return truth.row(target, peer.group, peer.name, f"{family.setting} {knob:.6g}", **family.tried[knob])


def run(truth, targets, peers, missing, log):
    """One row a peer and target in %, best setting; and one a peer that did not run, with its reason."""
    rows = []
    for peer in peers:
        start = time.perf_counter()
        if truth.large and peer.slow:
            rows.append(truth.row(0, peer.group, peer.name, "", note="too slow for an array above 10 MB"))
            continue
        every, failed = families_of(truth, peer)
        families = every
        for target in sorted(targets, reverse=True):
            families = narrowed(families, target / 100, truth.encodings, failed)
        rows += [entry(truth, peer, target, every, failed) for target in targets]
        seconds = time.perf_counter() - start
        print(f"  {peer.name:16s} {seconds:6.1f} s  " + "; ".join(failed), file=log, flush=True)
    return rows + [truth.row(0, "packaged", name, "", note=f"not installed: {why}") for name, why in missing.items()]
