#!/usr/bin/env python3
"""A simulated arm moves the finger of an emulated board, which finds out what it touches.

usage: arm.py EMULATOR FIRMWARE [SEEDS]

EMULATOR: target/emulator/release/tactus-emulator; FIRMWARE: the image `tactus-arm`, both of `cargo xtask emulate --port 0 --arm-port 0`.
SEEDS: "1-20"; each is a world, a texture under the finger, and an arm. The arm knows of the emulator its joints alone: it sets
velocities, and reads encoders.
"""

import socket
import subprocess
import sys
import threading
import time

import tactus

SAFE_MM, LIFTS_MM_S, MOVES_MM_S, MARGIN_MM, SAMPLE_MM, LOWEST_MM = 8.0, 30.0, 60.0, 2.0, 75.0, -4.0


class SimulatedArm(tactus.Rig):
    """The arm of the emulator's port: "ALONG UP" sets velocities (mm/s); "MS X HEIGHT ALONG" comes every 10 ms (mm, mm/s)."""

    # the board's time may be slower than this computer's
    _hangs_s = _gone_s = 5.0

    def __init__(self, address):
        self.line = socket.create_connection(address)
        self.line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.moved = threading.Condition()
        self.at = (0, 0.0, SAFE_MM, 0.0)
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.line.makefile():
            with self.moved:
                self.at = tuple(map(float, line.split()))
                self.moved.notify_all()

    def go(self, along=0.0, up=0.0):
        self.line.sendall(b"%.4f %.4f\n" % (along, up))

    def wait(self):
        """The next word of the encoders."""
        with self.moved:
            self.moved.wait(0.2)
        self.alive()
        return self.at

    def press(self, movement):
        speed, length = movement["speed_um_s"] / 1e3, movement["length_um"] / 1e3
        room = SAMPLE_MM - 2 * MARGIN_MM - length - speed * speed / 1e3 - 0.1 * speed
        begin = MARGIN_MM + max(room, 0.0) * movement["start"] / 1e3
        _, x, height, _ = self.wait()
        while abs(begin - x) > 0.1:
            self.go(max(-MOVES_MM_S, min(MOVES_MM_S, 10 * (begin - x))), LIFTS_MM_S if height < SAFE_MM else 0.0)
            _, x, height, _ = self.wait()
        wanted, fastest, right_since = movement["force_mn"] / 1e3, movement["approach_um_s"] / 1e3, None
        while True:
            missing = wanted - self.force_n
            if self.force_n < 0.03:
                down = fastest
            elif abs(missing) < 0.02 * wanted + 0.006:
                down = 0.0
            else:
                down = max(-fastest, min(fastest, 1.5 * missing))
            self.go(0.0, -down)
            ms, _, height, _ = self.wait()
            if height < LOWEST_MM:
                raise RuntimeError("there is no sample")
            right_since = None if down else right_since or ms
            if right_since and ms - right_since > 100:
                return

    def slide(self, movement):
        speed, length = movement["speed_um_s"] / 1e3, movement["length_um"] / 1e3
        self.go(speed)
        while abs(self.wait()[3] - speed) > 0.02 * speed:
            pass
        self.steady()
        begin_ms, begin, *_ = self.at
        ms, x = begin_ms, begin
        while x - begin < length and x < SAMPLE_MM:
            ms, x, *_ = self.wait()
        self.go()
        while abs(self.wait()[3]) > 0.05:
            pass
        return x - begin, (x - begin) / (ms - begin_ms) * 1e3

    def lift(self):
        while (height := self.wait()[2]) < SAFE_MM - 0.2:
            self.go(0.0, min(LIFTS_MM_S, 10 * (SAFE_MM - height)))
        self.go()

    def stop(self):
        self.go()


def explore(emulator, firmware, seed):
    """One exploration: the texture's name, the verdict, and its slides."""
    unknown = tactus.TEXTURES[seed * 37 % 117]
    others = [name for name in tactus.TEXTURES[::13] if name != unknown]
    learned = tactus.simulate([unknown, *others], trials=5, seed=seed)
    slides = {name: tactus.features_of(slides) for name, slides in learned.items()}
    table = tactus.Table.learn_slides(slides, features="bands")
    run = [emulator, "serve", "--elf", firmware, "--texture", unknown, "--seed", str(seed), "--port", "0", "--arm-port", "0"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, text=True) as board:
        try:
            ports = {}
            while "serial port" not in ports:
                name, at, rest = board.stdout.readline().partition(" at ")
                if at:
                    ports[name] = rest.split(",")[0].strip()
            arm = SimulatedArm(tuple(ports["arm"].rsplit(":", 1)))
            with tactus.Probe("tcp:" + ports["serial port"], timeout_s=60) as probe:
                ready(probe)
                probe.write_table(table)
                verdict, made = None, 0
                for report in arm.drive(probe, probe.identify(seed=seed)):
                    event = report["event"]
                    if "SlideReport" in event:
                        made += 1
                    elif "Rejected" in event:
                        print(f"  rejected: {event['Rejected']['why']}")
                    elif "Verdict" in event:
                        verdict = event["Verdict"]
        finally:
            board.kill()
    return unknown, verdict, made


def ready(probe):
    """Waits until the board has started."""
    while True:
        try:
            if probe.status()["textures"]:
                return
        except tactus.ProbeError as why:
            if "restarted" not in str(why):
                raise
        time.sleep(0.2)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    first, _, last = (sys.argv[3] if len(sys.argv) > 3 else "1").partition("-")
    right, all_ = 0, range(int(first), int(last or first) + 1)
    for seed in all_:
        began = time.monotonic()
        unknown, verdict, made = explore(sys.argv[1], sys.argv[2], seed)
        is_right = verdict["name"] == unknown and verdict["sure"] and not verdict["unknown"]
        right += is_right
        word = "right" if is_right else "NOT RIGHT"
        print(f"seed {seed}: {word}: {verdict['name']} ({verdict['probability']:.3f}), it was {unknown}; slides: {made}, {time.monotonic() - began:.0f} s", flush=True)
    print(f"{right} of {len(all_)} right")
    sys.exit(right != len(all_))
