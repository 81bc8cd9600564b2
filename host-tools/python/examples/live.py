#!/usr/bin/env python3
"""A probe identifies what lies under its finger; the picture is drawn anew with every report of the rig, slide and verdict.

usage: live.py PORT [PICTURE] [LOG]

PORT is a serial port or tcp:HOST:PORT, such as that of `cargo xtask emulate --serve`. Without PICTURE a window shows it.
"""

import sys
import time

import matplotlib

if len(sys.argv) > 2:
    matplotlib.use("Agg")
import matplotlib.pyplot as plt

import tactus

port, picture, log = (sys.argv[1:] + [None, None])[:3] if len(sys.argv) > 1 else sys.exit(__doc__)
# drawing takes longer than a report of where the rig is
EVERY_S = 0.5
figure, (above, below) = plt.subplots(2, figsize=(8, 7), layout="constrained")
seconds, force, history, drawn = [], [], [], 0.0


def draw(title):
    above.clear(), below.clear()
    above.plot(seconds, force)
    above.set(title=title, xlabel="time of the probe (s)", ylabel="force (N)")
    for texture, values in zip(textures, zip(*history)):
        below.plot(values, marker="o", label=texture)
    below.set(xlabel="slides", ylabel="probability", ylim=(0, 1.02))
    below.legend(fontsize="small")
    if picture:
        figure.savefig(picture, dpi=100)
    else:
        plt.pause(0.001)


with tactus.Probe(port, log=log) as probe:
    textures = probe.table().textures
    history.append([1 / len(textures)] * len(textures))
    for report in probe.identify(seed=7):
        event = report["event"]
        if "Live" in event:
            seconds.append(report["at_ms"] / 1000)
            force.append(event["Live"]["force_mn"] / 1000)
        elif "Chosen" in event:
            print(f"slide {event['Chosen']['slide']} comes")
        elif "SlideReport" in event:
            history.append(event["SlideReport"]["posterior"])
        elif "Verdict" in event:
            print(f"{event['Verdict']['name']}, {event['Verdict']['probability']:.3f}")
        if "Live" not in event or time.monotonic() - drawn > EVERY_S:
            draw(f"The probe at {port}")
            drawn = time.monotonic()
if not picture:
    plt.show()
