"""The examples run, and say what they should."""

import importlib.util
import os
import subprocess
import sys

import pytest
from conftest import ROOT, lacking

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


def test_a_confusion_matrix_beside_other_classifiers(tmp_path):
    if importlib.util.find_spec("sklearn") is None:
        lacking("no scikit-learn: pip install scikit-learn", False)
    said = example("confusion.py", SMALL, 2, folder=tmp_path).splitlines()
    shares = {line.split(":")[0].split(",")[0]: float(line.split()[-6]) for line in said if "% right" in line}
    assert set(shares) == {"tactus", "LinearDiscriminantAnalysis", "KNeighborsClassifier", "RandomForestClassifier"}
    assert shares["tactus"] >= 90


def test_a_simulated_rig_that_explores(tmp_path):
    said = example("exploring.py", "Burlap", folder=tmp_path)
    assert "slide 1:" in said and "'told': 'sure', 'texture': 'Burlap'" in said


def test_a_map(tmp_path):
    said = example("map.py", SMALL, folder=tmp_path)
    assert said.count("nearest is") == 6


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_an_example_says_how_it_is_called(name):
    assert f"usage: {name}" in (EXAMPLES / name).read_text()
