"""Recordings from arrays: what `tactus import` makes of the same samples, and what numpy computes."""

import ast
import pickle
import re
import warnings

import numpy as np
import pytest
from conftest import ROOT

import tactus

NAMES = "cork", "felt", "silk"
STREAMS = "pac", "still", "pdc", "shear_mn"


def sensor(rate_hz, seconds=2.0, each=6, seed=1):
    """Noise of three kinds, as somebody's sensor has it, in a unit of its own: arrays and labels."""
    rng = np.random.default_rng(seed)
    arrays, labels = [], []
    for kind, name in enumerate(NAMES):
        for _ in range(each):
            noise = rng.normal(0, 1, int(seconds * rate_hz) + 64)
            # the wider the mean, the lower its frequencies, whatever the rate
            width = max(1, round(rate_hz / (60, 150, 400)[kind] / 2))
            smooth = np.convolve(noise, np.ones(width) / np.sqrt(width), "same") + 0.05 * noise
            arrays.append((3 + (1 + kind) * smooth * rng.uniform(0.9, 1.1))[: int(seconds * rate_hz)])
            labels.append(name)
    return arrays, labels


def same(ours, theirs):
    assert ours.textures == theirs.textures and len(ours) == len(theirs)
    for name in ours.textures:
        for one, other in zip(ours.slides(name), theirs.slides(name), strict=True):
            assert (one.number, one.window_s) == (other.number, other.window_s)
            assert (one.force_n, one.speed_mm_s, one.background) == (other.force_n, other.speed_mm_s, other.background)
            for stream in STREAMS:
                np.testing.assert_array_equal(getattr(one, stream), getattr(other, stream), stream)


@pytest.mark.parametrize("rate_hz", [100, 250.5, 500, 999.5, 1600, 2200, 3333, 8000, 44_100, 192_000])
def test_any_rate_comes_to_a_verdict_as_by_the_command(rate_hz, tmp_path, command):
    arrays, labels = sensor(rate_hz, seconds=15 if rate_hz < 500 else 1.5)
    ours = tactus.Recordings.from_arrays(arrays, rate_hz=rate_hz, unit="g", labels=labels)
    for name in NAMES:
        (tmp_path / "own" / name).mkdir(parents=True)
    for n, (array, label) in enumerate(zip(arrays, labels)):
        np.save(tmp_path / "own" / label / f"{n:02}.npy", array)
    command("import", tmp_path / "own", tmp_path / "theirs", "--rate", rate_hz, "--unit", "g")
    theirs = tactus.Recordings(tmp_path / "theirs")
    same(ours, theirs)
    assert float(re.search(r"^gain = (.*)", (tmp_path / "theirs/import.toml").read_text(), re.M)[1]) == ours.gain
    assert bytes(tactus.Table.learn(ours)) == bytes(tactus.Table.learn(theirs))
    table = tactus.Table.learn(ours, train_slides=4)
    told = [tactus.identify(table, ours.measured_slides(name)[4:]) for name in NAMES]
    assert [answer["texture"] for answer in told] == list(NAMES), told


@pytest.mark.parametrize("rate_hz", [500, 1000, 2200, 5000, 44_100, 192_000])
def test_a_tone_stays_where_it_is_and_fills_12_bits(rate_hz):
    """Against the sine itself, computed at 2200 Hz."""
    hz, seconds = 90.0, 4
    tone = lambda rate: np.sin(2 * np.pi * hz * np.arange(seconds * rate) / rate)
    told = tactus.Recordings.from_arrays([9.81 + 0.02 * tone(rate_hz)], rate_hz=rate_hz, unit="m/s2", labels=["tone"])
    (slide,) = told.slides("tone")
    pac, whole = slide.pac.astype(float), 0.02 * told.gain * tone(2200)
    assert 1800 <= np.abs(pac[500:-500]).max() <= 2047 and told.found["unit"] == "m/s2"
    assert f"{told.gain:g} counts per m/s2" in repr(told)
    # the mean over whole periods is not quite 0, and a filter may be late by a part of a sample
    errors = [np.abs(pac[500:-500] - np.roll(whole, late)[500 : len(pac) - 500]).max() for late in (-1, 0, 1)]
    assert min(errors) < 0.3 * np.abs(whole).max()
    spectrum = slide.features().spectrum
    assert abs(slide.features().frequencies_hz[spectrum.argmax()] - hz) < 4.3


TYPES = "i1", "u1", "i2", ">i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", ">f4", "f8", ">f8", "g"


def test_any_real_type_gives_the_same_slides():
    arrays, labels = sensor(2200)
    arrays = [np.clip(np.rint(40 + 8 * array), 0, 127) for array in arrays]
    of = lambda all_: tactus.Recordings.from_arrays(all_, rate_hz=2200, labels=labels)
    reference = of(arrays)
    for dtype in TYPES:
        same(of([array.astype(dtype) for array in arrays]), reference)
    same(of([array.tolist() for array in arrays]), reference)
    same(of(np.stack(arrays)), reference)
    same(of(np.asfortranarray(np.stack(arrays))), reference)
    same(of([np.repeat(array, 3)[::3] for array in arrays]), reference)
    same(of([array[:, None] for array in arrays]), reference)
    same(of(array for array in arrays), reference)


def test_counts_stay_as_they_are_and_a_gain_is_kept():
    arrays, labels = sensor(2200)
    counts = [np.rint(50 * (a - a.mean())).astype("i2") for a in arrays]
    for given, gain, all_ in ({"unit": "counts"}, 1.0, counts), ({"gain": 2.5}, 2.5, arrays):
        told = tactus.Recordings.from_arrays(all_, rate_hz=2200, labels=labels, cut=False, **given)
        assert told.gain == gain
        for name in NAMES:
            for slide, array in zip(told.slides(name), [a for a, label in zip(all_, labels) if label == name]):
                about = array - array.mean()
                assert np.abs(slide.pac - about * gain).max() <= 0.5 + 1e-6


def test_long_arrays_are_cut_into_slides_of_one_run_and_whole_ones_are_not():
    arrays, labels = sensor(1000, seconds=13, each=2)
    cut = tactus.Recordings.from_arrays(arrays, rate_hz=1000, labels=labels, length_s=3)
    assert len(cut) == 4 * len(arrays)
    runs = cut.features()["run"]
    assert len(set(runs)) == len(arrays) and all((runs == run).sum() == 4 for run in set(runs))
    whole = tactus.Recordings.from_arrays(arrays, rate_hz=1000, labels=labels, cut=False, runs=list("aabbcc"))
    assert len(whole) == len(arrays) and whole.features()["run"].tolist() == list("aabbcc")
    # slides between which the finger rests
    rng = np.random.default_rng(2)
    still, slide = (lambda: rng.normal(0, 0.01, 2200)), (lambda: rng.normal(0, 1, 4400))
    once = tactus.Recordings.from_arrays(
        [np.concatenate([still(), slide(), still(), slide(), still()])], rate_hz=2200, labels=["wool"]
    )
    assert len(once) == 2 and all(len(slide.still) > 1000 for slide in once.slides("wool"))


def test_channels_pressure_shear_session_and_movement_are_taken_over():
    arrays, labels = sensor(2200)
    load = [np.linspace(1, 2, len(array)) * (1 + at % 3) for at, array in enumerate(arrays)]
    drag = [np.full(len(array), 0.25) for array in arrays]
    both = [np.column_stack(columns) for columns in zip(load, arrays, drag)]
    told = tactus.Recordings.from_arrays(
        both, rate_hz=2200, labels=labels, sessions=[at % 2 for at in range(len(both))], pressure=0, shear=2,
        force_n=0.5, speed_mm_s=25, finger="my-finger", cut=False,
    )
    assert told.finger[0] == "my-finger" and told.settings == [pytest.approx((0.5, 25))] and told.found["channel"] == 1
    assert tactus.Table.learn(told).finger == "my-finger"
    columns = told.features()
    assert columns["traction_n"] == pytest.approx(0.25, abs=1e-3)
    mean, sd = columns["pdc"].T
    assert (sd > 0).all() and mean.max() / mean.min() == pytest.approx(3, rel=0.05)
    assert sorted(set(columns["session"])) == ["0", "1"]


def test_what_is_written_is_read_back_equal(tmp_path, command):
    arrays, labels = sensor(1600)
    told = tactus.Recordings.from_arrays(arrays, rate_hz=1600, unit="V", labels=labels, sessions=["mon", "tue"] * 9)
    told.write(tmp_path / "written")
    read = tactus.Recordings(tmp_path / "written")
    same(told, read)
    for name, column in told.features().items():
        np.testing.assert_array_equal(column, read.features()[name], name)
    assert (told.folder, read.folder, read.gain, read.found) == (None, tmp_path / "written", None, None)
    assert tactus.evaluate(told, runs=200, train_slides=3) == tactus.evaluate(read, runs=200, train_slides=3)
    assert '"name":"silk"' in command("features", "--recordings", tmp_path / "written", "--format", "json")
    with pytest.raises(tactus.RecordingError, match="already holds"):
        told.write(tmp_path / "written")
    again = pickle.loads(pickle.dumps(told))
    same(again, told)
    assert again.found == told.found
    # what came from a folder is copied
    small = tactus.Recordings(ROOT / "host-tools/recordings/simulated")
    small.write(tmp_path / "copy")
    same(tactus.Recordings(tmp_path / "copy"), small)


def test_what_are_no_recordings_is_refused():
    arrays, labels = sensor(2200, each=2)
    def of(all_=arrays, **other):
        return tactus.Recordings.from_arrays(all_, **{"rate_hz": 2200, "labels": labels, **other})

    gap = [*arrays[:5], np.where(np.arange(4400) == 77, np.nan, arrays[5])]
    still = [np.zeros(4400)] * 6
    for why, kind, said in [
        (dict(all_=gap), ValueError, "array 5: value 77"),
        (dict(all_=[array + 1j for array in arrays]), TypeError, "numpy.real"),
        (dict(all_=["cork"] * 6), TypeError, "real numbers"),
        (dict(all_=[np.ma.masked_greater(array, 0) for array in arrays]), ValueError, "masked"),
        (dict(all_=np.zeros((6, 2, 2, 2))), ValueError, "shape"),
        (dict(all_=[array[:900] for array in arrays]), tactus.RecordingError, "array 0: too short"),
        (dict(all_=still), tactus.RecordingError, "array 0: no channel in it ever changes"),
        (dict(all_=[]), ValueError, "labels"),
        (dict(all_=[], labels=[]), tactus.RecordingError, "no recordings"),
        (dict(labels=labels[:-1]), ValueError, "5 of them for 6"),
        (dict(labels="cork"), TypeError, "one for each"),
        (dict(labels=None), TypeError, "NoneType.* is given, and wanted is one for each"),
        (dict(labels=["\x1b[2J", *labels[1:]]), ValueError, "array 0 has characters that do not print"),
        (dict(labels=[*labels[:-1], "cork\u202e"]), ValueError, "array 5 has characters that do not print"),
        (dict(sessions=["mon\n", *labels[1:]]), ValueError, "sessions: .* do not print"),
        (dict(labels=[*labels[:-1], None]), ValueError, "array 5 has none"),
        (dict(sessions=["mon"]), ValueError, "sessions"),
        (dict(rate_hz=0.5), tactus.RecordingError, "0.5 Hz"),
        (dict(rate_hz=float("nan")), tactus.RecordingError, "NaN"),
        (dict(rate_hz=400_000), tactus.RecordingError, "400000 Hz|too short"),
        (dict(gain=-1.0), tactus.RecordingError, "gain"),
        (dict(channel=1), tactus.RecordingError, "channel"),
    ]:
        with pytest.raises(kind, match=said):
            of(**why)


def test_a_copy_and_a_short_one_are_left_out_and_told():
    arrays, labels = sensor(2200, each=3)
    shifted = np.concatenate([arrays[0][500:], arrays[3][:500]])
    for copy, label in [(arrays[0], labels[0]), (shifted, labels[0]), (shifted, labels[-1]), (-shifted, labels[0])]:
        with pytest.warns(UserWarning, match=f"left out: array 9: .*slide 1 of {labels[0]} .array 0."):
            told = tactus.Recordings.from_arrays([*arrays, copy], rate_hz=2200, labels=[*labels, label])
        assert len(told) == 9 and len(told.found["left_out"]) == 1
    with pytest.warns(UserWarning, match="array 9: too short"):
        told = tactus.Recordings.from_arrays([*arrays, arrays[0][:800]], rate_hz=2200, labels=[*labels, labels[0]])
    assert len(told) == 9 and "array 9" in told.found["left_out"][0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tactus.Recordings.from_arrays(arrays, rate_hz=2200, labels=labels)


def test_features_of_ones_own_make_the_same_table_as_those_of_slides():
    arrays, labels = sensor(2200)
    told = tactus.Recordings.from_arrays(arrays, rate_hz=2200, labels=labels)
    columns = told.features()
    by_rows = tactus.Table.learn(columns["ln_fused_bands"], columns["name"], train_slides=4)
    slides = {name: told.measured_slides(name)[:4] for name in NAMES}
    by_slides = tactus.Table.learn_slides(slides, features="bands")
    assert bytes(by_rows) == bytes(by_slides)
    for name in NAMES:
        slide, row = told.measured_slides(name)[5], columns["ln_fused_bands"][columns["name"] == name][5]
        answers = tactus.identify(by_slides, [slide]), tactus.identify(by_rows, [row])
        assert answers[0] == answers[1] and answers[0]["texture"] == name
    drawn = dict(runs=300, train_slides=3, features="bands")
    for protocol in "interleaved", "drift":
        ours = tactus.evaluate(columns["ln_fused_bands"], columns["name"], protocol=protocol, **drawn)
        assert ours == tactus.evaluate(told, protocol=protocol, **drawn)
    for rows, names, said in [
        (columns["ln_fused_bands"], None, "labels"),
        (columns["ln_fused_bands"], labels[:3], "3 of them for 18"),
        (np.zeros((18, tactus.MAX_FEATURES + 1)), labels, "PCA"),
        (100 * columns["ln_fused_bands"], labels, "scale"),
        (np.full((18, 2), np.nan), labels, "NaN"),
    ]:
        with pytest.raises((TypeError, ValueError), match=said):
            tactus.Table.learn(rows, names)
    with pytest.raises(ValueError, match="sessions"):
        tactus.evaluate(columns["ln_fused_bands"], labels, sessions=["a"])
    with pytest.raises(tactus.TableError):
        tactus.Explorer(by_rows).update([1.0, 2.0])


def test_the_five_lines_of_the_book_come_to_a_verdict(capsys):
    """The page's own lines, with arrays of a sensor of 8 kHz."""
    page = (ROOT / "docs/src/own-data.md").read_text()
    lines = page.split("## In five lines of Python")[1].split("```python\n")[1].split("```")[0]
    assert len(lines.splitlines()) == 5
    arrays, labels = sensor(8000)
    for at, label in enumerate(labels[:: len(labels) // 3]):
        place = at * len(labels) // 3
        others = [array for n, array in enumerate(arrays) if n != place]
        names = [name for n, name in enumerate(labels) if n != place]
        exec(lines, {"arrays": others, "labels": names, "array": arrays[place].astype("f4")})
        told = ast.literal_eval(capsys.readouterr().out)
        assert (told["told"], told["texture"]) == ("sure", label)


def test_what_was_not_measured_stays_unknown_and_names_of_ours_are_refused(tmp_path):
    arrays = [np.random.default_rng(seed).normal(size=4400) for seed in range(4)]
    given = dict(rate_hz=2200, labels=["cork", "cork", "silk", "silk"])
    for name in "tactus-x", "Tactus-X":
        with pytest.raises(tactus.RecordingError, match="biotac, analog, mems, or another name"):
            tactus.Recordings.from_arrays(arrays, finger=name, **given)
    known = tactus.Recordings.from_arrays(arrays, speed_mm_s=20, finger="biotac", **given)
    known.write(tmp_path / "own")
    for recordings in known, tactus.Recordings(tmp_path / "own"):
        assert recordings.settings == [(0, 20)] and recordings.finger[0] == "biotac"
        features = recordings.features()
        assert np.isnan(features["force_n"]).all() and (features["speed_mm_s"] == 20).all()
        assert np.isnan(features["pdc"]).all() and np.isnan(features["traction_n"]).all()
        assert tactus.Table.learn(recordings).settings == [(0, 20)]
    # a manifest by hand
    text = (tmp_path / "own" / "manifest.csv").read_text()
    rows = [row.split(",") for row in text.splitlines()]
    keep = [rows[0].index(name) for name in ("name", "pac_file", "pac_rate_hz")]
    text = "\n".join(",".join(row[at] for at in keep) for row in rows)
    (tmp_path / "own" / "manifest.csv").write_text(text)
    assert tactus.Recordings(tmp_path / "own").settings == [(0, 0)]
    (tmp_path / "own" / "manifest.csv").write_text(text.replace("name,", "finger,name,").replace("\n", "\ntactus-x,"))
    with pytest.raises(tactus.RecordingError, match="tactus-x"):
        tactus.Recordings(tmp_path / "own")
