"""The inspector on a terminal."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import ClassVar, Final, Protocol

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.coordinate import Coordinate
from textual.widgets import DataTable, Footer, Input, RichLog, Static

from command_line.output import listed
from command_line.printable import printable
from fsw.autopilot.model.airframe import Airframe
from messages.frames import Frame
from messages.message_ids import SYSTEM_ID
from view.scene import Event, EventKind, Scene
from view.telemetry import Heard, Telemetry
from view.top.peer import Value, fields, meaning, unit

_LINES: Final = 2000  # of events
_PERIOD_S: Final = 0.2  # of the picture
_POLL_S: Final = 0.02  # rates are measured between arrivals
_BAR: Final = 14  # characters
_BAR_M: Final = 0.5  # margin that fills it
_STALE_S: Final = 3.0
_LOST_S: Final = 2.0
_NAMED: Final = 5  # systems, in the headline
_ALARMING: Final = (EventKind.WARNING, EventKind.FAULT)


class Peer(Protocol):
    """Where messages come from."""

    def poll(self, now: float) -> list[Frame]:
        """Everything that has come by ``now`` [s]."""
        ...

    def close(self) -> None:
        """Listen no more."""
        ...


class TopApp(App[None]):
    """Rates and fields of every message, margins and events."""

    TITLE = "pandion top"
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    #headline { height: 1; background: $primary; color: $text; padding: 0 1; text-style: bold; }
    #streams { width: 60; height: 1fr; } #fields { width: 1fr; height: 1fr; }
    #lower { height: 12; } #margins { width: 60; height: 12; } #events { width: 1fr; height: 12; }
    #filter { display: none; height: 3; } #filter.shown { display: block; }
    DataTable, RichLog { border: round $primary; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "quit"),
        Binding("p", "pause", "pause"),
        Binding("slash", "filter", "filter"),
        Binding("escape", "all", "show all", show=False),
    ]

    def __init__(
        self, peer: Peer, airframe: Airframe, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Show what ``peer`` hears of a vehicle of this ``airframe``."""
        super().__init__()
        self.telemetry = Telemetry(airframe)
        self.paused = False
        self.pattern = ""
        self._peer = peer
        self._clock = clock
        self._shown: Event | None = None  # the newest event that is shown

    def compose(self) -> ComposeResult:
        """The headline, two tables, margins and events."""
        yield Static("waiting for the vehicle", id="headline", markup=False)
        yield Input(placeholder="part of a message's name", id="filter")
        with Horizontal():
            yield DataTable(id="streams", cursor_type="row", zebra_stripes=True)
            yield DataTable(id="fields", cursor_type="row", zebra_stripes=True)
        with Horizontal(id="lower"):
            yield DataTable(id="margins", cursor_type="none", show_cursor=False)
            yield RichLog(id="events", wrap=True, markup=False, min_width=20, max_lines=_LINES)
        yield Footer()

    def on_mount(self) -> None:
        """Lay the tables out and begin to listen."""
        streams = self.query_one("#streams", DataTable)
        self._by_name = streams.add_column("message", width=26)
        for label, width in (("comp", 4), ("Hz", 5), ("count", 6), ("age", 5)):
            streams.add_column(label, width=width)
        self.query_one("#fields", DataTable).add_columns("field", "value", "unit", "meaning")
        for label, width in (("", 22), ("mm", 6), ("h", 6), (" ", _BAR)):
            self.query_one("#margins", DataTable).add_column(label, width=width)
        for name in ("streams", "fields", "margins", "events"):
            self.query_one(f"#{name}").border_title = name
        streams.focus()
        self.set_interval(_POLL_S, self.take)
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

    def take(self) -> None:
        """Take what came."""
        now = self._clock()
        for frame in self._peer.poll(now):
            self.telemetry.take(frame, now)

    def refresh_all(self) -> None:
        """Show what is known."""
        self.take()
        now = self._clock()
        scene = self.telemetry.scene(now)
        self.query_one("#headline", Static).update(printable(headline(scene)))
        if self.paused:
            return
        self._show_streams(now)
        self._show_fields()
        self._show_margins(scene)
        self._show_events()

    def streams(self) -> Iterator[tuple[str, Heard]]:
        """Key and newest of each kind of message that the pattern leaves, by name."""
        heard = sorted(self.telemetry.heard.values(), key=lambda one: (one.name, one.component))
        for one in heard:
            if self.pattern in one.name:
                yield f"{one.system}/{one.component}/{one.message_id}", one

    def _show_streams(self, now: float) -> None:
        table = self.query_one("#streams", DataTable)
        known = table.row_count
        for key, one in self.streams():
            age = now - one.at
            style = "dim" if age > _STALE_S else ""
            shown = (f"{one.rate(now):.1f}", str(one.count), f"{age:.1f}")
            cells = [Text(cell, style=style, justify="right") for cell in shown]
            if key not in table.rows:
                table.add_row(Text(one.name), str(one.component), *cells, key=key)
                continue
            row = table.get_row_index(key)
            for column, cell in enumerate(cells, start=2):
                table.update_cell_at(Coordinate(row, column), cell)
        if table.row_count > known:
            table.sort(self._by_name, key=str)

    def chosen(self) -> Heard | None:
        """The kind of message under the cursor."""
        table = self.query_one("#streams", DataTable)
        if not table.row_count:
            return None
        key = table.coordinate_to_cell_key(table.cursor_coordinate).row_key.value
        return dict(self.streams()).get(key or "")

    def _show_fields(self) -> None:
        table, one = self.query_one("#fields", DataTable), self.chosen()
        if one is None:
            return
        table.border_title = one.name
        kept, of = table.scroll_y, one.message_id
        table.clear()
        for name, value in fields(of, one.values).items():
            table.add_row(name, Text(shown_value(value)), unit(of, name), meaning(of, name, value))
        table.scroll_y = kept

    def _show_margins(self, scene: Scene) -> None:
        table = self.query_one("#margins", DataTable)
        table.clear()
        for one in scene.margins:
            least = one.margin <= scene.minimum
            style = "bold red" if one.margin < 0.0 else "bold" if least else ""
            cells = (one.name, f"{1e3 * one.margin:.0f}", f"{one.barrier:+.2f}", _bar(one.margin))
            table.add_row(*(Text(cell, style=style) for cell in cells))

    def _show_events(self) -> None:
        log = self.query_one("#events", RichLog)
        every = list(self.telemetry.events)
        known = [k for k, event in enumerate(every) if event is self._shown]
        for event in every[known[0] + 1 if known else 0 :]:
            style = "bold red" if event.kind in _ALARMING else ""
            # Its time is unknown before the clock of the vehicle is.
            at = "" if math.isnan(event.t) else f"{event.t:.1f} s"
            log.write(Text(f"{at:>10}  {printable(event.text)}", style=style))
            self._shown = event


def headline(scene: Scene) -> str:
    """The vehicle in one line."""
    if math.isnan(scene.link_age):
        if not scene.others:
            return "no vehicle has answered yet"
        others = listed([*map(str, scene.others)], _NAMED)
        return f"no vehicle of system {SYSTEM_ID} has answered yet; those of system {others} speak"
    if scene.link_age > _LOST_S:
        return f"vehicle lost: silent for {scene.link_age:.0f} s"
    parts = [scene.mode, "armed" if scene.armed else "disarmed"] if scene.mode else ["no heartbeat"]
    parts += [scene.failures] if scene.failures else []
    if scene.battery is not None:
        parts.append(f"battery {100.0 * scene.battery.remaining:.0f} %")
    if scene.estimate is not None:
        north, east, down = scene.estimate.p
        parts.append(f"N {north:+.2f} E {east:+.2f} up {-down:.2f} m")
    if scene.margins:
        parts.append(f"margin {1e3 * scene.minimum:.0f} mm")
    if scene.safety.refusals:
        parts.append(f"{scene.safety.refusals} refused")
    if scene.solver is not None:
        timed = "" if math.isnan(scene.solver.total) else f" in {1e3 * scene.solver.total:.1f} ms"
        parts.append(f"plan {scene.solver.status}{timed}")
    parts += [f"dropped {scene.dropped}"] if scene.dropped else []
    return "  ".join(parts)


def _bar(margin: float) -> str:
    """A ``margin`` [m] as a bar; none where it is not finite, which a vehicle may send."""
    share = min(max(margin / _BAR_M, 0.0), 1.0) if math.isfinite(margin) else 0.0
    return "█" * round(_BAR * share)


def shown_value(value: Value) -> str:
    """A value of a field in few characters."""
    if isinstance(value, tuple):
        return " ".join(shown_value(one) for one in value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(str(value))
