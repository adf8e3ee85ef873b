"""Sentences, progress and the result of a flight: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, TextIO

from command_line.output import say
from command_line.printable import printable

if TYPE_CHECKING:
    from rich.progress import Progress

_SILENT_S: Final = 60.0  # without a terminal, at most this long between two lines


class Display:
    """Progress and sentences of a long operation, on one stream."""

    def __init__(
        self,
        stream: TextIO,
        *,
        lines: int = 10,
        threaded: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Draw nothing yet.

        Where there is no terminal ``lines`` report on one thing, and more if it takes more minutes
        by the ``clock`` [s]. ``threaded`` draws between steps too, from a thread, which would be
        measured with them.
        """
        self._stream = stream
        self._lines = lines
        self._threaded = threaded
        self._bar: Progress | None = None
        self._shown = ("", 0)
        self._flying = False
        self._clock = clock
        self._shown_s = clock()

    def say(self, sentence: str) -> None:
        """Print one line, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(
                printable(sentence), highlight=False, markup=False, soft_wrap=True
            )
        else:
            say(sentence, self._stream)

    @contextmanager
    def progress(self) -> Iterator[None]:
        """Show a bar while the context lasts, if the stream is a terminal."""
        if not self._stream.isatty():
            yield
            return
        from rich import progress
        from rich.console import Console
        from rich.text import Text

        class TimeLeft(progress.TimeRemainingColumn):
            def render(self, task: progress.Task) -> Text:
                return Text() if task.fields["timed"] else super().render(task)

        bar = progress.Progress(
            "{task.description}",
            progress.BarColumn(),
            "{task.fields[state]}",
            TimeLeft(),
            console=Console(file=self._stream),
            transient=True,
            auto_refresh=self._threaded,
            refresh_per_second=4,
        )
        with bar:
            bar.add_task("starting", total=None, state="", timed=False)
            self._bar = bar
            try:
                yield
            finally:
                self._bar = None

    def report(
        self, what: str, done: float, total: float, state: str = "", *, timed: bool = False
    ) -> None:
        """Show how much of one thing is done, ``done`` of ``total`` [any unit].

        A ``state`` that is ``timed`` tells the time left itself.
        """
        counted, state = not state, state or f"{done} of {total}"
        if self._bar is not None:
            self._bar.update(
                self._bar.task_ids[0],
                description=what,
                completed=done,
                total=None if math.isinf(total) else total,
                state=state,
                timed=timed,
                refresh=not self._threaded,
            )
            return
        shown = (what, int(self._lines * done / max(total, 1e-9)))
        now_s = self._clock()
        overdue = shown == self._shown and now_s - self._shown_s >= _SILENT_S
        if overdue or (shown != self._shown and (counted or shown[1] > 0)):
            self.say(f"{what} {state}")
            self._shown_s = now_s
        self._shown = shown

    def share(self, what: str, done: int, total: int) -> None:
        """Show the share of one thing that is done, ``done`` of ``total``."""
        self.report(what, done, total, f"{100 * done // max(total, 1)} %")

    def flying(
        self, time_s: float, duration_s: float, margin_m: float | None, real_time_factor: float
    ) -> None:
        """Show how far a flight is; ``real_time_factor`` [1]."""
        if not self._flying:
            self._flying = True
            # While others fly: it takes 0.2 s, which a stall's end has not.
            import_module("rich.table")
        if math.isinf(duration_s) and self._bar is None:
            if not self._shown[0]:
                self.say("flying until interrupted, by Ctrl-C or SIGINT")
            self._shown = ("flying", 0)
            return
        margin = "" if margin_m is None else f"  margin {1000.0 * margin_m:.0f} mm"
        state = f"{time_s:6.1f} s  ×{real_time_factor:.1f}{margin}"
        self.report("flying", time_s, duration_s, state)

    def result(
        self,
        result: dict[str, Any],
        first: list[tuple[str, str]],
        rows: list[tuple[str, str]],
    ) -> None:
        """Print PASS or FAIL and the ``first`` rows as lines, then the others as a table."""
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        console = Console(file=self._stream, highlight=False)
        table = Table(show_header=False, title=None)
        table.add_column("what")
        table.add_column("value", justify="right")
        for name, value in rows:
            table.add_row(Text(printable(name)), Text(printable(value)))
        passed = result["completed"]
        style = "bold green" if passed else "bold red"
        console.print("PASS" if passed else "FAIL", style=style, end=" ")
        console.print(printable(result["end_reason"]), markup=False, soft_wrap=True)
        for name, value in first:
            console.print(printable(f"{name:20}{value}"), markup=False, soft_wrap=True)
        console.print(table)
        for name, path in result["logs"].items():
            console.print(printable(f"{name:12} {path}"), markup=False, soft_wrap=True)
        self._stream.flush()  # what follows may go to another stream
