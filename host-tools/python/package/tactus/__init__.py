"""Tactus in Python: texture identification by touch, by the same code that runs on the chip and in the command `tactus`.

Recordings become features, features a table, and a table explores. All arrays that come out are read-only numpy arrays. What goes
wrong is a `TactusError` with the sentence of the command line. Long work releases the interpreter's lock, and Ctrl-C ends it.
It works in processes that were forked, too; `Recordings`, `Slide`, `Features` and `Table` can be pickled.
`TactusClassifier` needs scikit-learn.
"""

from . import _tactus
from ._tactus import (
    MAX_FEATURES,
    TEXTURES,
    Events,
    Explorer,
    Features,
    Printer,
    Probe,
    ProbeError,
    RecordingError,
    Recordings,
    SimulatedRig,
    SimulationError,
    Slide,
    SlideError,
    Table,
    TableError,
    TactusError,
    __version__,
    features,
    features_of,
    read_log,
    simulate,
)
from .rig import Rig, Stopped

__all__ = [
    "Events",
    "Explorer",
    "Features",
    "MAX_FEATURES",
    "Printer",
    "Probe",
    "ProbeError",
    "RecordingError",
    "Recordings",
    "Rig",
    "SimulatedRig",
    "SimulationError",
    "Slide",
    "SlideError",
    "Stopped",
    "Table",
    "TEXTURES",
    "TableError",
    "TactusError",
    "__version__",
    "evaluate",
    "features",
    "features_of",
    "identify",
    "read_log",
    "simulate",
    "verify",
]

_DEFAULTS = {
    "method": "fused",
    "protocol": "interleaved",
    "train_slides": 5,
    "runs": 8000,
    "seed": 1,
    "threshold": 0.99,
    "max_slides": 10,
    "features": None,
    "drift": (0.12, 0.04),
    "false_alarm": None,
}


def _arguments(given):
    for name in given:
        if name not in _DEFAULTS:
            raise TypeError(f"{name!r} is none of the arguments {', '.join(_DEFAULTS)}")
    return {**_DEFAULTS, **given}


def __getattr__(name):
    # scikit-learn takes a second to import, and need not be there
    if name == "TactusClassifier":
        from .estimator import TactusClassifier

        return TactusClassifier
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def evaluate(recordings, labels=None, sessions=None, **arguments):
    """Play virtual explorations and count the right answers, as `tactus evaluate` does.

    recordings: `Recordings`; every texture is the unknown one in turn. Or features of one's own, as of `Table.learn`, in the
    order of time, with a label for each slide, and its session where it is known.
    method: "fused", "fused-cycle", "fused-random", "student-all", "student", "paper", "cycle" or "random".
    protocol: "interleaved", "blocked", "drift", "leave-one-session-out" or "leave-one-run-out": which
        slides are learned from, and which are tested.
    train_slides: slides to learn from, per texture and movement (5).
    runs: virtual explorations (8000). seed: of all draws (1).
    threshold: an exploration ends when a texture is more probable than this (0.99). max_slides: or after so many (10).
    features: "force", "pressure", "bands" or "properties"; the best that every slide has, unless given.
    drift: standard deviations of band powers (ln) and of traction (share) from session to session (0.12, 0.04).
    false_alarm: share of known textures that may be taken for new ones; the table's own, unless given.

    Returns a dict with what `tactus evaluate --format json` prints, to the digit: shares 0 to 1, slides, `verdicts`,
    `reliability`, `confused`.
    Raises TactusError where the slides do not suffice, ValueError for an argument, KeyboardInterrupt after Ctrl-C.
    """
    return _tactus.evaluate(recordings, labels, sessions, _arguments(arguments))


def identify(table, slides, **arguments):
    """Say which texture of a table slides are of, slide by slide until it is sure, as `tactus identify` does.

    table: a `Table`. slides: `Features` of one texture, or rows of features where the table was learned from such, in
    the order of time; those of movements that the table does not have are passed over. arguments: method, threshold,
    max_slides, open and false_alarm, as of `Explorer`.

    Returns a dict as of `Explorer.best`: told ("sure", "most-like", "changed", "new" or "undecided"), texture, probability, slides.
    Raises TableError where a slide lacks what is compared.
    """
    explorer, settings = Explorer(table, **arguments), set(table.settings)
    for slide in slides:
        if isinstance(slide, Features) and (slide.force_n, slide.speed_mm_s) not in settings:
            continue
        explorer.update(slide)
        if explorer.verdict():
            break
    return explorer.best()


def verify(table, texture, slides, **arguments):
    """Say whether slides are of a texture of a table, slide by slide until it is told, as `tactus verify` does.

    table: a fused `Table` with limits. texture: a name of it. slides: `Features` in the order of time; those of movements that the
    table does not have are passed over. arguments: threshold, max_slides and false_alarm, as of `Explorer`.

    Returns a list of dicts, one for each slide that counted: `score`, `limit`, `answer` ("Same", "Different", "Unsure"); the last
    one has the answer, and `false_accept`, the share of other textures that would have passed for it (None: not known). Raises TableError where the table has no limits, KeyError where it does not have the texture.
    """
    most = arguments.get("max_slides", 10)
    explorer = Explorer(table, among=[texture], method="fused-cycle", **arguments)
    settings, told = set(table.settings), []
    for slide in slides:
        if len(told) == most or told and told[-1]["answer"] != "Unsure":
            break
        if (slide.force_n, slide.speed_mm_s) not in settings:
            continue
        explorer.update(slide)
        now = explorer.verification()
        if now is None:
            raise TableError("the table has no limits: learn it with --method fused from three textures at least")
        told.append(now)
    if told:
        told[-1]["false_accept"] = explorer.false_accept()
    return told
