#!/usr/bin/env python3
"""A map of textures: the two directions in which the means of their features differ most, in deviations within a texture.

usage: map.py RECORDINGS [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import tactus

recordings = tactus.Recordings(sys.argv[1])
picture = sys.argv[2] if len(sys.argv) > 2 else "map.png"
features = recordings.features()
bands = features["ln_fused_bands"].astype(float)

# every texture and movement has a mean, and all slides share how they scatter about it
cells = np.unique(np.column_stack([features["material"], features["force_n"], features["speed_mm_s"]]), axis=0, return_inverse=True)[1].ravel()
means = np.stack([bands[cells == cell].mean(0) for cell in range(cells.max() + 1)])
apart = bands - means[cells]
white = np.linalg.inv(np.linalg.cholesky(apart.T @ apart / (len(bands) - len(means)) + 1e-6 * np.eye(bands.shape[1]))).T
points = np.stack([(bands[features["name"] == name] @ white).mean(0) for name in recordings.textures])
centred = points - points.mean(0)
place = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T

figure, axes = plt.subplots(figsize=(8, 7), layout="constrained")
axes.scatter(*place.T)
for name, at in zip(recordings.textures, place):
    axes.annotate(name, at, xytext=(4, 4), textcoords="offset points", fontsize="small")
axes.set(xlabel="deviations within a texture", ylabel="deviations within a texture", aspect="equal")
figure.savefig(picture, dpi=120)
nearest = np.linalg.norm(points[:, None] - points, axis=2) + np.diag(np.full(len(points), np.inf))
for name, row in zip(recordings.textures, nearest):
    print(f"{name}: nearest is {recordings.textures[row.argmin()]}, {row.min():.1f} deviations away")
print(picture)
