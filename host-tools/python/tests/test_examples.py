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


def test_evidence_of_a_set_is_written_into_the_book(command, tmp_path):
    """The script behind the book's tables, with made-up recordings in the place of real ones."""
    sklearn()
    arrays, labels = sensor(2200, each=8)
    made = tactus.Recordings.from_arrays(arrays, rate_hz=2200, labels=labels, sessions=["a", "b"] * 12)
    made.write(tmp_path / "biotac")
    page = tmp_path / "evidence.md"
    run = [sys.executable, ROOT / "docs/evidence.py", command.file, tmp_path, "--write", tmp_path, "biotac"]
    page.write_text("before\n")
    done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 1 and "no marks" in done.stderr and page.read_text() == "before\n"
    page.write_text("before\n\n<!-- evidence: made -->\nold\n<!-- /evidence -->\n\nbehind\n")
    done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nbehind\n") and "old" not in text
    told, forced = ([row.split("|")[1:-1] for row in part.splitlines()[2:]] for part in text.split("\n\n")[2:4])
    splits = ["interleaved", "blocked", "drift", "sessions"]
    assert [row[1].strip() for row in told] == [row[1].strip() for row in forced] == splits
    # noises of so different frequencies are told apart by all, but for a draw of a class that is left out
    assert all(80 <= float(cell.strip(" *")) <= 100 for row in forced for cell in row[4:])
    for row in told:
        right, _, *others = map(float, row[3].split("/"))
        assert abs(right + sum(others) - 100) < 0.3 and right > 50
    methods = [cell.strip() for cell in text.split("\n\n")[3].splitlines()[0].split("|")[5:-1]]
    assert methods == ["ours", "ours, no drift expected", "LDA", "SVM", "random forest"]
    assert "biotac, drift, 5" in (tmp_path / "reliability.svg").read_text()


def test_a_simulated_rig_that_explores(tmp_path):
    said = example("exploring.py", "Burlap", folder=tmp_path)
    assert "slide 1:" in said and "'told': 'sure', 'texture': 'Burlap'" in said


def test_a_map(tmp_path):
    said = example("map.py", SMALL, folder=tmp_path)
    assert said.count("nearest is") == 6


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_an_example_says_how_it_is_called(name):
    assert f"usage: {name}" in (EXAMPLES / name).read_text()
