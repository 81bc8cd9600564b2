#!/usr/bin/env python3
"""Every real data set and simulated worlds, judged with the defaults: the tables and the picture of the book.

usage: evidence.py TACTUS DATA [--write BOOK] [SET ...]      (cargo xtask evidence runs it)

TACTUS is the command. DATA holds `biotac`, `fabricslide`, `boreal` and `worlds` (see DATA.md); without SET all that are
there are used, and worlds 1 to 20 are simulated. It needs the package tactus and scikit-learn 1.6 or newer. BOOK is the
folder whose evidence.md and reliability.svg are written; otherwise the tables are printed.

Told: `tactus evaluate` of each set and split, with and without `--novelty leave-one-out` and `--learn`. Forced: ours
beside scikit-learn's classifiers, after one slide, with the same features, splits and slides: 26 band powers, and P_DC
or traction where there is one.

Splits: `interleaved` draws the slides to learn from out of all (forced: ten times with other draws); `blocked` out of
the first 19 of 34; `drift` takes the first. `sessions` learns from all sessions (or runs) but one, in turn; `even-odd`
learns from the even runs and tests the odd ones. A texture with too few slides is left out.
"""

import gzip
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import RandomForestClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

import tactus

DRAWS = 10
PEERS = {
    "LDA": lambda: make_pipeline(StandardScaler(), LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")),
    "SVM": lambda: make_pipeline(StandardScaler(), SVC(C=10)),
    "random forest": lambda: RandomForestClassifier(300, random_state=1, n_jobs=-1),
}
OURS = {"ours": (0.12, 0.04), "ours, no drift expected": (0.0, 0.0)}
TACTUS, RUNS = "tactus", 2000
MARKS = r"(<!-- evidence: [^\n]*-->\n).*?(\n<!-- /evidence -->)"
WORLDS, TEXTURES = range(1, 21), ",".join(map(str, range(3, 109, 5)))


def boreal(folder, parity=None, gain=None):
    """A robot's vertical acceleration on five terrains; the motors' currents are its load. A run is a session."""
    arrays, labels, runs = [], [], []
    for file in sorted(folder.glob("*/run*_imu.csv.gz")):
        if parity is not None and int(file.name[3:5]) % 2 != parity:
            continue
        time, _, vertical = np.loadtxt(file, delimiter=",", skiprows=1).T
        current = np.loadtxt(str(file).replace("_imu", "_current"), delimiter=",", skiprows=1)
        load = np.interp(time, current[:, 0], np.abs(current[:, 1:]).sum(1))
        arrays.append(np.column_stack([vertical, load]))
        labels.append(file.parent.name)
        runs.append(file.name.split("_")[0])
    return tactus.Recordings.from_arrays(
        arrays, rate_hz=100, unit="m/s2", labels=labels, sessions=runs, channel=0, pressure=1, finger="husky-imu",
        gain=gain,
    )


def fabricslide(folder):
    """Seven fabrics under 16 capacitive taxels, as their sum; slow slides only. A repetition is a session."""
    manifest = json.loads((folder / "manifest.json").read_text())
    arrays, labels, sessions = [], [], []
    for file in manifest["files"]:
        values = np.frombuffer(gzip.decompress((folder / file["file"]).read_bytes()), "<u2")
        for slide in file["slides"]:
            if slide["n"] < 1100:
                continue
            at = slide["offset_values"]
            taxels = values[at : at + 16 * slide["n"]].reshape(-1, 16).astype(float)
            arrays.append(np.column_stack([taxels.sum(1), taxels.mean(1)]))
            labels.append(file["fabric"])
            sessions.append(slide["rep"])
    return tactus.Recordings.from_arrays(
        arrays, rate_hz=356.5, labels=labels, sessions=sessions, channel=0, pressure=1, cut=False, finger="cpm-finger"
    )


SETS = {"biotac": tactus.Recordings, "fabricslide": fabricslide, "boreal": boreal}


def used(table, columns):
    """The columns that a table decides by."""
    named = {"traction and band powers": ["traction_n"], "P_DC and band powers": ["pdc"], "band powers": []}
    return np.column_stack([*(columns[name] for name in named[table.summary()["features"]]), columns["ln_fused_bands"]])


def splits(protocol, columns, train, random):
    """Which slides are learned from, and which are tested."""
    names, places = columns["name"], np.arange(len(columns["name"]))
    textures = [name for name in np.unique(names) if (names == name).sum() > train]
    if protocol == "sessions":
        for session in np.unique(columns["session"]):
            tested = columns["session"] == session
            known = np.unique(names[~tested])
            yield places[~tested], places[tested & np.isin(names, known)]
        return
    for _ in range(1 if protocol == "drift" else DRAWS):
        learned, tested = [], []
        for name in textures:
            of = places[names == name]
            first = {"interleaved": len(of), "blocked": round(len(of) * 19 / 34), "drift": train}[protocol]
            order = np.arange(first) if protocol == "drift" else random.permutation(first)
            learned.extend(of[order[:train]])
            rest = of[order[train:]] if protocol == "interleaved" else of[first:]
            tested.extend(rest)
        yield np.sort(learned), np.sort(tested)


def forced(table, slides):
    """The most probable name after each slide alone."""
    explorer, told = tactus.Explorer(table, open=False), []
    for slide in slides:
        explorer.restart()
        explorer.update(slide)
        told.append(explorer.best()["texture"])
    return np.array(told)


def row(name, protocol, train, columns, slides):
    """A row of the table: shares of right names, each the mean over the splits."""
    names = columns["name"]
    right = {method: [] for method in [*OURS, *PEERS]}
    for learned, tested in splits(protocol, columns, train, np.random.default_rng(1)):
        training = {}
        for place in learned:
            training.setdefault(str(names[place]), []).append(slides[place])
        for method, drift in OURS.items():
            table = tactus.Table.learn_slides(training, drift=drift)
            told = forced(table, [slides[place] for place in tested])
            right[method].append((told == names[tested]).mean())
        X = used(table, columns)
        for method, make in PEERS.items():
            told = make().fit(X[learned], names[learned]).predict(X[tested])
            right[method].append((told == names[tested]).mean())
    shares = {method: 100 * np.mean(of) for method, of in right.items()}
    best = max(round(share, 1) for share in shares.values())
    told = " | ".join(f"**{share:.1f}**" if round(share, 1) == best else f"{share:.1f}" for share in shares.values())
    textures = sum((names == name).sum() > train for name in np.unique(names))
    return f"| {name} | {protocol} | {train or 'rest'} | {textures} | {told} |"


def evaluate(*options):
    """The figures of `tactus evaluate`."""
    command = [TACTUS, "evaluate", "--quiet", "--format", "json", *map(str, options)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return json.loads(done.stdout)


def known(share):
    """The cell of the verdicts on known textures."""
    shares = [f"{share(key):.1f}" for key in ("right", "changed", "new", "wrong", "most_like", "undecided")]
    if share("most_like"):
        shares[4] += f" ({share('most_like_right'):.1f} right)"
    return " / ".join(shares)


def told(options, is_open=True):
    """The cells of a row, and the statements behind its reliability."""
    options = [*options, "--runs", RUNS]
    figures = evaluate(*options)
    verdicts, cells = figures["verdicts"], []
    cells.append(known(lambda key: 100 * verdicts[key]))
    if not is_open:
        return [*cells, *["-"] * 4], figures["reliability"]
    cells.append(f"{100 * evaluate(*options, '--learn')['updates']['wrong']:.1f}")
    new = evaluate(*options, "--novelty", "leave-one-out")
    after = [*(of["unknown"] for of in new["novelty"]), new["verdicts_new"]]
    cells.extend(" / ".join(f"{100 * of[key]:.0f}" for of in after) for key in ("new", "wrong"))
    own = new["open_set"] and new["open_set"]["new_named"]
    cells.append(f"{100 * own['share']:.0f} ({100 * own['low']:.0f}-{100 * own['high']:.0f})" if own else "-")
    return cells, figures["reliability"]


def simulated(number):
    """A simulated world of 22 textures."""
    with tempfile.TemporaryDirectory() as folder:
        at = str(pathlib.Path(folder) / "world")
        command = [TACTUS, "simulate", "--quiet", "--out", at, "--seed", str(number), "--trials", "8"]
        subprocess.run([*command, "--textures", TEXTURES], check=True, capture_output=True)
        return evaluate("--recordings", at, "--runs", 400)


def worlds():
    """The simulated worlds' row: means, and the worst share of wrong names among the sure ones."""
    with ThreadPoolExecutor(2) as pool:
        figures = list(pool.map(simulated, WORLDS))
    cell = known(lambda key: 100 * np.mean([of["verdicts"][key] for of in figures]))
    reliability = [dict(of) for of in figures[0]["reliability"]]
    for other in figures[1:]:
        for of, more in zip(reliability, other["reliability"]):
            said = [(x["said"] or 0) * x["count"] for x in (of, more)]
            of["count"], of["right"] = of["count"] + more["count"], of["right"] + more["right"]
            of["said"] = sum(said) / of["count"] if of["count"] else None
    return f"| simulated worlds {WORLDS[0]} to {WORLDS[-1]} | interleaved | 5 | {cell} | - | - | - | - |", reliability


def picture(curves):
    """Share of right names by the probability that was stated, one line a row, as SVG."""
    place = lambda p: 60 + 100 * -np.log10(max(1 - p, 1e-4))
    ticks = [0.0, 0.9, 0.99, 0.999, 0.9999]
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 520" font-family="sans-serif" font-size="12">']
    parts.append('<rect width="760" height="520" fill="white"/>')
    for tick in ticks:
        at = place(tick)
        parts.append(f'<path d="M{at} 60V460M60 {520 - at}H460" stroke="#ddd"/>')
        parts.append(f'<text x="{at}" y="478" text-anchor="middle">{tick}</text>')
        parts.append(f'<text x="54" y="{524 - at}" text-anchor="end">{tick}</text>')
    parts.append('<path d="M60 460L460 60" stroke="#888" stroke-dasharray="4"/>')
    parts.append('<text x="260" y="500" text-anchor="middle">stated probability</text>')
    parts.append('<text x="20" y="260" text-anchor="middle" transform="rotate(-90 20 260)">share of right names</text>')
    for number, (name, of) in enumerate(curves.items()):
        colour = f"hsl({number * 360 // len(curves)} 70% 40%)"
        points = [(place(x["said"]), 520 - place(x["right"] / x["count"])) for x in of if x["count"] >= 30]
        line = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.extend(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="3" fill="{colour}"/>' for x, y in points)
        parts.append(f'<text x="480" y="{80 + 18 * number}" fill="{colour}">{name}</text>')
    return "\n".join([*parts, "</svg>\n"])


def judged(data, wanted, scratch):
    """Rows of what is told, rows of forced names, and curves."""
    told_rows, forced_rows, curves = [], [], {}

    def take(name, split, train, cells, reliability):
        told_rows.append(f"| {name} | {split} | {train or 'rest'} | " + " | ".join(cells) + " |")
        curves[f"{name}, {split}{f', {train}' if train else ''}"] = reliability
        print(told_rows[-1], file=sys.stderr, flush=True)

    for name, read in SETS.items():
        folder = data / name
        if wanted and name not in wanted:
            continue
        if not folder.is_dir():
            print(f"{folder}: no such folder, left out", file=sys.stderr)
            continue
        with warnings.catch_warnings():
            # slides too short to be one
            warnings.simplefilter("ignore")
            recordings, at = read(folder), folder
        if recordings.folder is None:
            recordings.write(at := scratch / name)
        columns = recordings.features()
        slides = [slide for texture in recordings.textures for slide in recordings.measured_slides(texture)]
        several = len(np.unique(columns["session"])) > 1
        # the fabrics' files do not say in which order they were made
        timed = [("blocked", 5), ("drift", 5), ("drift", 15)] * (name != "fabricslide")
        for protocol, train in [("interleaved", 5), ("interleaved", 15), *timed, *[("sessions", 0)] * several]:
            if sum((columns["name"] == texture).sum() > train for texture in recordings.textures) < 2:
                continue
            forced_rows.append(row(name, protocol, train, columns, slides))
            split = "leave-one-session-out" if protocol == "sessions" else protocol
            options = ["--recordings", at, "--protocol", split, *(["--train-slides", train] if train else [])]
            # novelty leaves out a texture while another is there, and limits take three
            take(name, protocol, train, *told(options, len(recordings.textures) > 3))
        if name == "boreal":
            for parity, of in enumerate(("even", "odd")):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    boreal(folder, parity, recordings.gain).write(scratch / of)
            options = ["--recordings", scratch / "even", "--test", scratch / "odd", "--protocol", "drift"]
            take(name, "even-odd", 5, *told([*options, "--train-slides", 5]))
    for file in sorted(data.glob("worlds/*.csv")) if not wanted or "worlds" in wanted else []:
        options = ["--properties", file, "--method", "student-all"]
        take(file.stem.replace("_", " ") + ", student-all", "given", 0, *told(options, False))
    if not wanted or "simulated" in wanted:
        line, reliability = worlds()
        told_rows.append(line)
        curves["simulated worlds"] = reliability
    return told_rows, forced_rows, curves


def main(command, data, *wanted):
    global TACTUS
    TACTUS, book = command, None
    if wanted[:1] == ("--write",):
        book, wanted = pathlib.Path(wanted[1]), wanted[2:]
    if book and not re.search(MARKS, (book / "evidence.md").read_text(), re.S):
        sys.exit(f"{book / 'evidence.md'}: no marks of the tables")
    with tempfile.TemporaryDirectory() as scratch:
        told_rows, forced_rows, curves = judged(pathlib.Path(data), wanted, pathlib.Path(scratch))
    told_of = "known: right / changed / new / wrong / most like / undecided"
    stop = "after 1 / 2 / 3 slides / at the stop"
    head = f"| set | split | learned | {told_of} | wrong updates | new: noticed {stop} | sure of a wrong name | its own figure |"
    tables = [head, "|---|---|---|---|---|---|---|---|", *told_rows, ""]
    tables.append("| set | split | learned | textures | " + " | ".join([*OURS, *PEERS]) + " |")
    tables.extend(["|---|---|---|---|" + "---|" * (len(OURS) + len(PEERS)), *forced_rows])
    if book is None:
        return print("\n".join(tables))
    write = lambda found: found[1] + "\n".join(["", *tables, ""]) + found[2]
    page = re.sub(MARKS, write, (book / "evidence.md").read_text(), flags=re.S)
    (book / "evidence.md").write_text(page)
    (book / "reliability.svg").write_text(picture(curves))


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) > 2 else sys.exit(__doc__)
