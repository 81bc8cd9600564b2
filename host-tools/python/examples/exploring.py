#!/usr/bin/env python3
"""A simulated rig explores an unknown texture; the picture is drawn anew after every slide.

usage: exploring.py [TEXTURE] [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import tactus

unknown = sys.argv[1] if len(sys.argv) > 1 else "Burlap"
picture = sys.argv[2] if len(sys.argv) > 2 else "exploring.png"

others = [name for name in tactus.TEXTURES[::15] if name.lower() != unknown.lower()]
learned = tactus.simulate([unknown, *others], trials=3)
table = tactus.Table.learn_slides({name: tactus.features_of(slides) for name, slides in learned.items()})
print(table)

rig = tactus.SimulatedRig(unknown, trial=1000)
explorer = tactus.Explorer(table, method="fused", threshold=0.999)
history = [explorer.posterior]
figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
while explorer.verdict() is None:
    chosen = explorer.next_movement()
    slide = rig.slide(chosen["force_n"], chosen["speed_mm_s"])
    explorer.update(slide.features())
    history.append(explorer.posterior)
    print(f"slide {explorer.slides}: {chosen['force_n']:.2f} N, {chosen['speed_mm_s']:.1f} mm/s, {explorer.best()['texture']}")
    axes.clear()
    for texture, values in zip(explorer.textures, zip(*history)):
        axes.plot(values, marker="o", label=texture)
    axes.set(xlabel="slides", ylabel="probability", title=f"{unknown}, after {rig.time_s:.0f} s of the rig")
    axes.legend(fontsize="small")
    figure.savefig(picture, dpi=120)
print(explorer.verdict(), picture, sep="\n")
