"""An arm of one's own that moves a probe's finger."""

import queue
import threading
import time

from ._tactus import TactusError

# An order that is worked on is spoken of so often, s.
_SAYS_S = 0.05


class Stopped(TactusError):
    """The arm is to stop at once: the probe demands it, or is gone. `Rig.alive` raises it; let it through."""


class Rig:
    """An arm that moves the finger of a probe with the firmware `tactus-arm`: derive from it, and give it `press`, `slide`, `lift` and
    `stop`. They run in a thread of their own, one at a time, and call `alive` in their loops; `stop` runs in another one.

    What the probe asks for is a dict: force_mn, speed_um_s, length_um (of the part at constant speed), start (thousandths of the room
    that the sample leaves the slide), approach_um_s (fastest that the finger may come down).

    >>> for report in MyArm().drive(probe, probe.identify()):
    ...     print(report["event"])
    """

    # a method that has said nothing for so long hangs, and a probe is gone, s: by this computer's clock
    _hangs_s, _gone_s = 0.3, 0.5
    _force_n = 0.0

    def _begin(self, probe):
        self._probe, self._orders = probe, queue.Queue()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._over = threading.Event()
        self._number, self._order, self._state, self._broken = None, None, "Busy", None
        self._alive_at = self._heard_at = time.monotonic()
        self._force_n = 0.0

    def press(self, movement):
        """Press the finger on the sample where the slide begins until `force_n` is the movement's, and hold it still. Return then."""
        raise NotImplementedError

    def slide(self, movement):
        """Slide, call `steady()` when the speed is constant, and stand again. Return the length (mm) and the speed (mm/s) of the
        part at constant speed, by the arm's own encoders."""
        raise NotImplementedError

    def lift(self):
        """Lift the finger off the sample, and stand. Return then. Also after a stop, from wherever the arm is."""
        raise NotImplementedError

    def stop(self):
        """Have the arm stand at once. It runs in another thread than the rest, and must not wait for anything."""
        raise NotImplementedError

    @property
    def force_n(self):
        """Contact force (N) as the probe said it last: 100 times a second while something moves."""
        return self._force_n

    def alive(self):
        """Say that the arm goes on: at least every 0.2 s. Raises `Stopped` where it is to stop."""
        self._alive_at = time.monotonic()
        if self._stopping.is_set():
            raise Stopped("stopped")

    def steady(self):
        """Say that the slide has come to its constant speed."""
        self.alive()
        self._reach("Steady")

    def drive(self, probe, events):
        """Do what the probe asks for while it is at something: yields its reports, as the iterator `events` of `Probe.identify` or
        `Probe.train` does. Ends with it; the arm has lifted the finger then.

        What the arm's own methods raise is "Failed" for the probe, and raised here in the end."""
        self._begin(probe)
        threads = [threading.Thread(target=run, daemon=True) for run in (self._work, self._say)]
        for thread in threads:
            thread.start()
        try:
            for report in events:
                self._heard_at = time.monotonic()
                event = report["event"]
                if isinstance(event, dict):
                    if "Arm" in event:
                        self._take(event["Arm"])
                    elif "Live" in event:
                        self._force_n = event["Live"]["force_mn"] / 1000
                yield report
        finally:
            if self._working():
                self._halt()
            self._orders.put(None)
            threads[0].join()
            self._over.set()
        if self._broken is not None:
            raise self._broken

    def _working(self):
        return self._order is not None and self._state in ("Busy", "Steady")

    def _halt(self):
        self._stopping.set()
        self.stop()

    def _take(self, order):
        with self._lock:
            if (self._number, self._order) == (order["number"], order["task"]):
                return
            self._number, self._order, self._state = order["number"], order["task"], "Busy"
        self._alive_at = time.monotonic()
        if self._order == "Stop":
            self._halt()
        self._orders.put((order["number"], order["task"]))

    def _reach(self, state, number=None):
        with self._lock:
            if number is None or number == self._number:
                self._state = state
                self._probe._tell_arm(self._number, state)

    def _rise(self):
        self._stopping.clear()
        self._alive_at = time.monotonic()
        self.lift()

    def _work(self):
        movement = None
        while (order := self._orders.get()) is not None:
            number, task = order
            try:
                if task in ("Stop", "Lift"):
                    self._rise()
                    self._reach("Lifted", number)
                elif task == "Slide":
                    length_mm, speed_mm_s = self.slide(movement)
                    slid = {"length_um": round(length_mm * 1e3), "speed_um_s": round(speed_mm_s * 1e3)}
                    self._reach({"Slid": slid}, number)
                else:
                    movement = task["Press"]
                    self.press(movement)
                    self._reach("Pressed", number)
            except Stopped:
                # a stop of the probe is an order that comes next; without one nobody is there any more
                if self._number == number:
                    self._rise()
            except BaseException as why:
                self._broken = why
                self.stop()
                self._reach("Failed", number)

    def _say(self):
        while not self._over.wait(_SAYS_S):
            now = time.monotonic()
            if self._working():
                if now - self._heard_at > self._gone_s and not self._stopping.is_set():
                    self._halt()
                if now - self._alive_at > self._hangs_s:
                    continue
            if self._number is not None:
                with self._lock:
                    self._probe._tell_arm(self._number, self._state)
