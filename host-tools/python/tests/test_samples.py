"""Samples of one's own in whatever array: taken where nothing is lost, refused in one sentence where something would be."""

import array
import threading

import numpy as np
import pytest

import tactus

ODD = lambda s: np.frombuffer(b"x" + s.tobytes(), "i2", offset=1)
SAME = {
    "int64": lambda s: s.astype("i8"),
    "int32": lambda s: s.astype("i4"),
    "big-endian": lambda s: s.astype(">i2"),
    "big-endian int32": lambda s: s.astype(">i4"),
    "list": lambda s: s.tolist(),
    "tuple": lambda s: tuple(s.tolist()),
    "list of numpy's": lambda s: list(s),
    "array.array": lambda s: array.array("h", s.tolist()),
    "memoryview": lambda s: memoryview(s.copy()),
    "odd address": ODD,
    "every other one": lambda s: np.repeat(s, 2)[::2],
    "backwards": lambda s: s[::-1].copy()[::-1],
    "a column of many": lambda s: np.stack([s, s + 1], axis=1)[:, 0],
    "Fortran order": lambda s: np.asfortranarray(s),
    "read-only": lambda s: np.frombuffer(s.tobytes(), "i2"),
    "nothing masked": lambda s: np.ma.masked_array(s, np.zeros(len(s), bool)),
    "a class of its own": lambda s: s.view(type("Mine", (np.ndarray,), {})),
}
REFUSED = {
    "float64": (lambda s: s.astype(float), TypeError, "is float64 of shape"),
    "float32 of a list": (lambda s: [float(v) for v in s], TypeError, "is float64 of shape"),
    "big-endian float": (lambda s: s.astype(">f4"), TypeError, "is >f4 of shape"),
    "complex": (lambda s: s.astype(complex), TypeError, "is complex128"),
    "bool": (lambda s: s > 0, TypeError, "is bool"),
    "text": (lambda s: "samples", TypeError, "of shape"),
    "bytes": (lambda s: s.tobytes(), TypeError, "of shape"),
    "object": (lambda s: s.astype(object), TypeError, "is object"),
    "days": (lambda s: s.astype("m8[D]"), TypeError, "is timedelta64"),
    "fields": (lambda s: np.zeros(len(s), "i2,i2"), TypeError, "of shape"),
    "rows of two lengths": (lambda s: [[1], [1, 2]], TypeError, "makes no array|is object"),
    "column": (lambda s: s[:, None], ValueError, r"has the shape \(\d+, 1\)"),
    "row of rows": (lambda s: s[None], ValueError, r"has the shape \(1, \d+\)"),
    "matrix": (lambda s: s.reshape(2, -1), ValueError, r"has the shape \(2, "),
    "one number": (lambda s: np.int16(7), ValueError, r"has the shape \(\)"),
    "masked": (lambda s: np.ma.masked_less(s, 0), ValueError, "has masked samples"),
    "17 bits": (lambda s: s.astype("i4") + 65536, ValueError, "16 bits hold -32768 to 32767"),
    "unsigned": (lambda s: s.astype("u2"), ValueError, "to 65[0-9]{3}, and 16 bits hold"),
    "64 bits": (lambda s: np.full(len(s), 2**64 - 1, "u8"), ValueError, "18446744073709551615"),
    "more than 64 bits": (lambda s: [2**70] * len(s), TypeError, "is object"),
}
STREAMS = ["pac", "still", "shear_mn", "pdc"]


def measured(slide, **others):
    given = {name: getattr(slide, name) for name in STREAMS}
    given.update(others)
    rates = dict(shear_rate_hz=slide.shear_rate_hz, pdc_rate_hz=slide.pdc_rate_hz)
    at = dict(window_s=slide.window_s, force_n=slide.force_n, speed_mm_s=slide.speed_mm_s)
    return tactus.features(given.pop("pac"), **given, **rates, **at)


def figures(features):
    return features.traction_n, features.roughness_ln, features.background, features.pdc, features.spectrum.tobytes()


@pytest.mark.parametrize("name", SAME)
def test_whole_numbers_are_taken_however_they_lie_in_memory(small, name):
    slide = small.slides(small.textures[0])[0]
    wanted = figures(measured(slide))
    for stream in STREAMS:
        given = SAME[name](getattr(slide, stream))
        assert figures(measured(slide, **{stream: given})) == wanted, stream


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_be_changed_is_refused_in_a_sentence(small, name):
    slide = small.slides(small.textures[0])[0]
    make, error, said = REFUSED[name]
    for stream in STREAMS:
        samples = getattr(slide, stream)
        # some of them negative, and not all of one sign
        samples = samples - np.int16(samples[0]) + np.int16(len(samples) % 2)
        samples[:2] = -1, 1
        with pytest.raises(error, match=f"^{stream} .*(?:{said})") as why:
            measured(slide, **{stream: make(samples[: len(samples) // 2 * 2])})
        assert "\n" not in str(why.value) and "ndarray" not in str(why.value)


def test_what_is_missing_or_empty_says_so(small):
    slide = small.slides(small.textures[0])[0]
    with pytest.raises(TypeError, match="^pac is object of shape"):
        measured(slide, pac=None)
    for empty in [], np.zeros(0), np.zeros(0, "i2"):
        with pytest.raises(tactus.SlideError, match="P_AC .samples: 0"):
            measured(slide, pac=empty)
        with pytest.raises(tactus.SlideError, match="still finger is empty"):
            measured(slide, still=empty)


def test_numbers_that_no_rig_has_are_refused(small):
    slide = small.slides(small.textures[0])[0]
    good = dict(window_s=slide.window_s, force_n=0.5, speed_mm_s=25.1, still=slide.still)
    for wrong in [
        dict(window_s=(float("nan"), 0.2)),
        dict(window_s=(0.1, float("inf"))),
        dict(window_s=(-0.1, 0.2)),
        dict(force_n=float("nan")),
        dict(speed_mm_s=-1.0),
        dict(still=None, background=float("nan")),
        dict(still=None, background=-1.0),
        dict(pdc=slide.pdc, pdc_rate_hz=0),
        dict(shear_mn=slide.shear_mn, shear_rate_hz=2**31),
    ]:
        with pytest.raises(tactus.SlideError):
            tactus.features(slide.pac, **{**good, **wrong})
    # the largest counts there are have features, and no overflow
    loud = np.random.default_rng(1).integers(-32768, 32768, len(slide.pac)).astype("i2")
    assert np.isfinite(tactus.features(loud, **good).roughness_ln)
    # one that only jumps from end to end is cut off
    cut = np.resize(np.array([-32768, 32767], "i2"), len(slide.pac))
    with pytest.raises(tactus.SlideError, match="cut off"):
        tactus.features(cut, **good)


def test_another_thread_may_write_to_the_samples(small):
    slide = small.slides(small.textures[0])[0]
    samples, over = slide.pac.copy(), threading.Event()

    def write():
        while not over.is_set():
            samples[:] = slide.pac[::-1]
            samples[:] = slide.pac

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(50):
            assert np.isfinite(measured(slide, pac=samples).roughness_ln)
    finally:
        over.set()
        writer.join()
    assert figures(measured(slide, pac=samples)) == figures(measured(slide))
