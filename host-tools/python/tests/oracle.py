"""The features of a slide in numpy and floating point, from the paper's equations: no line of it is the core's."""

import numpy as np

RATE = 2200
EDGES = np.array([1, 2, 4, 5, 6, 7, 8, 9, 11, 13, 16, 19, 22, 26, 31, 37, 43, 51, 60, 71, 84, 100, 118, 140, 166, 197, 233])
PAPER_EDGES = np.array([5, 8, 13, 21, 33, 54, 88, 143, 233])
WINDOW = np.hanning(513)[:512]
WEIGHT = (WINDOW**2).sum()


def band_pass(taps=67, low=20.0, high=700.0):
    """A Hamming-windowed sinc of 20 to 700 Hz, of gain 1 in the middle of its band."""
    n = np.arange(taps) - (taps - 1) / 2
    lowpass = lambda f: 2 * f / RATE * np.sinc(2 * f / RATE * n)
    h = (lowpass(high) - lowpass(low)) * np.hamming(taps)
    middle = (low + high) / 2
    return h / abs((h * np.exp(-2j * np.pi * middle / RATE * n)).sum())


FILTER = band_pass()


def features(pac, start, end, still=None, background=None, shear_mn=None):
    """Traction (N), roughness (ln), fineness (ln), eight band powers (ln), and 26 mean logarithms of them of int16 samples at 2200 Hz; constant speed from
    sample `start` to `end`, and shear there."""
    pac = pac.astype(float)
    # the filter has seen the samples before the window
    passed = np.convolve(pac[start - len(FILTER) + 1 : end], FILTER, "valid")
    if background is None:
        background = (np.convolve(still.astype(float), FILTER, "valid") ** 2).mean()
    above = (passed**2).mean() - background
    roughness = np.log(max(above, background / 16, 1 / 12))
    steady = pac[start:end] - pac[start:end].mean()
    frames = np.lib.stride_tricks.sliding_window_view(steady, 512)[::256] * WINDOW
    psd = (np.abs(np.fft.rfft(frames, axis=1)) ** 2).mean(0) / WEIGHT
    # of each frame by itself, without its own weighted mean
    each = np.lib.stride_tricks.sliding_window_view(pac[start:end], 512)[::256]
    each = (each - (each * WINDOW).sum(1, keepdims=True) / WINDOW.sum()) * WINDOW
    each = np.abs(np.fft.rfft(each, axis=1)) ** 2 / WEIGHT
    fused = np.array([np.log(each[:, a:b].mean(1) + 0.1).mean() for a, b in zip(EDGES, EDGES[1:])])
    f = np.arange(257) * RATE / 512
    of = lambda edges, floor: np.log([psd[a:b].mean() + floor for a, b in zip(edges, edges[1:])])
    traction = None if shear_mn is None else shear_mn.mean() / 1000
    # eq. 18 weighs frequencies by power
    return traction, roughness, np.log((psd * f).sum() / psd.sum()), of(PAPER_EDGES, 1e-3), fused
