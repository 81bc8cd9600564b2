#!/usr/bin/env python3
"""Ours beside scikit-learn's classifiers: the same recordings, features and split, one slide, the name forced.

usage: peers.py DATA [SET ...]

DATA holds `biotac`, `fabricslide` and `boreal` (see DATA.md of the repository); without SET all that are there are
used. It needs the package tactus and scikit-learn 1.6 or newer. Ours is the table of `tactus learn`, with the drift that
it expects as delivered and with none. All methods get the features that a table may use: 26 band powers, and P_DC or
traction where there is one.

Splits, of which the first three are those of `tactus evaluate`: `interleaved` draws the slides to learn from out of
all, ten times with other draws; `blocked` out of the first 19 of 34; `drift` takes the first. `sessions` learns from all
sessions (or runs) but one, in turn. What is not learned from is tested on; a texture with too few slides is left out.
"""

import gzip
import json
import pathlib
import sys

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


def boreal(folder):
    """A robot's vertical acceleration on five terrains; the motors' currents are its load. A run is a session."""
    arrays, labels, runs = [], [], []
    for file in sorted(folder.glob("*/run*_imu.csv.gz")):
        time, _, vertical = np.loadtxt(file, delimiter=",", skiprows=1).T
        current = np.loadtxt(str(file).replace("_imu", "_current"), delimiter=",", skiprows=1)
        load = np.interp(time, current[:, 0], np.abs(current[:, 1:]).sum(1))
        arrays.append(np.column_stack([vertical, load]))
        labels.append(file.parent.name)
        runs.append(file.name.split("_")[0])
    return tactus.Recordings.from_arrays(
        arrays, rate_hz=100, unit="m/s2", labels=labels, sessions=runs, channel=0, pressure=1, finger="husky-imu"
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


def main(data, *wanted):
    print("| set | split | slides learned | textures | " + " | ".join([*OURS, *PEERS]) + " |")
    print("|---|---|---|---|" + "---|" * (len(OURS) + len(PEERS)))
    for name, read in SETS.items():
        folder = pathlib.Path(data) / name
        if wanted and name not in wanted:
            continue
        if not folder.is_dir():
            print(f"{folder}: no such folder, left out", file=sys.stderr)
            continue
        recordings = read(folder)
        columns = recordings.features()
        slides = [slide for texture in recordings.textures for slide in recordings.measured_slides(texture)]
        several = len(np.unique(columns["session"])) > 1
        # the fabrics' files do not say in which order they were made
        timed = [("blocked", 5), ("drift", 5), ("drift", 15)] * (name != "fabricslide")
        for protocol, train in [("interleaved", 5), ("interleaved", 15), *timed, *[("sessions", 0)] * several]:
            if sum((columns["name"] == texture).sum() > train for texture in recordings.textures) > 1:
                print(row(name, protocol, train, columns, slides), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:] or sys.exit(__doc__))
