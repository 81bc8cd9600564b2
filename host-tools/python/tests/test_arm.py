"""An arm at a probe in Python: what it is asked for, what it says, and that it stops."""

import os
import queue
import socket
import sys
import threading
import time

import pytest
from conftest import ROOT, received, sent

import tactus

if os.name == "nt":
    pytest.skip("the client beside the page of the link is for POSIX", allow_module_level=True)
sys.path.insert(0, str(ROOT / "docs/src"))
sys.dont_write_bytecode = True
import client  # noqa: E402

MOVEMENT = {"force_mn": 500, "speed_um_s": 25000, "length_um": 60000, "start": 250, "approach_um_s": 1000}


class Probe:
    """A probe with an arm: `script` runs once it is asked to identify; it says orders, and waits for states."""

    def __init__(self, script):
        self.script, self.states, self.number = script, queue.Queue(), 0
        self.force_mn = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = "tcp:127.0.0.1:%d" % self.listener.getsockname()[1]
        self.failed, self.lock = None, threading.Lock()
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        self.line, _ = self.listener.accept()
        rest = b""
        while came := received(self.line):
            *frames, rest = (rest + came).split(b"\0")
            for request in map(client.message, filter(None, frames)):
                request = client.read("Request", request)[0]
                command = request["command"]
                if isinstance(command, dict) and "Arm" in command:
                    self.states.put((command["Arm"]["number"], command["Arm"]["state"]))
                elif isinstance(command, dict) and "Identify" in command:
                    threading.Thread(target=self.identify, args=(request["id"],), daemon=True).start()
                    continue
                self.tell({"Done": request["id"]})

    def identify(self, id_):
        try:
            self.script(self)
        except BaseException as why:
            self.failed = why
        self.tell({"Done": id_})

    def tell(self, event):
        with self.lock:  # two threads say something
            report = {"number": self.number, "at_ms": 0, "event": event}
            self.number = (self.number + 1) % 65536
            sent(self.line, client.frame(client.write("Report", report)))

    def order(self, number, task):
        self.tell({"Arm": {"number": number, "task": task}})

    def live(self, force_mn):
        self.force_mn = force_mn
        self.tell({"Live": {"force_mn": force_mn, "steps": 0, "stage_um": 0, "speed_um_s": 0, "current_ma": 0}})

    def heard(self, number, state, seconds=3.0):
        """Waits until the arm says this."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            try:
                said = self.states.get(timeout=0.05)
            except queue.Empty:
                # a probe says its force all the time
                self.live(self.force_mn)
                continue
            if said == (number, state):
                return time.monotonic()
        raise AssertionError(f"never said {state} about {number}")


class Arm(tactus.Rig):
    def __init__(self):
        self.did, self.stopped_at, self.hangs = [], None, False

    def press(self, movement):
        self.did.append(("press", movement))
        while self.force_n < movement["force_mn"] / 1000 or self.hangs:
            time.sleep(0.01)
            if not self.hangs:
                self.alive()

    def slide(self, movement):
        self.did.append(("slide", movement))
        self.steady()
        return 60.0, 25.0

    def lift(self):
        self.did.append("lift")

    def stop(self):
        self.stopped_at = time.monotonic()
        self.did.append("stop")


def run(script, arm):
    probe = Probe(script)
    with tactus.Probe(probe.port) as ours:
        events = [report["event"] for report in arm.drive(ours, ours.identify())]
    if probe.failed:
        raise probe.failed
    return events


def test_an_arm_presses_by_the_probes_force_slides_and_lifts():
    def script(probe):
        probe.order(1, "Lift")
        probe.heard(1, "Lifted")
        probe.order(2, {"Press": MOVEMENT})
        probe.heard(2, "Busy")
        for force in 100, 300, 510:
            probe.live(force)
        probe.heard(2, "Pressed")
        # what it stands in is said again and again
        probe.heard(2, "Pressed", 0.3)
        probe.order(3, "Slide")
        probe.heard(3, {"Slid": {"length_um": 60000, "speed_um_s": 25000}})
        probe.order(4, "Lift")
        # said twice, it is done once
        probe.order(4, "Lift")
        probe.heard(4, "Lifted")

    arm = Arm()
    events = run(script, arm)
    assert arm.did == ["lift", ("press", MOVEMENT), ("slide", MOVEMENT), "lift"]
    assert {"Arm": {"number": 3, "task": "Slide"}} in events


def test_a_stop_is_done_at_once_and_ends_what_the_arm_does():
    told = {}

    def script(probe):
        probe.order(1, {"Press": MOVEMENT})
        probe.heard(1, "Busy")
        told["at"] = time.monotonic()
        probe.order(2, "Stop")
        probe.heard(2, "Lifted")

    arm = Arm()
    run(script, arm)
    assert arm.did == [("press", MOVEMENT), "stop", "lift"]
    assert arm.stopped_at - told["at"] < 0.1, "the probe assumes 0.05 s on the way, and as much to stand"


def test_an_arm_that_hangs_says_nothing_more():
    def script(probe):
        probe.order(1, {"Press": MOVEMENT})
        probe.heard(1, "Busy")
        arm.hangs = True
        time.sleep(0.5)
        while not probe.states.empty():
            probe.states.get()
        with pytest.raises(AssertionError):
            probe.heard(1, "Busy", 0.5)
        arm.hangs = False
        probe.order(2, "Stop")
        probe.heard(2, "Lifted")

    arm = Arm()
    run(script, arm)
    assert arm.did[-2:] == ["stop", "lift"]


def test_an_arm_whose_probe_is_gone_stops_by_itself():
    def script(probe):
        probe.order(1, {"Press": MOVEMENT})
        probe.heard(1, "Busy")
        # and nothing more
        until = time.monotonic() + 2
        while arm.stopped_at is None and time.monotonic() < until:
            time.sleep(0.01)

    arm = Arm()
    run(script, arm)
    assert "stop" in arm.did and arm.did[-1] == "lift"


def test_what_an_arm_raises_is_a_failure_for_the_probe():
    class Broken(Arm):
        def press(self, movement):
            raise OSError("the controller does not answer")

    def script(probe):
        probe.order(1, {"Press": MOVEMENT})
        probe.heard(1, "Failed")
        probe.order(2, "Stop")
        probe.heard(2, "Lifted")

    arm = Broken()
    with pytest.raises(OSError, match="does not answer"):
        run(script, arm)
    assert arm.did == ["stop", "stop", "lift"]
