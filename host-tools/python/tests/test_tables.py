"""Tables and evaluations: byte for byte and digit for digit what the command line makes."""

import json
import threading
import time

import pytest

import tactus

LEARNED = [
    ({}, []),
    ({"method": "paper"}, ["--method", "paper"]),
    ({"features": "bands", "drift": (0, 0)}, ["--features", "bands", "--drift", "0"]),
    ({"train_slides": 2, "false_alarm": 0.05}, ["--train-slides", "2", "--false-alarm", "0.05"]),
]


@pytest.mark.parametrize("whose", ["small", "biotac"])
@pytest.mark.parametrize("ours, theirs", LEARNED)
def test_a_table_is_the_commands_byte_for_byte(whose, ours, theirs, request, command, tmp_path):
    recordings = request.getfixturevalue(whose)
    out = tmp_path / "theirs"
    command("learn", "--recordings", recordings.folder, "--out", out, *theirs)
    table = tactus.Table.learn(recordings, **ours)
    assert bytes(table) == out.read_bytes()
    table.save(tmp_path / "ours")
    read = tactus.Table.load(tmp_path / "ours")
    assert bytes(read) == bytes(tactus.Table.from_bytes(bytes(table))) == bytes(table)
    assert read.summary() == json.loads(command("table", out, "--format", "json"))
    assert len(read) == len(recordings.textures) and read.textures == recordings.textures
    assert read.method == ("student-all" if ours.get("method") else "fused")
    assert f"checksum {read.checksum}" in command("table", out)


def test_errors_of_tables_are_the_commands(small, command, tmp_path):
    file = tmp_path / "table"
    said = lambda: command("table", file)
    for bytes_ in None, b"none", bytes(tactus.Table.learn(small)) + b"more":
        if bytes_ is not None:
            file.write_bytes(bytes_)
        with pytest.raises(tactus.TableError) as why:
            tactus.Table.load(file)
        assert str(why.value) == said()
    damaged = bytearray(bytes(tactus.Table.learn(small)))
    damaged[len(damaged) // 2] ^= 1
    with pytest.raises(tactus.TableError):
        tactus.Table.from_bytes(bytes(damaged))
    with pytest.raises(tactus.TableError, match="takes at least two"):
        tactus.Table.learn(small, train_slides=1)
    with pytest.raises(ValueError, match="fused, fused-cycle"):
        tactus.Table.learn(small, method="guess")
    with pytest.raises(ValueError, match="0.0005"):
        tactus.Table.learn(small, false_alarm=0.9)


EVALUATED = [
    ("biotac", {}, []),
    ("biotac", {"protocol": "drift", "method": "paper", "seed": 7}, ["--protocol", "drift", "--method", "paper", "--seed", 7]),
    ("small", {"train_slides": 2, "threshold": 0.9}, ["--train-slides", 2, "--threshold", 0.9]),
]


@pytest.mark.parametrize("whose, ours, theirs", EVALUATED)
def test_evaluations_are_the_commands_to_the_digit(whose, ours, theirs, request, command):
    recordings = request.getfixturevalue(whose)
    at = ["evaluate", "--recordings", recordings.folder, "--format", "json", "--runs", 500, *theirs]
    assert tactus.evaluate(recordings, runs=500, **ours) == json.loads(command(*at))


def test_what_cannot_be_evaluated_says_so(small, command):
    with pytest.raises(tactus.TactusError) as why:
        tactus.evaluate(small, train_slides=1)
    assert str(why.value) == command("evaluate", "--recordings", small.folder, "--train-slides", 1)
    with pytest.raises(TypeError, match="slides"):
        tactus.evaluate(small, slides=3)
    with pytest.raises(ValueError, match="threshold"):
        tactus.evaluate(small, threshold=1.5)


def test_other_threads_run_meanwhile(small):
    ticks, over = [], threading.Event()

    def tick():
        while not over.wait(0.001):
            ticks.append(time.perf_counter())

    ticker = threading.Thread(target=tick)
    ticker.start()
    began = time.perf_counter()
    tactus.evaluate(small, train_slides=2, runs=2_000)
    took = time.perf_counter() - began
    over.set()
    ticker.join()
    gaps = [b - a for a, b in zip(ticks, ticks[1:])]
    assert took > 0.2, "too short to tell"
    assert max(gaps) < took / 2, f"{max(gaps):.3f} of {took:.3f} s without another thread"
