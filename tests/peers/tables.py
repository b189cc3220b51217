"""The rows of run_peers.py as markdown: the tables of docs/peers.md, and what the program prints."""

import os

MARGIN, MARGIN_BELOW = 1.5, 1.1  # times smaller than the best peer, above and below the estimated noise of a measurement
SHOWN = (1.0, 2.0, 5.0)


def best_row(rows, name, target, group=None):
    """The row with the fewest bytes of an array at a target in %, without wavelume's own; or nothing."""
    groups = (group,) if group else ("packaged", "recipe")
    fits = [row for row in rows if row["array"] == name and float(row["target"]) == target and row["group"] in groups]
    fits = [row for row in fits if row["bytes"] != ""]
    return min(fits, key=lambda row: (int(row["bytes"]), row["peer"]), default=None)


def smallest(rows, name, target, group=None):
    """(bytes, peer) of the best row, or nothing."""
    row = best_row(rows, name, target, group)
    return row and (int(row["bytes"]), row["peer"])


def at(rows, name, target):
    return [row for row in rows if row["array"] == name and float(row["target"]) == target]


def own(rows, name, target):
    """Wavelume's row, or nothing."""
    return next((row for row in at(rows, name, target) if row["group"] == "wavelume"), None)


def noise(row):
    """The estimated noise of a row of wavelume's, in %, or nothing."""
    return 100 * float(row["noise"]) if row and row.get("noise") not in (None, "") else None


def names_in(rows):
    return list(dict.fromkeys(row["array"] for row in rows))


def cells_of_noise(row):
    """The noise, the bytes that it costs at least, and the file in multiples of these."""
    found = noise(row)
    if not found:
        return ["–", "–", "–"]
    least, over = int(row["bound_bytes"]), row["over_bound"]
    return [f"{found:.3g} %", f"{least:,}", f"{float(over):.1f}" if over != "" else "–"]


def silent(rows):
    """Markdown lines about what did not run, or did not reach its error, and why; nothing where all did."""
    where_of = {}
    for row in rows:
        if row["note"] and row["bytes"] == "":
            where = row["array"] + (f" at {row['target']} %" if row["target"] != "0" else "")
            where_of.setdefault((row["peer"], row["note"]), []).append(where)
    every, lines = set(names_in(rows)), []
    for (peer, note), where in where_of.items():
        all_of_several = len(every) > 1 and set(where) == every
        lines.append(f"* {peer}, {note}: {'every array' if all_of_several else '; '.join(dict.fromkeys(where))}")
    return ["", "Not run, or not reached:", "", *lines] if lines else []


def markdown(rows, targets):
    """Wavelume beside the best peer of each group; then every peer; then what did not run."""
    out = ["| array | er(L2) | best packaged peer | best recipe | wavelume | best peer / wavelume | noise | bound | wavelume / bound |"]
    out.append("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name in names_in(rows):
        for target in targets:
            cells, every = [], []
            for group in ("packaged", "recipe"):
                best = smallest(rows, name, target, group)
                every += [best[0]] if best else []
                cells.append(f"{best[0]:,} {best[1]}" if best else "–")
            ours = own(rows, name, target)
            if not every and not ours:
                continue
            if not ours:
                cells += ["–", "–"]
            elif ours["bytes"] == "" or ours["note"]:
                cells += [f"**{ours['note']}**", "–"]
            else:
                size = int(ours["bytes"])
                cells += [f"{size:,}", f"{min(every) / size:.2f}" if every else "–"]
            out.append(f"| {name} | {target:g} % | " + " | ".join([*cells, *cells_of_noise(ours)]) + " |")
    columns = ("packaged", "recipe", "wavelume")
    by_group = [row for group in columns for row in rows if row["group"] == group]
    peers = list(dict.fromkeys(row["peer"] for row in by_group if row["bytes"] != ""))
    for target in targets:
        out += ["", f"Bytes at er(L2) {target:g} %:", ""]
        out += ["| array | " + " | ".join(peers) + " |", "|---|" + "--:|" * len(peers)]
        for name in names_in(rows):
            found = {row["peer"]: row for row in at(rows, name, target) if row["bytes"] != ""}
            if found:
                cells = [f"{int(found[peer]['bytes']):,}" if peer in found else "–" for peer in peers]
                out.append(f"| {name} | " + " | ".join(cells) + " |")
    out += silent(rows)
    return "\n".join(out) + "\n"


def short(rows, measured):
    """The summary: the best peer, wavelume and their ratio at 1, 2 and 5 %; then where the target is below the noise.

    A ratio is bold where a measurement (one of the names `measured`) misses its margin."""
    out = ["| array | noise |" + "".join(f" {target:g} %: best other | wavelume | ratio |" for target in SHOWN)]
    out.append("|---|--:|" + "--:|--:|--:|" * len(SHOWN))
    below = []
    for name in names_in(rows):
        found = noise(own(rows, name, SHOWN[0]))
        line = [name, f"{found:.3g} %" if found else "–"]
        for target in SHOWN:
            best, ours = smallest(rows, name, target), own(rows, name, target)
            if not best or not ours or ours["bytes"] == "" or ours["note"]:
                line += ["–", "–", "–"]
                continue
            ratio = best[0] / int(ours["bytes"])
            is_below = found is not None and target < found
            short_of = name in measured and ratio < (MARGIN_BELOW if is_below else MARGIN)
            line += [f"{best[0]:,} {best[1]}", f"{int(ours['bytes']):,}", f"**{ratio:.2f}**" if short_of else f"{ratio:.2f}"]
            if is_below:
                over = f"{float(ours['over_bound']):.1f}" if ours["over_bound"] != "" else "–"
                cells = [name, f"{target:g} %", f"{found:.3g} %", f"{ratio:.2f}", f"{int(ours['bytes']):,}"]
                below.append("| " + " | ".join([*cells, f"{int(ours['bound_bytes']):,}", over]) + " |")
        if line[2:] != ["–"] * (3 * len(SHOWN)):
            out.append("| " + " | ".join(line) + " |")
    if below:
        out += ["", "Where the target lies below the estimated noise:", ""]
        out += ["| array | er(L2) | noise | ratio | wavelume | rate bound | wavelume / bound |", "|---|--:|--:|--:|--:|--:|--:|"]
        out += below
    return "\n".join(out) + "\n"


def publish(root, rows, table, measured):
    """Writes the summary and the whole table between their marks in docs/peers.md."""
    page = os.path.join(root, "docs", "peers.md")
    with open(page) as file:
        text = file.read()
    for mark, new in [("peers", short(rows, measured)), ("every peer", table)]:
        begin, end = f"<!-- {mark} -->\n", f"<!-- end of {mark} -->"
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{new}\n{end}{rest.split(end)[1]}"
    with open(page, "w") as file:
        file.write(text)
