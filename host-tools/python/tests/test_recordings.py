"""Recordings and features: what the command line prints, and what numpy computes."""

import csv
import io
import json

import numpy as np
import oracle
import pytest

import tactus


def test_features_are_the_commands_to_the_bit(small, biotac, command):
    for recordings in small, biotac:
        lines = command("features", "--recordings", recordings.folder, "--format", "json").splitlines()
        rows = [json.loads(line) for line in lines]
        ours = recordings.features()
        assert len(rows) == len(recordings) == len(ours["slide"])
        for name in "material", "name", "slide", "trial", "roughness_is_bound":
            assert [row[name] for row in rows] == ours[name].tolist(), name
        for name in "force_n", "speed_mm_s", "traction_n", "roughness_ln", "fineness_unfiltered_ln", "ln_fused_bands":
            theirs = np.array([row[name] for row in rows], np.float32)
            assert theirs.tobytes() == ours[name].tobytes(), name


def window(slide, rate_hz):
    return [round(float(s) * rate_hz) for s in slide.window_s]


def of_numpy(slide):
    shear = slide.shear_mn
    start, end = window(slide, slide.pac_rate_hz)
    if shear is not None:
        shear = shear[slice(*window(slide, slide.shear_rate_hz))]
    return oracle.features(slide.pac, start, end, slide.still, slide.background, shear)


@pytest.mark.parametrize("whose", ["small", "biotac"])
def test_features_are_those_of_numpy(whose, request):
    recordings = request.getfixturevalue(whose)
    for texture in recordings.textures:
        for slide in recordings.slides(texture):
            ours = slide.features()
            traction, roughness, fineness, eight, fused = of_numpy(slide)
            assert ours.traction_n == pytest.approx(traction, abs=1e-5)
            # coefficients on the chip have 15 bits
            assert ours.roughness_ln == pytest.approx(roughness, abs=5e-3)
            assert ours.fineness_unfiltered_ln == pytest.approx(fineness, abs=1e-3)
            np.testing.assert_allclose(ours.ln_psd_bands, eight, atol=5e-3)
            np.testing.assert_allclose(ours.ln_fused_bands, fused, atol=5e-3)


def test_samples_of_ones_own_have_the_features_of_the_recording(small, biotac):
    for recordings in small, biotac:
        for slide in recordings.slides(recordings.textures[0]):
            whole = slide.features()
            own = tactus.features(
                slide.pac,
                window_s=slide.window_s,
                force_n=slide.force_n,
                speed_mm_s=slide.speed_mm_s,
                still=slide.still if slide.background is None else None,
                background=slide.background,
                shear_mn=slide.shear_mn,
                shear_rate_hz=slide.shear_rate_hz,
                pdc=slide.pdc,
                pdc_rate_hz=slide.pdc_rate_hz,
            )
            for name in "traction_n", "roughness_ln", "fineness_unfiltered_ln", "pdc", "background":
                assert getattr(own, name) == getattr(whole, name), name
            assert own.spectrum.tobytes() == whole.spectrum.tobytes()
            assert own.spectrum.shape == own.frequencies_hz.shape == (257,)
            assert own.frequencies_hz[-1] == 1100


def test_samples_are_those_of_the_files(small):
    rows = list(csv.DictReader(io.StringIO((small.folder / "manifest.csv").read_text())))
    for row, slide in zip(rows, [s for name in small.textures for s in small.slides(name)]):
        load = lambda kind: np.load(small.folder / row[f"{kind}_file"])
        assert (int(row["slide"]), row["name"]) == (slide.number, slide.texture)
        for kind, samples in ("pac", slide.pac), ("pdc", slide.pdc), ("background", slide.still), ("shear", slide.shear_mn):
            np.testing.assert_array_equal(load(kind), samples, kind)


def test_nobody_writes_to_arrays(small):
    slide = small.slides(small.numbers[0])[0]
    assert slide.pac.dtype == np.int16 and slide.pac.flags.c_contiguous
    with pytest.raises(ValueError):
        slide.pac[0] = 1
    with pytest.raises(ValueError):
        small.features()["roughness_ln"][0] = 1


def test_errors_have_the_sentences_of_the_command_line(tmp_path, command):
    for folder in tmp_path / "nowhere", tmp_path:
        with pytest.raises(tactus.RecordingError) as why:
            tactus.Recordings(folder)
        assert str(why.value) == command("features", "--recordings", folder)
    assert issubclass(tactus.RecordingError, tactus.TactusError)


def test_a_file_that_was_damaged_is_named(tmp_path, small, command):
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(small.folder, copy)
    damaged = next(copy.glob("*_pac.npy"))
    damaged.write_bytes(damaged.read_bytes()[:-2])
    recordings = tactus.Recordings(copy)
    with pytest.raises(tactus.RecordingError) as why:
        recordings.features()
    assert damaged.name in str(why.value)
    assert str(why.value) == command("features", "--recordings", copy)


def test_what_is_no_slide_is_refused(small):
    slide = small.slides(small.textures[0])[0]
    good = dict(window_s=slide.window_s, force_n=0.5, speed_mm_s=25.1, still=slide.still)
    assert tactus.features(slide.pac, **good).traction_n is None
    # a rig that measures nothing else
    alone = tactus.features(slide.pac, window_s=slide.window_s)
    assert (alone.force_n, alone.speed_mm_s, alone.traction_n) == (0, 0, None)
    slow = tactus.features(slide.pac, window_s=slide.window_s, speed_mm_s=25, pdc=[1] * 99, pdc_rate_hz=6.5)
    assert (slow.force_n, slow.speed_mm_s) == (0, pytest.approx(25))
    for wrong, said in [
        (dict(window_s=(0.1, 99.0)), "99"),
        (dict(window_s=(0.3, 0.2)), "0.3"),
        (dict(force_n=70.0), "70000 mN"),
        (dict(still=np.zeros(0, np.int16)), "still finger"),
    ]:
        with pytest.raises(tactus.SlideError, match=said):
            tactus.features(slide.pac, **{**good, **wrong})
    with pytest.raises(tactus.SlideError, match="never changed"):
        tactus.features(np.zeros_like(slide.pac), **good)
    with pytest.raises(KeyError, match="velvet"):
        small.slides("velvet")
