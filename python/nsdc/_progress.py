"""How far something is, on standard error."""

from __future__ import annotations

import sys
import time


class Bar:
    """A line that says how many runs are done, once they take longer than a moment."""

    #: Seconds before the first line, and between two.
    FIRST, NEXT = 0.5, 0.1

    def __init__(self, name: str, count: int, is_shown: bool | None) -> None:
        in_notebook = "ipykernel" in sys.modules
        self._is_shown = sys.stderr.isatty() or in_notebook if is_shown is None else is_shown
        self._name, self._count = name, count
        self._start = self._last = time.monotonic()
        self._width = 0

    def show(self, done: int) -> None:
        """So many are done."""
        now = time.monotonic()
        if not self._is_shown or now - self._start < self.FIRST or now - self._last < self.NEXT:
            return
        self._last = now
        left = (now - self._start) * (self._count - done) / max(done, 1)
        share = done / max(self._count, 1)
        full = round(20 * share)
        bar = "█" * full + "░" * (20 - full)
        self._write(f"{self._name} {bar} {done} of {self._count} runs, {left:.0f} s left")

    def end(self) -> None:
        """Nothing is left to be told."""
        if self._width:
            self._write("")
            sys.stderr.write("\r")

    def _write(self, line: str) -> None:
        sys.stderr.write("\r" + line.ljust(self._width))
        sys.stderr.flush()
        self._width = len(line)
