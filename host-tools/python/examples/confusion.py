#!/usr/bin/env python3
"""One slide, one answer: the table's confusion matrix. docs/peers.py compares it with scikit-learn's classifiers.

usage: confusion.py RECORDINGS [TRAIN_SLIDES] [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import tactus

folder, *rest = sys.argv[1:]
train = int(rest[0]) if rest else 5
picture = rest[1] if len(rest) > 1 else "confusion.png"
recordings = tactus.Recordings(folder)

# learned from the first slides of each texture and movement, tested on all later ones
table = tactus.Table.learn(recordings, train_slides=train)
explorer = tactus.Explorer(table, max_slides=1, open=False)
names = recordings.textures
confusion = np.zeros((len(names), len(names)), int)
for truth, name in enumerate(names):
    made = {}
    for slide in recordings.measured_slides(name):
        setting = slide.force_n, slide.speed_mm_s
        made[setting] = made.get(setting, 0) + 1
        if made[setting] > train:
            explorer.restart()
            explorer.update(slide)
            confusion[truth, explorer.posterior.argmax()] += 1
print(f"{len(names)} textures: {100 * np.trace(confusion) / confusion.sum():.1f} % right after one slide")

figure, axes = plt.subplots(figsize=(8, 7), layout="constrained")
axes.imshow(confusion / confusion.sum(1, keepdims=True), cmap="viridis", vmin=0, vmax=1)
axes.set_xticks(range(len(names)), names, rotation=90)
axes.set_yticks(range(len(names)), names)
axes.set(xlabel="told", ylabel="presented")
figure.savefig(picture, dpi=120)
print(picture)
