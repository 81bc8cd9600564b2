"""Processes and signals: what is forked works, what can be pickled says the same again, and Ctrl-C ends every long call."""

import copy
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import tactus

POSIX = pytest.mark.skipif(os.name == "nt", reason="fork and signals are POSIX's")
ATTRIBUTES = """force_n speed_mm_s traction_n roughness_ln roughness_is_bound fineness_unfiltered_ln ln_psd_bands ln_fused_bands spectrum
    background pdc""".split()


def python(script, *arguments):
    return subprocess.run([sys.executable, "-c", script, *map(str, arguments)], capture_output=True, text=True, timeout=120)


EVERYTHING = """
import multiprocessing, os, sys, tactus
folder = sys.argv[1]
shared = tactus.Recordings(folder)

def everything(of=None):
    recordings = of or tactus.Recordings(folder)
    columns = recordings.features()
    slides = recordings.slides(recordings.textures[0])
    table = tactus.Table.learn(recordings, train_slides=2)
    own = tactus.Table.learn_slides({name: recordings.measured_slides(name) for name in recordings.textures[:3]})
    explorer = tactus.Explorer(table, among=recordings.textures[:1], method="fused-cycle")
    explorer.update(tactus.features_of(slides)[0])
    figures = tactus.evaluate(recordings, train_slides=2, runs=60)
    rig = tactus.SimulatedRig("burlap").slide(0.5, 25).features().roughness_ln
    world = [slide.pac.tobytes() for slides in tactus.simulate(["3"], trials=1).values() for slide in slides]
    return [bytes(table), bytes(own), columns["roughness_ln"].tobytes(), explorer.false_accept(), figures, rig, world]

def mine(_):
    return everything()

def parents(_):
    return everything(shared)

def childs(_):
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.map(mine, [0])[0]
"""
FORKED = (
    EVERYTHING
    + """
parent = everything(shared)
with multiprocessing.get_context("fork").Pool(2) as pool:
    assert pool.map_async(mine, range(2)).get(60) == [parent] * 2
    assert pool.map_async(parents, range(2)).get(60) == [parent] * 2
# a child may fork, too
child = os.fork()
if child == 0:
    os._exit(0 if childs(0) == parent else 1)
assert os.waitpid(child, 0)[1] == 0
assert everything() == parent
print("all the same")
"""
)


@POSIX
def test_a_forked_process_does_all_that_its_parent_did(small):
    done = python(FORKED, small.folder)
    assert (done.returncode, done.stdout) == (0, "all the same\n"), done.stderr


RIG_AT_WORK = """
import os, threading, time, tactus
rig = tactus.SimulatedRig("burlap")
over = threading.Event()
def work():
    while not over.is_set():
        rig.slide(0.5, 25)
worker = threading.Thread(target=work)
worker.start()
said = set()
for _ in range(40):
    child = os.fork()
    if child == 0:
        try:
            rig.slide(0.5, 25)
        except tactus.SimulationError as why:
            os._exit(7 if '"spawn"' in str(why) else 1)
        os._exit(0)
    said.add(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    if 7 in said:
        break
    time.sleep(0.003)
over.set()
worker.join()
print(7 in said, said <= {0, 7})
"""


@POSIX
def test_a_rig_that_was_at_work_when_its_process_was_forked_says_so(small):
    done = python(RIG_AT_WORK)
    assert (done.returncode, done.stdout) == (0, "True True\n"), done.stderr


def again(thing):
    return pickle.loads(pickle.dumps(thing))


def test_recordings_slides_features_and_tables_are_pickled(small, tmp_path, monkeypatch):
    recordings = again(small)
    assert recordings.folder == small.folder and len(recordings) == len(small)
    monkeypatch.chdir(small.folder.parent)
    relative = pickle.dumps(tactus.Recordings(small.folder.name))
    monkeypatch.chdir(tmp_path)
    assert pickle.loads(relative).textures == small.textures
    simulated = tactus.simulate(["burlap"], trials=1)["Burlap"]
    for slide in small.slides(small.textures[0]) + simulated:
        other = again(slide)
        assert (other.texture, other.number, other.window_s) == (slide.texture, slide.number, slide.window_s)
        for name in "pac", "still", "pdc", "shear_mn":
            np.testing.assert_array_equal(getattr(other, name), getattr(slide, name), name)
        for features in again(slide.features()), other.features():
            for name in ATTRIBUTES:
                np.testing.assert_array_equal(getattr(features, name), getattr(slide.features(), name), name)
    table = tactus.Table.learn(small, train_slides=2)
    assert bytes(again(table)) == bytes(copy.deepcopy(table)) == bytes(table)
    explorers = [tactus.Explorer(again(table)), tactus.Explorer(table)]
    for explorer, slide in zip(explorers, [again(slide.features()), slide.features()]):
        explorer.update(slide)
    assert explorers[0].posterior.tolist() == explorers[1].posterior.tolist()
    with pytest.raises(tactus.TactusError) as why:
        tactus.Recordings(tmp_path)
    assert str(again(why.value)) == str(why.value)


def test_what_is_not_pickled_says_what_to_do(small):
    table = tactus.Table.learn(small, train_slides=2)
    for thing, instead in (tactus.Explorer(table), "pickle its Table"), (tactus.SimulatedRig("burlap"), "make another one"):
        for way in pickle.dumps, copy.copy, copy.deepcopy:
            with pytest.raises(TypeError, match=instead):
                way(thing)


SPAWNED = """
import concurrent.futures, multiprocessing, sys, tactus
def length(slide):
    return slide.features().roughness_ln
if __name__ == "__main__":
    slides = tactus.Recordings(sys.argv[1]).slides("burlap")
    with concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(length, slides)) == [slide.features().roughness_ln for slide in slides]
    print("the same")
"""


def test_spawned_processes_get_slides(small, tmp_path):
    script = tmp_path / "spawned.py"
    script.write_text(SPAWNED)
    run = [sys.executable, str(script), str(small.folder)]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "the same\n"), done.stderr


LONG = {
    "an evaluation": "tactus.evaluate(recordings, train_slides=2, runs=10_000_000)",
    "a rig that another thread uses": "busy(rig)",
    "all textures of a world": "tactus.simulate(trials=1000)",
}
INTERRUPTED = """
import os, sys, threading, tactus
folder, fifo, call = sys.argv[1:]
os.mkfifo(fifo)
recordings = tactus.Recordings(folder)
rig = tactus.SimulatedRig("burlap")
def busy(rig):
    def work():
        while True:
            rig.slide(0.5, 25)
    threading.Thread(target=work, daemon=True).start()
    while True:
        rig.slide(0.5, 25)
print("begins", flush=True)
try:
    eval(call)
except KeyboardInterrupt:
    print("ended,", tactus.evaluate(recordings, train_slides=2, runs=60)["runs"], "more", flush=True)
    os._exit(0)
"""


@POSIX
@pytest.mark.parametrize("call", LONG)
def test_an_interrupt_ends_every_long_call(small, call, tmp_path):
    arguments = [str(small.folder), str(tmp_path / "fifo"), LONG[call]]
    run = [sys.executable, "-c", INTERRUPTED, *arguments]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        try:
            assert run.stdout.readline() == "begins\n", run.stderr.read()
            time.sleep(0.3)
            sent = time.perf_counter()
            run.send_signal(signal.SIGINT)
            out, err = run.communicate(timeout=20)
            took = time.perf_counter() - sent
        finally:
            run.kill()
    assert (run.returncode, out, err) == (0, "ended, 60 more\n", "")
    assert took < 10
