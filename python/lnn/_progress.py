"""What long work says meanwhile."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

Receiver = Callable[[str, float, float, str], None] | None
Progress = bool | Receiver


def receiver(progress: Progress) -> Receiver:
    """A receiver of events: the one that is given; for True a line at the terminal, in a notebook below its cell; none for None."""
    if progress is not True:
        return progress or None
    return Line() if _notebook() is None else Cell()


def _notebook() -> Any:
    """The shell of a notebook that runs this, if one does."""
    module = sys.modules.get("IPython")
    shell = None if module is None else module.get_ipython()
    return shell if hasattr(shell, "kernel") else None


class Bar:
    """Steps as a bar, and the last validation loss."""

    def __init__(self) -> None:
        self.loss = ""

    def text(self, kind: str, done: float, total: float) -> str | None:
        """The bar after an event; None after one that does not move it."""
        if kind == "epoch":
            self.loss = f", epoch {done:.0f}: validation loss {total:.3g}"
        elif total > 0:
            share = done / total
            return f"{kind:>6} [{'#' * round(30 * share):<30}] {share:4.0%}{self.loss}  "
        return None


class Line(Bar):
    """One line of the terminal that is written again and again."""

    def __call__(self, kind: str, done: float, total: float, text: str) -> None:
        bar = self.text(kind, done, total)
        if kind == "note":
            print(f"\r{text}", file=sys.stderr)
        elif bar is not None:
            end = "\n" if kind == "judged" and done >= total else ""
            print(f"\r{bar}", end=end, file=sys.stderr, flush=True)


class Cell(Bar):
    """One output of a notebook's cell that is replaced again and again: notes, then the bar."""

    def __init__(self) -> None:
        super().__init__()
        self.notes: list[str] = []
        self.bar = ""
        self.handle: Any = None

    def __call__(self, kind: str, done: float, total: float, text: str) -> None:
        from IPython.display import display

        bar = self.text(kind, done, total)
        if kind == "note":
            self.notes.append(text)
        elif bar is None:
            return
        else:
            self.bar = bar
        shown = {"text/plain": "\n".join([*self.notes, self.bar])}
        if self.handle is None:
            self.handle = display(shown, raw=True, display_id=True)
        else:
            self.handle.update(shown, raw=True)
