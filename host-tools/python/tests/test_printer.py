"""A 3D printer at a probe, by `tactus.Printer`, spoken to through a peer that nobody here wrote: OctoPrint's virtual printer."""

import json
import re
import socket
import threading
import time
import types

import pytest
from conftest import received, sent
from test_arm import MOVEMENT, Probe

import tactus

virtual = pytest.importorskip(
    "octoprint.plugins.virtual_printer.virtual", reason="`pip install octoprint` for a printer to speak with"
)
from octoprint.plugins.virtual_printer import VirtualPrinterPlugin  # noqa: E402

SAMPLE_Z = -2.5


class Settings:
    """OctoPrint's settings of the plugin: its defaults, and what a test changes."""

    def __init__(self, folder, **changed):
        plugin = object.__new__(VirtualPrinterPlugin)
        self.values = {**plugin.get_settings_defaults(), **changed}
        self.folder = str(folder)

    def get(self, path, merged=False):
        return self.values[path[0]]

    get_int = get_float = get_boolean = get

    def global_get_basefolder(self, _name):
        return self.folder


class Served:
    """The virtual printer on a TCP port, and the force on a finger that hangs on it."""

    def __init__(self, folder, monkeypatch, **changed):
        hooks = types.SimpleNamespace(get_hooks=lambda *_: {})
        monkeypatch.setattr(virtual, "plugin_manager", lambda: hooks)
        profile = {"axes": {}, "volume": {"width": 200, "depth": 200, "height": 200}, "extruder": {"count": 1}}
        profiles = types.SimpleNamespace(get_current_or_default=lambda: profile)
        self.printer = virtual.VirtualPrinter(Settings(folder, **changed), profiles, str(folder), read_timeout=0.02)
        self.lines, self.said, self.out = [], [], threading.Lock()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = "tcp:127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        line, _ = self.listener.accept()
        threading.Thread(target=self.answer, args=(line,), daemon=True).start()
        while came := received(line):
            self.lines += came.decode().splitlines()
            self.printer.write(came)

    def answer(self, line):
        while self.printer.outgoing is not None:
            said = self.printer.readline()
            if said:
                self.said.append(said.decode().strip())
                sent(line, said.strip() + b"\n")

    def force_mn(self):
        depth = SAMPLE_Z - (self.printer._lastZ or 0.0)
        return round(1000 * max(depth, 0.0))

    def close(self):
        self.printer.close()


@pytest.fixture
def setup_file(tmp_path):
    setup = {
        "version": 1,
        "port": "nobody",
        "baud": 115200,
        "dialect": {"marlin": {"emergency_parser": True}},
        "axis": "X",
        "sample_mm": [0.0, 75.0],
        "lifted_mm": 0.5,
        "floor_mm": -8.0,
        "acceleration_mm_s2": 500.0,
        "start_s": [-0.1, 1.5],
        "stiffness_n_mm": 1.0,
        "backlash_mm": 0.05,
        "parked": [0.0, 0.0],
    }
    path = tmp_path / "printer.json"
    path.write_text(json.dumps(setup))
    return path


def session(served, setup_file, script):
    """Has a probe's orders done by the printer; the probe says the force a hundred times a second meanwhile."""
    over = threading.Event()

    def says(probe):
        def force():
            while not over.wait(0.01):
                live = {"force_mn": served.force_mn(), "steps": 0, "stage_um": 0, "speed_um_s": 0, "current_ma": 0}
                with served.out:
                    probe.tell({"Live": live})

        thread = threading.Thread(target=force, daemon=True)
        thread.start()
        try:
            script(Ordered(probe, served))
        finally:
            over.set()
            thread.join()

    probe = Probe(says)
    with tactus.Printer(served.port, setup=setup_file) as printer, tactus.Probe(probe.port) as linked:
        for _ in printer.drive(linked, linked.identify()):
            pass
        failure = printer.failure()
    if probe.failed:
        raise AssertionError("%s: %s" % (failure, "\n".join(served.said[-30:]))) from probe.failed
    return failure


class Ordered:
    """A probe that gives orders."""

    def __init__(self, probe, served):
        self.probe, self.served, self.order = probe, served, 0

    def does(self, task, *ends, timeout=40):
        self.order += 1
        with self.served.out:
            self.probe.tell({"Arm": {"number": self.order, "task": task}})
        until = time.monotonic() + timeout
        while time.monotonic() < until:
            number, state = self.probe.states.get(timeout=timeout)
            name = state if isinstance(state, str) else next(iter(state))
            if number == self.order and name in (*ends, "Failed"):
                assert name in ends, self.served.said[-12:]
                return state
        raise AssertionError("%s does not end in %s; it said last: %s" % (task, ends, self.served.said[-8:]))


# a slide's time is not the one of a real printer: this one answers each line after a moment, and moves nothing
SLOW = {**MOVEMENT, "force_mn": 400, "speed_um_s": 10000, "length_um": 20000}


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"simulated_errors": [], "resend_ratio": 10},
        {"simulated_errors": ["3:checksum_mismatch", "7:resend", "12:missing_lineno", "15:resend_with_timeout"]},
        {"okAfterResend": True, "resend_ratio": 12, "simulated_errors": []},
        {"okBeforeCommandOutput": True, "sendBusy": True, "busyInterval": 0.2},
        {"okFormatString": "ok N{lastN} P15 B{buffer}", "forceChecksum": True},
    ],
    ids=["as it is", "resends", "errors", "ok after resend", "busy", "advanced ok"],
)
def test_a_session_with_octoprints_virtual_printer(tmp_path, monkeypatch, setup_file, changed):
    served = Served(tmp_path, monkeypatch, **changed)
    forces = []

    def script(probe):
        probe.does("Stop", "Lifted")
        probe.does({"Press": SLOW}, "Pressed")
        forces.append(served.force_mn())
        probe.does("Lift", "Lifted")
        forces.append(served.force_mn())
        probe.does({"Press": SLOW}, "Pressed")
        probe.does("Stop", "Lifted")

    try:
        assert session(served, setup_file, script) is None
    finally:
        served.close()
    assert forces[0] == pytest.approx(400, abs=20) and forces[1] == 0
    codes = [re.sub(r"^N\d+ |\*\d+$", "", line).split()[0] for line in served.lines if line]
    assert {"M115", "G90", "M107", "G1", "M400", "M114"} <= set(codes), codes
    # it is never told to heat, to feed filament, or to find the bed
    assert not {"M104", "M109", "M140", "M190", "G28", "G29"} & set(codes), codes
    assert not any(re.search(r"G[01].* E", line) for line in served.lines)
    kept = json.loads(setup_file.read_text())
    assert kept["parked"][1] == 0.5
