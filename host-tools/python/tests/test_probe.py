"""A probe in Python at the other end: it knows the messages from docs/src/wire.json alone."""

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import ROOT, received, sent

import tactus

if os.name == "nt":
    pytest.skip("the client beside the page of the link is for POSIX", allow_module_level=True)
sys.path.insert(0, str(ROOT / "docs/src"))
sys.dont_write_bytecode = True
import client  # noqa: E402

STATUS = {"phase": "Ready", "textures": 2, "table_bytes": 5, "table_crc": 7, "factory": True, "counts": {"slots": 4400}}
OBSERVED = {"properties": [0.5, 1.5, None], "background": 2.0, "bands": [1024] * 12}
VERDICT = {"texture": 1, "name": "Burlap", "probability": 0.995, "sure": True, "slides": 2}


class Probe:
    """Answers one host after the other; `says` maps a command's name to the events that come before its end."""

    def __init__(self, **says):
        self.says, self.asked = {"Status": [{"Status": STATUS}], **says}, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = "tcp:127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        self.number, self.held = 0, None
        while True:
            line, _ = self.listener.accept()
            rest = b""
            while line.fileno() >= 0 and (came := received(line)):
                *frames, rest = (rest + came).split(b"\0")
                for request in map(client.message, filter(None, frames)):
                    request = client.read("Request", request)[0]
                    command = request["command"]
                    name, with_ = next(iter(command.items())) if isinstance(command, dict) else (command, None)
                    self.asked.append((name, with_))
                    self.answer(line, request["id"], name, self.says.get(name, []))

    def answer(self, line, id_, name, events):
        for event in events:
            if event == "gone":
                return line.close()
            if event == "for ever":
                self.held = id_
                return
            if isinstance(event, dict) and "Refused" in event:
                return self.tell(line, {"Refused": {**event["Refused"], "id": id_}})
            self.tell(line, event)
        if name == "Stop" and self.held is not None:
            # as the probe does it: what is stopped is refused before the stop is done
            self.tell(line, {"Refused": {"id": self.held, "why": {"Rig": "Stopped"}}})
            self.held = None
        self.tell(line, {"Done": id_})

    def tell(self, line, event):
        report = {"number": self.number, "at_ms": 50 * self.number, "event": event}
        self.number = (self.number + 1) % 65536
        sent(line, client.frame(client.write("Report", report)))


def chosen(slide):
    action = {"movement": 0}
    return {"Chosen": {"slide": slide, "movement": [1262, 10000], "action": action, "expected": []}}


def reported(slide):
    return {"SlideReport": {"slide": slide, "action": {"movement": 0}, "observed": OBSERVED, "posterior": [3, [[1, 0.75], [2, 0.25]]]}}


def test_the_status_is_the_links():
    probe = Probe()
    with tactus.Probe(probe.port) as ours:
        status = ours.status()
        assert (status["phase"], status["textures"], status["counts"]["slots"]) == ("Ready", 2, 4400)
        ours.stream(True)
        assert ours.losses == (0, 0)
        assert ours.port == probe.port
    assert [name for name, _ in probe.asked] == ["Status", "Stream"] and probe.asked[1][1] is True
    with pytest.raises(tactus.ProbeError, match="closed"):
        ours.status()


def test_an_exploration_is_an_iterator_of_events():
    probe = Probe(Identify=[chosen(1), reported(1), chosen(2), reported(2), {"Verdict": VERDICT}])
    with tactus.Probe(probe.port) as ours:
        events = list(ours.identify(threshold=0.98, max_slides=4, seed=7))
        names = [next(iter(report["event"])) for report in events]
        assert names == ["Chosen", "SlideReport", "Chosen", "SlideReport", "Verdict", "Done"]
        assert events[4]["event"]["Verdict"]["name"] == "Burlap"
        assert events[1]["event"]["SlideReport"]["observed"]["properties"] == [0.5, 1.5, None]
        assert events[1]["event"]["SlideReport"]["posterior"] == [0.0, 0.75, 0.25]
        assert [report["number"] for report in events] == list(range(6)) and events[2]["at_ms"] == 100
        asked = probe.asked[0][1]
        assert (asked["max_slides"], asked["seed"], asked["open"]) == (4, 7, True)
        assert np.float32(asked["threshold"]) == np.float32(0.98)
        assert ours.status()["phase"] == "Ready"


def test_a_training_says_each_slide():
    slide = {"TrainingSlide": {"movement": [500, 25119], "trial": 1, "left": 2, "observed": OBSERVED}}
    probe = Probe(Train=[slide, slide])
    with tactus.Probe(probe.port) as ours:
        events = list(ours.train("cork", trials=2, seed=3))
        assert [next(iter(e["event"])) for e in events] == ["TrainingSlide", "TrainingSlide", "Done"]
        assert probe.asked == [("Train", {"name": "cork", "trials": 2, "pilot": False, "seed": 3})]
        with pytest.raises(ValueError, match="41 bytes: shorten it to 40"):
            ours.train("c" * 41)


def test_what_the_probe_refuses_is_raised_with_its_words():
    probe = Probe(Identify=[{"Refused": {"why": "Busy"}}])
    with tactus.Probe(probe.port) as ours:
        with pytest.raises(tactus.ProbeError, match="the probe refused"):
            list(ours.identify())


def test_one_thing_at_a_time_and_close_stops_it():
    probe = Probe(Identify=[chosen(1), "for ever"])
    with tactus.Probe(probe.port) as ours:
        events = ours.identify()
        assert "Chosen" in next(events)["event"]
        with pytest.raises(tactus.ProbeError, match="is at something"):
            ours.status()
        events.close()
        assert [name for name, _ in probe.asked[:2]] == ["Identify", "Stop"]
        assert list(events) == []
        assert ours.status()["phase"] == "Ready"


def test_a_probe_that_is_gone_is_told():
    with tactus.Probe(Probe(Status=["gone"]).port) as ours:
        with pytest.raises(tactus.ProbeError, match="closed the port|the port failed"):
            ours.status()
    with tactus.Probe(Probe(Status=["for ever"]).port, timeout_s=0.2) as ours:
        with pytest.raises(tactus.ProbeError, match="said nothing"):
            ours.status()


def test_errors_of_the_port_are_the_commands(command):
    with socket.create_server(("127.0.0.1", 0)) as free:
        nobody = "tcp:127.0.0.1:%d" % free.getsockname()[1]
    for port in nobody, "/dev/none":
        with pytest.raises(tactus.ProbeError) as why:
            tactus.Probe(port)
        assert str(why.value) == command("device", "status", "--port", port)
    probe = Probe()
    with tactus.Probe(probe.port):
        with pytest.raises(tactus.ProbeError, match="is used by"):
            tactus.Probe(probe.port)


CTRL_C = """
import sys, tactus
with tactus.Probe(sys.argv[1]) as probe:
    try:
        for report in probe.identify():
            print("chosen", flush=True)
    except KeyboardInterrupt:
        print("stopped,", probe.status()["phase"], flush=True)
"""


def test_ctrl_c_stops_the_rig():
    probe = Probe(Identify=[chosen(1), "for ever"])
    python = [sys.executable, "-c", CTRL_C, probe.port]
    with subprocess.Popen(python, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout.readline() == "chosen\n"
        time.sleep(0.3)
        run.send_signal(signal.SIGINT)
        try:
            out, _ = run.communicate(timeout=30)
        finally:
            run.kill()
    assert (run.returncode, out) == (0, "stopped, Ready\n")
    # it asks where the finger is until that is lifted
    assert [name for name, _ in probe.asked][:4] == ["Identify", "Stop", "Stream", "Status"]


CTRL_C_TWICE = """
import sys, tactus
try:
    with tactus.Probe(sys.argv[1], timeout_s=60) as probe:
        for report in getattr(probe, sys.argv[2])() if sys.argv[2] == "identify" else iter(probe.status, None):
            print("chosen", flush=True)
except KeyboardInterrupt:
    print("left", flush=True)
"""


@pytest.mark.parametrize("call", ["identify", "status"])
def test_ctrl_c_twice_does_not_wait_for_a_probe_that_does_not_stop(call):
    status = [{"Status": STATUS}, "for ever"]
    probe = Probe(Identify=[chosen(1), "for ever"], Stop=["for ever"], Status=status if call == "status" else [])
    run = [sys.executable, "-c", CTRL_C_TWICE, probe.port, call]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        try:
            while not probe.asked:
                time.sleep(0.05)
            for _ in range(2):
                time.sleep(0.5)
                run.send_signal(signal.SIGINT)
            out, err = run.communicate(timeout=10)
        finally:
            run.kill()
    assert (run.returncode, out.splitlines()[-1], err) == (0, "left", "")


def test_a_forked_process_leaves_the_probe_alone():
    probe = Probe(Identify=[chosen(1), "for ever"])
    with tactus.Probe(probe.port) as ours:
        events = ours.identify()
        next(events)
        child = os.fork()
        if child == 0:
            said = []
            for ask in ours.status, events.close, ours.stop, lambda: next(events):
                try:
                    ask()
                except tactus.ProbeError as why:
                    said.append('"spawn"' in str(why))
            ours.close()
            os._exit(0 if said == [True] * 4 else 1)
        assert os.waitpid(child, 0)[1] == 0
        assert [name for name, _ in probe.asked] == ["Identify"]
        events.close()
        assert ours.status()["phase"] == "Ready"


def test_what_has_a_port_is_not_pickled():
    with tactus.Probe(Probe(Identify=[chosen(1)]).port) as ours:
        for thing in ours, ours.identify():
            with pytest.raises(TypeError, match="cannot be pickled or copied: "):
                pickle.dumps(thing)


def test_a_log_of_the_command_is_read(command, tmp_path):
    import json

    log = tmp_path / "session.jsonl"
    command("device", "status", "--port", Probe().port, "--log", log)
    read = tactus.read_log(log)
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert read == lines
    assert [next(iter(line)) for line in read][:2] == ["session", "command"]
    assert {"command": "Status"} in read
    assert any("Status" in line["report"]["event"] for line in read if "report" in line)
    log.write_text(log.read_text() + "no line\n")
    with pytest.raises(tactus.ProbeError, match=f"line {len(lines) + 1} is no line of a session's log"):
        tactus.read_log(log)
    log.write_text('{"session":{"tactus":"9","protocol":99,"port":"x"}}\n')
    with pytest.raises(tactus.ProbeError, match="version 99"):
        tactus.read_log(log)
    with pytest.raises(OSError):
        tactus.read_log(tmp_path / "nowhere")
