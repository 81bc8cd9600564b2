"""The examples run, and say what they should."""

import importlib.util
import os
import subprocess
import sys

import pytest
from conftest import ROOT, lacking, sklearn
from test_own_data import sensor

import tactus

EXAMPLES = ROOT / "host-tools/python/examples"
SMALL = ROOT / "host-tools/recordings/simulated"


def example(name, *arguments, folder):
    if importlib.util.find_spec("matplotlib") is None:
        lacking("no matplotlib: pip install matplotlib", False)
    run = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    done = subprocess.run(run, cwd=folder, capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"})
    assert done.returncode == 0, done.stderr
    pictures = list(folder.glob("*.png"))
    assert len(pictures) == 1 and pictures[0].read_bytes().startswith(b"\x89PNG")
    return done.stdout


def test_a_spectrogram(tmp_path):
    said = example("spectrogram.py", SMALL, "Corduroy", folder=tmp_path)
    assert "of Corduroy" in said and "roughness" in said


def test_a_confusion_matrix(tmp_path):
    said = example("confusion.py", SMALL, 2, folder=tmp_path)
    assert float(said.split(" % right")[0].split()[-1]) >= 90


def test_ours_beside_scikit_learn(tmp_path):
    """The script behind the book's table, with made-up recordings in the place of real ones."""
    sklearn()
    arrays, labels = sensor(2200, each=8)
    made = tactus.Recordings.from_arrays(arrays, rate_hz=2200, labels=labels, sessions=["a", "b"] * 12)
    made.write(tmp_path / "biotac")
    run = [sys.executable, str(ROOT / "docs/peers.py"), str(tmp_path), "biotac"]
    done = subprocess.run(run, capture_output=True, text=True)
    head, _, *rows = done.stdout.splitlines()
    assert done.returncode == 0 and rows, done.stderr
    methods = [cell.strip() for cell in head.split("|")[5:-1]]
    assert methods == ["ours", "ours, no drift expected", "LDA", "SVM", "random forest"]
    shares = [[float(cell.strip(" *")) for cell in row.split("|")[5:-1]] for row in rows]
    # noises of so different frequencies are told apart by all, but for a draw of a class that is left out
    assert [row.split("|")[2].strip() for row in rows] == ["interleaved", "blocked", "drift", "sessions"]
    assert all(80 <= share <= 100 for row in shares for share in row)


def test_a_simulated_rig_that_explores(tmp_path):
    said = example("exploring.py", "Burlap", folder=tmp_path)
    assert "slide 1:" in said and "'told': 'sure', 'texture': 'Burlap'" in said


def test_a_map(tmp_path):
    said = example("map.py", SMALL, folder=tmp_path)
    assert said.count("nearest is") == 6


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_an_example_says_how_it_is_called(name):
    assert f"usage: {name}" in (EXAMPLES / name).read_text()
