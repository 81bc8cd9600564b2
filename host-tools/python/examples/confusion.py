#!/usr/bin/env python3
"""One slide, one answer: the table's confusion matrix, and scikit-learn's classifiers on the same features.

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
share = lambda right: f"{100 * right:.1f} % right after one slide"
print(f"tactus, {len(names)} textures: {share(np.trace(confusion) / confusion.sum())}")

figure, axes = plt.subplots(figsize=(8, 7), layout="constrained")
axes.imshow(confusion / confusion.sum(1, keepdims=True), cmap="viridis", vmin=0, vmax=1)
axes.set_xticks(range(len(names)), names, rotation=90)
axes.set_yticks(range(len(names)), names)
axes.set(xlabel="told", ylabel="presented")
figure.savefig(picture, dpi=120)
print(picture)

try:
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
except ImportError:
    sys.exit("without scikit-learn there is nothing to compare with: pip install scikit-learn")

all_ = recordings.features()
x = np.column_stack([all_["traction_n"], all_["ln_fused_bands"], all_["force_n"], all_["speed_mm_s"]])
first = all_["trial"] <= train
for classifier in (
    make_pipeline(StandardScaler(), LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")),
    make_pipeline(StandardScaler(), KNeighborsClassifier(3)),
    RandomForestClassifier(300, random_state=1),
):
    classifier.fit(x[first], all_["material"][first])
    right = classifier.score(x[~first], all_["material"][~first])
    last = getattr(classifier, "steps", [(None, classifier)])[-1][1]
    print(f"{type(last).__name__}: {share(right)}")
