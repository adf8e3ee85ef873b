"""The page of a flight that is over: a timeline to play it."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import Any, Final

import viser

from command_line.printable import printable
from view import panels
from view.flight import Flight
from view.page import Server
from view.plots import Plot
from view.scene import EventKind
from view.stage import Stage
from view.timeline import Timeline

_FRAME_S: Final = 1.0 / 30.0
_TEXT_S: Final = 0.12  # between two texts, which a browser lays out anew
_PLOT_S: Final = 0.3
_MARKED: Final = (EventKind.MODE, EventKind.FAULT)
_MARKS: Final = 60  # most of the slider
_ANY: Final = "all events"
_PLAY, _WORST, _BACK, _ON = "▶ play / pause", "worst margin", "◀ event", "event ▶"
_SPEEDS: Final = {"0.1 ×": 0.1, "0.25 ×": 0.25, "0.5 ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0}


class LogPage:
    """Shows one flight until it is closed."""

    def __init__(self, server: Server, flight: Flight) -> None:
        self._server, self._flight = server, flight
        self._lock = threading.Lock()
        self._at = Timeline(flight.begin, flight.end, flight.begin)
        self._shown: float | None = None
        self._texts_s = self._plots_s = -1e9
        self._kind = ""
        self._undrawn = ""  # why a frame was not drawn, as it was said last
        self._ended = threading.Event()
        self.stage = Stage(server, flight.airframe)
        self.stage.frame(server, flight.region())
        self.stage.draw_reference(flight.reference())
        self.stage.draw_trail(flight.trail())
        self._build()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def go_to(self, t: float) -> None:
        """Stop at ``t`` [s, sensor time]."""
        self._change(lambda at: at.go_to(t))

    def close(self) -> None:
        """Stop drawing."""
        self._ended.set()
        self._thread.join()

    def _build(self) -> None:
        gui, flight = self._server.gui, self._flight
        self._answer = gui.add_html("")
        tabs = gui.add_tab_group()
        begin = flight.begin
        with tabs.add_tab("Now"):
            gui.add_html(panels.worst_html(flight.worst, begin))
            self._now = gui.add_html("")
        curves = flight.curves()
        with tabs.add_tab("Curves"):
            self._plots = [Plot(gui, curve, begin, 170) for curve in curves]
        with tabs.add_tab("Events"):
            self._events = gui.add_html("")
        with tabs.add_tab("About"):
            gui.add_html(panels.facts_html(flight.facts))
            truth = gui.add_checkbox("true state, where it differs by 1 cm", True)
            truth.on_update(lambda _: self._show_truth(truth.value))
        self._build_timeline()
        gui.add_command("Play or pause", hotkey="K").on_trigger(lambda _: self._press(_PLAY))
        gui.add_command("Worst margin", hotkey="W").on_trigger(lambda _: self._press(_WORST))
        gui.add_command("Next event", hotkey="L").on_trigger(lambda _: self._press(_ON))
        gui.add_command("Previous event", hotkey="J").on_trigger(lambda _: self._press(_BACK))

    def _build_timeline(self) -> None:
        gui, flight = self._server.gui, self._flight
        panel = gui.add_panel()
        with panel.add_tab(printable(flight.title)):
            margins = [c for c in flight.curves() if c.title.startswith("margin")][:1]
            self._plots += [
                Plot(gui, curve._replace(names=curve.names[:1], rows=curve.rows[:1]),
                     flight.begin, 105, legend=False)
                for curve in margins
            ]  # fmt: skip
            length = max(flight.end - flight.begin, 1e-3)
            self._slider: Any = gui.add_slider(
                "time [s]", 0.0, length, 0.01, 0.0, marks=_marks(flight, length)
            )
            self._slider.on_update(self._slid)
            buttons = gui.add_button_group("", (_BACK, _PLAY, _ON, _WORST))
            buttons.on_click(lambda event: self._press(event.target.value))
            kinds = gui.add_dropdown("event ◀ ▶", (_ANY, *EventKind), initial_value=_ANY)
            kinds.on_update(lambda _: self._choose(kinds.value))
            speed = gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1 ×")
            speed.on_update(lambda _: self._set_speed(_SPEEDS[speed.value]))
        panel.float(x=12, y=-12, width=640)

    def _press(self, button: str) -> None:
        flight = self._flight
        if button == _PLAY:
            self._change(Timeline.toggle)
        elif button == _WORST and flight.worst is not None:
            self.go_to(flight.worst.t)
        elif button == _ON:
            self._change(lambda at: at.next_event(flight.events, self._kind))
        elif button == _BACK:
            self._change(lambda at: at.previous_event(flight.events, self._kind))

    def _slid(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:  # not this page itself
            self.go_to(self._flight.begin + float(self._slider.value))

    def _choose(self, kind: str) -> None:
        self._kind = "" if kind == _ANY else kind

    def _set_speed(self, speed: float) -> None:
        self._change(lambda at: replace(at, speed=speed))

    def _show_truth(self, wanted: bool) -> None:
        self.stage.show_truth = wanted
        self._shown = None

    def _change(self, how: Any) -> None:
        with self._lock:
            self._at = how(self._at)

    def _run(self) -> None:
        before_s = time.monotonic()
        while not self._ended.wait(_FRAME_S):
            now_s = time.monotonic()
            with self._lock:
                self._at = at = self._at.advance(now_s - before_s)
            before_s = now_s
            if at.t != self._shown:
                self._shown = at.t
                self._draw(at, now_s)
            elif self._texts_s < 0.0:  # stopped, and the texts are of some time before
                self._texts(at, now_s)

    def _draw(self, at: Timeline, now_s: float) -> None:
        try:
            with self._server.atomic():
                self.stage.show(self._flight.scene(at.t))
        except Exception as error:  # of numbers that cannot be drawn; those of the next may be
            sentence = panels.undrawn(error)
            if sentence != self._undrawn:
                self._undrawn = sentence
                self._answer.content = panels.refusal_html(sentence)
        if now_s - self._texts_s > _TEXT_S:
            self._texts(at, now_s)
        else:
            self._texts_s = -abs(self._texts_s)

    def _texts(self, at: Timeline, now_s: float) -> None:
        flight = self._flight
        self._texts_s = now_s
        self._now.content = panels.now_html(flight.scene(at.t), flight.airframe, flight.begin)
        self._events.content = panels.events_html(flight.events, at.t, flight.begin)
        self._slider.value = round(at.t - flight.begin, 2)
        if now_s - self._plots_s > _PLOT_S or not at.playing:
            self._plots_s = now_s
            for plot in self._plots:
                plot.point_to(at.t)


def _marks(flight: Flight, length: float) -> tuple[float | tuple[float, str], ...]:
    """Both ends of a flight that is ``length`` [s] long, and where modes and faults changed."""
    changes = [one.t - flight.begin for one in flight.events if one.kind in _MARKED]
    within = [round(t, 2) for t in changes if 0.0 < t < length]
    return ((0.0, "0"), *dict.fromkeys(within[:_MARKS]), (length, f"{length:.0f}"))
