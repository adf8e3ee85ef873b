"""What a flight looks like in the terminal: a bar where there is one, plain lines elsewhere."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_PLAIN_STEPS = 10  # lines for a whole flight


class Display:
    """Sentences, progress and the verdict, all to one stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._duration_s = 1.0
        self._told = 0

    def say(self, sentence: str) -> None:
        """Print one line, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(sentence, highlight=False, markup=False, soft_wrap=True)
        else:
            print(sentence, file=self._stream, flush=True)

    def flight(self, duration_s: float) -> AbstractContextManager[Any]:
        """Show progress of a flight of this length while the context lasts."""
        self._duration_s = duration_s
        if not self._stream.isatty():
            return nullcontext()
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[state]}"),
            console=Console(file=self._stream),
            transient=True,
            refresh_per_second=4,
        )
        self._task = self._bar.add_task(
            "waiting", total=None if math.isinf(duration_s) else duration_s, state=""
        )
        return self._bar

    def progress(self, time_s: float, margin_m: float | None, real_time_factor: float) -> None:
        """Move the bar, or print a line for every tenth; ``real_time_factor`` [1]."""
        margin = "" if margin_m is None else f"  margin {1000.0 * margin_m:.0f} mm"
        state = f"{time_s:6.1f} s  ×{real_time_factor:.1f}{margin}"
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=time_s, description="flying", state=state)
            return
        if math.isinf(self._duration_s):
            if self._told == 0:
                self._told = 1
                self.say("flying until interrupted, by Ctrl-C or SIGINT")
            return
        tenth = int(_PLAIN_STEPS * time_s / self._duration_s)
        if tenth > self._told:
            self._told = tenth
            self.say(f"flying {state}")

    def end(self) -> None:
        """Leave the bar."""
        self._bar = None

    def verdict(self, result: dict[str, Any], rows: list[tuple[str, str]]) -> None:
        """Print the table and PASS or FAIL."""
        from rich.console import Console
        from rich.table import Table

        console = Console(file=self._stream, highlight=False)
        table = Table(show_header=False, title=None)
        table.add_column("what")
        table.add_column("value", justify="right")
        for name, value in rows:
            table.add_row(name, value)
        console.print(table)
        passed = result["completed"]
        style = "bold green" if passed else "bold red"
        console.print("PASS" if passed else "FAIL", style=style, end=" ")
        console.print(result["end_reason"], markup=False, soft_wrap=True)
        for name, path in result["logs"].items():
            console.print(f"{name:12} {path}", markup=False, soft_wrap=True)
        self._stream.flush()  # what follows may go to another stream
