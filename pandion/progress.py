"""How far something long is: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    import rich.progress


class Progress(AbstractContextManager["Progress"]):
    """Told of each step forward; draws while it is entered."""

    def __init__(
        self, stream: TextIO, *, lines: int = 0, counted: bool = True, threaded: bool = True
    ) -> None:
        """Draw nothing yet.

        Args:
            stream: Where to.
            lines: How many tell of one thing where there is no terminal.
            counted: Show how many there are, not the share of them.
            threaded: Draw between steps too, from a thread, which would be measured with them.
        """
        self._stream = stream
        self._lines = lines
        self._counted = counted
        self._threaded = threaded
        self._bar: rich.progress.Progress | None = None
        self._task: rich.progress.TaskID | None = None
        self._told = ("", -1)

    def __enter__(self) -> Progress:
        if self._stream.isatty():
            from rich import progress
            from rich.console import Console

            self._bar = progress.Progress(
                "{task.description}",
                progress.BarColumn(),
                progress.MofNCompleteColumn() if self._counted else progress.TaskProgressColumn(),
                progress.TimeRemainingColumn(),
                console=Console(file=self._stream),
                transient=True,
                auto_refresh=self._threaded,
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=None)
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def report(self, what: str, done: int, total: int) -> None:
        """Show how much of one thing is done."""
        if self._bar is not None and self._task is not None:
            self._bar.update(
                self._task,
                description=what,
                completed=done,
                total=total,
                refresh=not self._threaded,
            )
        elif self._lines:
            told = (what, self._lines * done // max(total, 1))
            if told != self._told:
                self._told = told
                print(f"{what} {done} of {total}", file=self._stream, flush=True)
