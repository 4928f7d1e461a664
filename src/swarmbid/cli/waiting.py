"""One line that tells whoever waits how far it is, written over and over, gone at the end.

Rich's bars hide the cursor, and an interrupt, which ends the program at once, would leave it hidden.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PAUSE = 0.1
"""s, the least time between two changes of the line."""
WIPE = "\r\x1b[K"


@contextmanager
def rounds_shown(what: str) -> Iterator[Callable[[float], None] | None]:
    """Yield a function that shows the time, s, of a simulation; None if standard error is no terminal."""
    with _line(what) as write:
        yield None if write is None else lambda now: write(f"round {int(now) + 1}")


@contextmanager
def seconds_shown(what: str) -> Iterator[Callable[[float], None] | None]:
    """Yield a function that shows the time, s, of a mission; None if standard error is no terminal."""
    with _line(what) as write:
        yield None if write is None else lambda now: write(f"{now:.0f} s")


@contextmanager
def cases_shown(what: str) -> Iterator[Callable[[int, int], None] | None]:
    """Yield a function that shows (done, total); None if standard error is no terminal."""
    with _line(what) as write:
        yield None if write is None else lambda done, total: write(f"{done:,} of {total:,}")


@contextmanager
def _line(what: str) -> Iterator[Callable[[str], None] | None]:
    if not sys.stderr.isatty():
        yield None
        return
    due = 0.0

    def write(how_far: str) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due:
            due = now + PAUSE
            width = shutil.get_terminal_size().columns - 1
            print(WIPE + f"{what}: {how_far}"[:width], end="", file=sys.stderr, flush=True)

    try:
        write("...")
        yield write
    finally:
        print(WIPE, end="", file=sys.stderr, flush=True)
