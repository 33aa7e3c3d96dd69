"""What long work says meanwhile."""

from __future__ import annotations

import sys
from collections.abc import Callable

Receiver = Callable[[str, float, float, str], None] | None
Progress = bool | Receiver


def receiver(progress: Progress) -> Receiver:
    """A receiver of events: the one that is given, a line at the terminal or in a notebook for True, none for None."""
    return Line() if progress is True else progress or None


class Line:
    """One line that is written again and again: steps, the last validation loss."""

    def __init__(self) -> None:
        self.loss = ""

    def __call__(self, kind: str, done: float, total: float, text: str) -> None:
        if kind == "note":
            print(f"\r{text}", file=sys.stderr)
        elif kind == "epoch":
            self.loss = f", epoch {done:.0f}: validation loss {total:.3g}"
        elif total > 0:
            share = done / total
            bar = "#" * round(30 * share)
            end = "\n" if kind == "judged" and done >= total else ""
            print(f"\r{kind:>6} [{bar:<30}] {share:4.0%}{self.loss}  ", end=end, file=sys.stderr, flush=True)
