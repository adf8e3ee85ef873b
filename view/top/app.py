"""The inspector on a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar, Final, Protocol

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.coordinate import Coordinate
from textual.widgets import DataTable, Footer, Input, RichLog, Static

from command_line.printable import printable
from view.top.inspector import Inspector, Stream
from view.top.peer import Message, Value, meaning, unit

_PERIOD_S: Final = 0.2
_BAR: Final = 20  # characters
_BAR_M: Final = 0.5  # margin that fills it
_WARNING: Final = 4  # MAV_SEVERITY
_STALE_S: Final = 3.0


class Peer(Protocol):
    """Where messages come from."""

    def poll(self, now: float) -> list[Message]:
        """Everything that has come by ``now`` [s]."""
        ...

    def close(self) -> None:
        """Listen no more."""
        ...


class TopApp(App[None]):
    """Rates and fields of every message, margins and texts."""

    TITLE = "pandion top"
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    #headline { height: 1; background: $primary; color: $text; padding: 0 1; text-style: bold; }
    #streams { width: 60; height: 1fr; } #fields { width: 1fr; height: 1fr; }
    #lower { height: 12; } #margins { width: 60; height: 12; } #texts { width: 1fr; height: 12; }
    #filter { display: none; height: 3; } #filter.shown { display: block; }
    DataTable, RichLog { border: round $primary; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "quit"),
        Binding("p", "pause", "pause"),
        Binding("slash", "filter", "filter"),
        Binding("escape", "all", "show all", show=False),
    ]

    def __init__(self, peer: Peer, clock: Callable[[], float] = time.monotonic) -> None:
        """Show what ``peer`` hears."""
        super().__init__()
        self.inspector = Inspector()
        self.paused = False
        self.pattern = ""
        self._peer = peer
        self._clock = clock
        self._told = 0.0  # when the newest text that is shown came

    def compose(self) -> ComposeResult:
        """The headline, two tables, margins and texts."""
        yield Static("waiting for the vehicle", id="headline", markup=False)
        yield Input(placeholder="part of a message's name", id="filter")
        with Horizontal():
            yield DataTable(id="streams", cursor_type="row", zebra_stripes=True)
            yield DataTable(id="fields", cursor_type="row", zebra_stripes=True)
        with Horizontal(id="lower"):
            yield DataTable(id="margins", cursor_type="none", show_cursor=False)
            yield RichLog(id="texts", wrap=True, markup=False, min_width=20)
        yield Footer()

    def on_mount(self) -> None:
        """Lay the tables out and begin to listen."""
        streams = self.query_one("#streams", DataTable)
        self._by_name = streams.add_column("message", width=26)
        for label, width in (("comp", 4), ("Hz", 5), ("count", 6), ("age", 5)):
            streams.add_column(label, width=width)
        self.query_one("#fields", DataTable).add_columns("field", "value", "unit", "meaning")
        for label, width in (("#", 3), ("mm", 6), ("h", 6), ("", _BAR)):
            self.query_one("#margins", DataTable).add_column(label, width=width)
        for name in ("streams", "fields", "margins", "texts"):
            self.query_one(f"#{name}").border_title = name
        streams.focus()
        self.set_interval(_PERIOD_S, self.refresh_all)

    def on_unmount(self) -> None:
        """Give the port back."""
        self._peer.close()

    def action_pause(self) -> None:
        """Stop the picture; messages are counted all the same."""
        self.paused = not self.paused
        self.query_one("#streams").border_title = "streams, paused" if self.paused else "streams"

    def action_filter(self) -> None:
        """Ask for a part of a name."""
        asked = self.query_one("#filter", Input)
        asked.add_class("shown")
        asked.focus()

    def action_all(self) -> None:
        """Show every message again."""
        asked = self.query_one("#filter", Input)
        asked.value = ""
        asked.remove_class("shown")
        self.query_one("#streams", DataTable).focus()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Show what the pattern leaves."""
        self.pattern = event.value.upper()
        self.query_one("#streams", DataTable).clear()
        self.refresh_all()

    def on_input_submitted(self) -> None:
        """Back to the table, with the pattern."""
        self.query_one("#filter").remove_class("shown")
        self.query_one("#streams", DataTable).focus()

    def on_data_table_row_highlighted(self, event: DataTable.RowHighlighted) -> None:
        """Show the fields of the chosen message."""
        if event.data_table.id == "streams":
            self._show_fields()

    def refresh_all(self) -> None:
        """Take what came and show it."""
        now = self._clock()
        self.inspector.see(self._peer.poll(now))
        self.query_one("#headline", Static).update(printable(self.inspector.headline(now)))
        if self.paused:
            return
        self._show_streams(now)
        self._show_fields()
        self._show_margins()
        self._show_texts()

    def _show_streams(self, now: float) -> None:
        table = self.query_one("#streams", DataTable)
        for (name, component), stream in sorted(self.inspector.streams.items()):
            if self.pattern not in name:
                continue
            age = stream.age(now)
            style = "dim" if age > _STALE_S else ""
            shown = (f"{stream.rate(now):.1f}", str(stream.count), f"{age:.1f}")
            cells = [Text(one, style=style, justify="right") for one in shown]
            key = f"{name}/{component}"
            if key not in table.rows:
                table.add_row(Text(name), str(component), *cells, key=key)
                table.sort(self._by_name, key=str)
                continue
            row = table.get_row_index(key)
            for column, cell in enumerate(cells, start=2):
                table.update_cell_at(Coordinate(row, column), cell)

    def chosen(self) -> Stream | None:
        """The stream under the cursor."""
        table = self.query_one("#streams", DataTable)
        if not table.row_count:
            return None
        key = table.coordinate_to_cell_key(table.cursor_coordinate).row_key.value or ""
        name, _, component = key.partition("/")
        return self.inspector.streams.get((name, int(component or 0)))

    def _show_fields(self) -> None:
        table, stream = self.query_one("#fields", DataTable), self.chosen()
        if stream is None:
            return
        table.border_title = stream.name
        kept = table.scroll_y
        table.clear()
        for name, value in stream.last.items():
            of = stream.message_id
            table.add_row(name, Text(shown_value(value)), unit(of, name), meaning(of, name, value))
        table.scroll_y = kept

    def _show_margins(self) -> None:
        table = self.query_one("#margins", DataTable)
        table.clear()
        for line in self.inspector.margins():
            style = "bold red" if line.margin < 0.0 else "bold" if line.least else ""
            bar = "█" * round(_BAR * min(max(line.margin / _BAR_M, 0.0), 1.0))
            cells = (f"{line.number}", f"{1e3 * line.margin:.0f}", f"{line.barrier:+.2f}", bar)
            table.add_row(*(Text(cell, style=style) for cell in cells))

    def _show_texts(self) -> None:
        log = self.query_one("#texts", RichLog)
        for said in self.inspector.texts:
            if said.t > self._told:
                style = "bold red" if said.severity <= _WARNING else ""
                log.write(Text(printable(said.text), style=style))
        if self.inspector.texts:
            self._told = self.inspector.texts[-1].t


def shown_value(value: Value) -> str:
    """A value of a field in few characters."""
    if isinstance(value, tuple):
        return " ".join(shown_value(one) for one in value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(str(value))
