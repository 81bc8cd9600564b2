"""Where recordings and the command are. A test that lacks something is skipped, and fails where it must not be."""

import contextlib
import os
import pathlib
import signal
import subprocess

import pytest

import tactus

ROOT = pathlib.Path(__file__).resolve().parents[3]
REQUIRED = os.environ.get("CI") == "true" or os.environ.get("TACTUS_REQUIRE_DATA") == "1"

# what a shell starts in the background ignores it, and so do its children: those of the tests are to hear it
signal.signal(signal.SIGINT, signal.default_int_handler)


def lacking(why, required=REQUIRED):
    """Skips the test, or fails it where that must not be."""
    if required:
        pytest.fail(why)
    pytest.skip(why)


def pytest_runtest_logreport(report):
    """xtask lists what was skipped."""
    log = os.environ.get("TACTUS_SKIP_LOG")
    if log and report.skipped:
        with open(log, "a") as file:
            file.write(f"python {report.nodeid}: {report.longrepr[-1]}\n")


def sklearn():
    """Skips the test without scikit-learn; fails it where that must be."""
    try:
        tactus.TactusClassifier  # noqa: B018
    except ImportError as why:
        lacking(str(why), os.environ.get("TACTUS_REQUIRE_SKLEARN") == "1")


def received(line):
    """The next bytes of a line; none at its end, which a host that closes it with bytes unread makes a reset."""
    try:
        return line.recv(4096)
    except ConnectionResetError:
        return b""


def sent(line, said):
    """Sends it to a host that may have gone by then."""
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):
        line.sendall(said)


def data(name):
    """A folder of recordings that the repository does not have."""
    folder = pathlib.Path(os.environ.get("TACTUS_DATA", ROOT.parent / "shared/data")) / name
    if not folder.is_dir():
        lacking(f"no folder {folder}", os.environ.get("TACTUS_REQUIRE_DATA") == "1")
    return folder


@pytest.fixture(scope="session")
def small():
    """Six simulated textures, which the repository has."""
    return tactus.Recordings(ROOT / "host-tools/recordings/simulated")


@pytest.fixture(scope="session")
def biotac():
    """680 slides of a real finger."""
    return tactus.Recordings(data("biotac"))


@pytest.fixture(scope="session")
def command():
    """Runs the command `tactus`: what it prints, or its complaint."""
    name = os.environ.get("TACTUS_COMMAND", ROOT / "target/debug/tactus")
    if not pathlib.Path(name).is_file():
        lacking(f"{name} is not built: cargo build")

    def run(*arguments):
        done = subprocess.run([name, *map(str, arguments)], capture_output=True, text=True)
        return done.stdout if done.returncode in (0, 3, 4) else done.stderr.strip().removeprefix("error: ")

    run.file = name
    return run
