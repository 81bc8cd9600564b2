"""What pip builds the package with: maturin, with cargo's progress on the terminal that pip keeps it from."""

import os
import sys

import maturin
from maturin import *  # noqa: F403  the hooks of PEP 517 and 660


def _shown(hook):
    def build(*arguments, **named):
        try:
            terminal = os.open("/dev/tty", os.O_WRONLY)
        except OSError:
            # no terminal, and no window of Windows: `pip install -v` shows it
            return hook(*arguments, **named)
        hidden = os.dup(2)
        os.write(terminal, b"\n  compiling some 160 crates, which takes 2 to 5 minutes on two cores\n")
        os.dup2(terminal, 2)
        try:
            return hook(*arguments, **named)
        finally:
            sys.stderr.flush()
            os.dup2(hidden, 2)
            os.close(hidden)
            os.close(terminal)

    return build


build_wheel = _shown(maturin.build_wheel)
build_editable = _shown(maturin.build_editable)
