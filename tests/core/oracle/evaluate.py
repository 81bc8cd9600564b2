#!/usr/bin/env python3
"""The paper's exploration on a world of properties, in numpy: an oracle for `tactus evaluate`, and what its speed is held against.

usage: evaluate.py WORLD.csv [RUNS]

All runs go side by side, so that their expected uncertainties are products of matrices: the fastest way that numpy has. Prints
accuracy, share of sure runs, median of slides, and runs per second without the reading.
"""
import csv
import sys
import time

import numpy as np

LIMIT, SURE = 10, 0.99
PROPERTIES = ("traction", "roughness", "fineness")


def read(path):
    """Training slides (textures, trials, actions); for every texture that is tested, its slides (trials, actions)."""
    sets = {"train": {}, "validate": {}}
    for row in csv.DictReader(open(path)):
        cell = sets[row["set"]].setdefault((int(row["texture"]), int(row["movement"])), [])
        cell.append([float(row[p]) for p in PROPERTIES])
    movements = sorted({m for _, m in sets["train"]})
    textures = sorted({t for t, _ in sets["train"]})
    slides = lambda cells, t: np.concatenate([np.array(cells[t, m]) for m in movements], axis=1)
    train = np.stack([slides(sets["train"], t) for t in textures])
    tested = {textures.index(t): slides(sets["validate"], t) for t in sorted({t for t, _ in sets["validate"]})}
    return train, tested


def evaluate(train, tested, runs, rng):
    """Right, sure, and slides of every run."""
    mean, sd = train.mean(1), train.std(1, ddof=1)
    variance = sd[:, None] ** 2 + sd[None] ** 2
    apart = mean[:, None] - mean[None]
    # eq. 7, action first
    confusion = np.sqrt(2 * sd[:, None] * sd[None] / variance) * np.exp(-apart ** 2 / (4 * variance))
    confusion = np.ascontiguousarray(confusion.transpose(2, 0, 1))
    truth = np.array(list(tested))[np.arange(runs) % len(tested)]
    slides = np.stack([tested[t] for t in tested])[np.arange(runs) % len(tested)]
    log = np.zeros((runs, len(train)))
    made = np.zeros((runs, len(confusion)), int)
    right, sure, took = np.zeros(runs, bool), np.zeros(runs, bool), np.full(runs, LIMIT + 1)
    live = np.arange(runs)
    for step in range(1, LIMIT + 1):
        p = np.exp(log[live] - log[live].max(1, keepdims=True))
        p /= p.sum(1, keepdims=True)
        # eq. 10 to 12: what is expected to be left, less of it the more often an action was made
        left = np.stack([1 - (p * p / (p @ c)).sum(1) for c in confusion], axis=1)
        benefit = 1 - np.maximum(left, 0) ** (1 / (made[live] + 1))
        action = benefit.argmax(1)
        made[live, action] += 1
        trial = rng.integers(slides.shape[1], size=len(live))
        felt = slides[live, trial, action]
        m, s = mean[:, action].T, sd[:, action].T
        log[live] -= np.log(s) + (felt[:, None] - m) ** 2 / (2 * s * s)
        p = np.exp(log[live] - log[live].max(1, keepdims=True))
        p /= p.sum(1, keepdims=True)
        right[live] = p.argmax(1) == truth[live]
        over = p.max(1) > SURE
        sure[live[over]], took[live[over]] = True, step
        live = live[~over]
        if not len(live):
            break
    return right, sure, took


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else 8000
    world = read(sys.argv[1])
    began = time.perf_counter()
    right, sure, took = evaluate(*world, runs, np.random.default_rng(1))
    took_s = time.perf_counter() - began
    print(f"accuracy {right.mean():.4f} sure {sure.mean():.4f} median {np.median(took):.0f} runs_per_second {runs / took_s:.0f}")
