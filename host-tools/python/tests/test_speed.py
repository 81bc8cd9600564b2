"""How much faster than numpy: five times at least, in one run."""

import pathlib
import sys
import time

import numpy as np
from conftest import ROOT
from test_recordings import of_numpy

import tactus

sys.path.insert(0, str(pathlib.Path(ROOT, "tests/oracle")))
import evaluate as in_numpy  # noqa: E402


def fastest(work, times=3):
    took = []
    for _ in range(times):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return min(took)


def test_features_of_680_slides(biotac, capsys):
    slides = [slide for texture in biotac.textures for slide in biotac.slides(texture)]
    for slide in slides:
        # made once, for both
        slide.pac, slide.shear_mn
    assert len(slides) == 680
    ours = fastest(lambda: [slide.features() for slide in slides])
    theirs = fastest(lambda: [of_numpy(slide) for slide in slides])
    ratio = theirs / ours
    with capsys.disabled():
        print(f"\nfeatures of 680 slides, one thread: {ours:.3f} s, numpy {theirs:.3f} s, {ratio:.1f} times")
    assert ratio >= 5


def test_8000_explorations(worlds, capsys):
    file, runs = worlds / "world_1.csv", 8000
    table = tactus.Properties(file)
    world = in_numpy.read(file)
    # all that `evaluate` does: 8000 explorations among known textures, and 8000 as users are told
    figures = []
    ours = fastest(
        lambda: figures.append(tactus.evaluate(table, method="paper", runs=runs, reliability=False))
    )
    found = []
    theirs = fastest(lambda: found.append(in_numpy.evaluate(*world, runs, np.random.default_rng(1))))
    ratio = 2 * theirs / ours
    with capsys.disabled():
        print(f"\n16 000 explorations among 117 textures: {ours:.3f} s, as many in numpy {2 * theirs:.3f} s, {ratio:.1f} times")
    right, sure, slides = found[-1]
    assert abs(figures[-1]["accuracy"] - right.mean()) < 0.02
    assert abs(figures[-1]["converged"] - sure.mean()) < 0.02
    assert abs(figures[-1]["median_slides"] - np.median(slides)) < 1.01
    assert ratio >= 5
