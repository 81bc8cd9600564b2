#!/usr/bin/env python3
"""Features of a slide, and its spectrogram.

usage: spectrogram.py RECORDINGS [TEXTURE] [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import tactus

folder, *rest = sys.argv[1:]
recordings = tactus.Recordings(folder)
texture = rest[0] if rest else recordings.textures[0]
picture = rest[1] if len(rest) > 1 else "spectrogram.png"

slide = recordings.slides(texture)[0]
features = slide.features()
print(slide, features, sep="\n")

figure, (above, below) = plt.subplots(2, figsize=(8, 6), layout="constrained")
above.specgram(slide.pac, NFFT=512, noverlap=256, Fs=slide.pac_rate_hz, cmap="magma")
for edge in slide.window_s:
    above.axvline(edge, color="white", linestyle="--")
above.set(title=f"{texture}, {slide.force_n:.2f} N, {slide.speed_mm_s:.1f} mm/s", xlabel="s", ylabel="Hz")
below.loglog(features.frequencies_hz[1:], features.spectrum[1:])
below.set(title="mean spectrum at constant speed", xlabel="Hz", ylabel="counts² per bin")
figure.savefig(picture, dpi=120)
print(picture)
